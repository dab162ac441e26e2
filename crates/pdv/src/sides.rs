use glam::DVec3;

use crate::{Error, Factor, Observation};

/// G on either side of the mirror direction, in the logarithmic domain, over d_p².
pub(crate) struct Sides {
    towards: Option<Factor>,
    outwards: Option<Factor>,
    dropped: usize,
}

impl Sides {
    pub(crate) fn new(plane: &[Observation]) -> Result<Self, Error> {
        let finite = |o: &&Observation| o.deviation.is_finite() && o.rgb.is_finite();
        let side = |keep: fn(f64) -> bool| {
            let points = plane.iter().filter(finite).filter(|o| keep(o.deviation));
            Factor::over_squares("G", points.map(|o| (o.deviation.abs(), o.log()))).ok()
        };
        // The mirror direction itself belongs to both.
        let (towards, outwards) = (side(|d| d >= 0.0), side(|d| d <= 0.0));
        let dropped = plane.len() - plane.iter().filter(finite).count();
        if towards.is_none() && outwards.is_none() {
            return Err(Error::Empty { factor: "G", dropped });
        }
        Ok(Self {
            towards,
            outwards,
            dropped,
        })
    }

    /// G on the side of a signed deviation, where that side was measured so far out; else of both.
    pub(crate) fn at(&self, deviation: f64) -> DVec3 {
        let side = if deviation < 0.0 {
            &self.outwards
        } else {
            &self.towards
        };
        match side {
            Some(side) if !side.extrapolated(deviation.powi(2)) => side.at(deviation.powi(2)),
            _ => self.both(deviation.powi(2)),
        }
    }

    /// Both sides as one: equal weight at the mirror direction, the outward side fading linearly to none at its end.
    fn both(&self, square: f64) -> DVec3 {
        let (towards, outwards) = match (&self.towards, &self.outwards) {
            (Some(towards), Some(outwards)) => (towards, outwards),
            (Some(side), None) | (None, Some(side)) => return side.at(square),
            (None, None) => return DVec3::ZERO,
        };
        let (end, outer_end) = (towards.range().1, outwards.range().1);
        if square > end && square <= outer_end {
            return outwards.at(square);
        }
        let weight = 0.5 * (1.0 - (square / outer_end.max(f64::MIN_POSITIVE)).sqrt()).max(0.0);
        towards.at(square).lerp(outwards.at(square), weight)
    }

    /// One factor over d_p² at the nodes of both sides.
    pub(crate) fn factor(&self) -> Result<Factor, Error> {
        let sides = || [&self.towards, &self.outwards].into_iter().flatten();
        let mut nodes: Vec<f64> = sides().flat_map(|side| side.points().map(|(x, _)| x)).collect();
        if sides().count() == 2 {
            // Between the innermost readings of both sides lies the mirror direction, about which G is even.
            nodes.push(0.0);
        }
        Factor::over_squares(
            "G",
            nodes.into_iter().map(|square| (square.sqrt(), self.both(square))),
        )
    }

    pub(crate) fn dropped(&self) -> usize {
        self.dropped
    }
}
