use crate::sweeps::Sweeps;
use crate::{Error, Planes, Shape};

const SCALES: [f64; 8] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 10.0, 1e4];
const DIFFUSE: [f64; 4] = [0.0, 0.5, 0.9, 1.0];
const SHADOWING: [f64; 4] = [1.0, 0.3, 0.1, 0.03];
const DARKENING: [f64; 4] = [0.0, 0.1, 0.2, 0.35];

/// The model whose shape best predicts each side of the planes from the others.
pub(crate) fn choose(sweeps: &Sweeps) -> Result<Planes, Error> {
    let mut best: Option<(f64, Shape)> = None;
    for scale in SCALES {
        for diffuse in DIFFUSE {
            for shadowing in SHADOWING {
                for darkening in DARKENING {
                    let shape = Shape {
                        scale,
                        diffuse,
                        shadowing,
                        darkening,
                    };
                    let model = Planes::new(sweeps, shape)?;
                    let Some(error) = model.cross_validate(sweeps) else {
                        return Planes::new(sweeps, Shape::DEFAULT);
                    };
                    if best.is_none_or(|(least, _)| error < least) {
                        best = Some((error, shape));
                    }
                }
            }
        }
    }
    let (error, shape) = best.map_or((None, Shape::DEFAULT), |(error, shape)| (Some(error), shape));
    Ok(Planes::new(sweeps, shape)?.with_error(error))
}
