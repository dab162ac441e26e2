use crate::surface::Surface;
use crate::sweeps::Sweeps;
use crate::{Error, Shape};

const SCALES: [f64; 8] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 10.0, 1e4];
const DIFFUSE: [f64; 4] = [0.0, 0.5, 0.9, 1.0];
const SHADOWING: [f64; 4] = [1.0, 0.3, 0.1, 0.03];
const DARKENING: [f64; 4] = [0.0, 0.1, 0.2, 0.35];

/// The surface whose shape best predicts each side of the planes from the others, and how well it does.
///
/// For every scale shadowing and darkening together, since either can stand for the other, then the diffuse floor;
/// around the best of them once more. That tries a third of all shapes.
pub(crate) fn choose(sweeps: &Sweeps) -> Result<(Surface, Option<f64>), Error> {
    let mut best: Option<(f64, Shape)> = None;
    for scale in SCALES {
        let start = Shape {
            scale,
            ..Shape::DEFAULT
        };
        let found = least(sweeps, falloffs(start))?;
        let Some((_, shape)) = found else {
            return Ok((Surface::new(sweeps, Shape::DEFAULT)?, None));
        };
        best = better(best, better(found, least(sweeps, floors(shape))?));
    }
    if let Some((_, shape)) = best {
        best = better(best, least(sweeps, falloffs(shape))?);
    }
    if let Some((_, shape)) = best {
        best = better(best, least(sweeps, floors(shape))?);
    }
    let (error, shape) = best.map_or((None, Shape::DEFAULT), |(error, shape)| (Some(error), shape));
    Ok((Surface::new(sweeps, shape)?, error))
}

/// The shape with any shadowing and darkening.
fn falloffs(of: Shape) -> impl Iterator<Item = Shape> {
    SHADOWING.into_iter().flat_map(move |shadowing| {
        DARKENING.into_iter().map(move |darkening| Shape {
            shadowing,
            darkening,
            ..of
        })
    })
}

/// The shape with any diffuse floor.
fn floors(of: Shape) -> impl Iterator<Item = Shape> {
    DIFFUSE.into_iter().map(move |diffuse| Shape { diffuse, ..of })
}

/// The shape with the least error; `None` where nothing can be compared.
fn least(sweeps: &Sweeps, shapes: impl Iterator<Item = Shape>) -> Result<Option<(f64, Shape)>, Error> {
    let mut best = None;
    for shape in shapes {
        let error = Surface::new(sweeps, shape)?.cross_validate(sweeps);
        best = better(best, error.map(|error| (error, shape)));
    }
    Ok(best)
}

/// Whichever has the smaller error, the first where they are equal.
fn better(a: Option<(f64, Shape)>, b: Option<(f64, Shape)>) -> Option<(f64, Shape)> {
    match (a, b) {
        (Some(a), Some(b)) if b.0 < a.0 => Some(b),
        (None, b) => b,
        (a, _) => a,
    }
}
