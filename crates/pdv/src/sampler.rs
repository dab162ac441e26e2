use std::f64::consts::FRAC_PI_2;

use brdf::Spherical;
use glam::{DVec2, DVec3};

use crate::albedo::{arc_on_disk, ring};
use crate::{Model, Pdv};

/// Zenith angles of the viewer with a table of their own.
const ROWS: usize = 48;
/// Rings about the mirror direction; cell n begins at d_p = (1 + sin θ_o)(n/128)⁴, dense where lobes are.
const CELLS: usize = 128;
/// Points of a ring at which a model is looked at.
const POINTS: usize = 4;
/// Azimuths of a ring at which a model that is not constant along φ_p is looked at.
const AZIMUTHS: usize = 8;
/// Share that is drawn evenly by the projected area, so that no direction is left out.
const EVEN: f64 = 0.01;

/// Draws light directions for a viewer in proportion to f cos θ_i, averaged along φ_p.
///
/// cos θ_i dω_i is area on the projected disk, where PDV is polar, so a ring is drawn by its share of the directional
/// albedo, then a place in it evenly by area and azimuth over the arc that lies on the disk; nothing is rejected. For a
/// model that is constant along φ_p that is f cos θ_i itself, up to the width of the rings. The density that
/// [`Sampler::pdf`] gives is exactly that of what [`Sampler::sample`] draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampler {
    rows: Vec<Row>,
}

/// A direction that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit vector to the light.
    pub incident: DVec3,
    /// Its density over solid angle, sr⁻¹.
    pub pdf: f64,
}

/// What a [`Sampler`] holds for one zenith angle θ_o of the viewer, for whoever draws elsewhere, such as a renderer on a
/// graphics card.
///
/// Row n of N stands at tan(θ_o/2) = n/(N − 1); ring m of M begins at d_p = (1 + sin θ_o)(m/M)⁴.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rings<'a> {
    /// With what probability a ring is drawn; all together 1.
    pub shares: &'a [f64],
    /// Walker's alias table of them: of each ring, which are equally probable here, the share that is its own, and which
    /// ring the rest is.
    pub aliases: &'a [(f64, u8)],
}

/// The rings for one zenith angle: shares of 1, and Walker's alias table of them.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    shares: Vec<f64>,
    aliases: Vec<(f64, u8)>,
}

impl Sampler {
    /// The sampler of a model, by the mean of its channels.
    ///
    /// ```
    /// # use pdv::Observation;
    /// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
    /// # let plane = |theta_r: f64| -> Vec<Observation> {
    /// #     let deviations = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8];
    /// #     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
    /// # };
    /// # let arc: Vec<_> = [0.1, 0.5, 0.9, 1.3].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
    ///
    /// use pdv::{Planes, Sampler};
    ///
    /// let model = Planes::from_observations(&[plane(0.3), plane(1.0)], &arc)?;
    /// let sampler = Sampler::new(&model);
    /// let viewer = glam::DVec3::new(0.6, 0.0, 0.8);
    /// let light = sampler.sample(viewer, [0.3, 0.7]).expect("the viewer is above the horizon");
    /// assert!((light.pdf / sampler.pdf(light.incident, viewer) - 1.0).abs() < 1e-6);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn new(model: &(impl Model + ?Sized)) -> Self {
        let theta_o = |n: usize| 2.0 * (n as f64 / (ROWS - 1) as f64).atan();
        Self {
            rows: (0..ROWS).map(|n| Row::new(model, theta_o(n))).collect(),
        }
    }

    /// What is drawn from, ascending by the viewer's zenith angle.
    ///
    /// ```
    /// # use pdv::Observation;
    /// # let grey = brdf::Lambert::new(0.5).expect("0.5 is an albedo");
    /// # let plane: Vec<_> = [-0.1, 0.0, 0.2].iter().filter_map(|&d| Observation::of(&grey, 0.5, d)).collect();
    /// let sampler = pdv::Sampler::new(&pdv::Planes::from_observations(&[plane], &[])?);
    /// assert!(sampler.rings().all(|rings| (rings.shares.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn rings(&self) -> impl ExactSizeIterator<Item = Rings<'_>> {
        self.rows.iter().map(|row| Rings {
            shares: &row.shares,
            aliases: &row.aliases,
        })
    }

    /// The light for a viewer at a unit vector above the horizon and two even numbers of 0 … below 1; `None` where the
    /// viewer stands at or below the horizon.
    pub fn sample(&self, exitant: DVec3, [first, second]: [f64; 2]) -> Option<Sample> {
        if exitant.z.is_nan() || exitant.z <= 0.0 {
            return None;
        }
        let view = exitant.truncate();
        let sin = view.length().min(1.0);
        let (row, between) = place(sin, exitant.z);
        // One number chooses the row, then the ring, then the place in it: it has digits enough.
        let (row_taken, number) = if first < between {
            (row + 1, first / between)
        } else {
            (row, (first - between) / (1.0 - between))
        };
        let (cell, within) = self.rows[row_taken].draw(number);
        let [inner, outer] = ring(cell, CELLS, sin);
        let d = (inner * inner + within * (outer * outer - inner * inner)).sqrt();
        let arc = arc_on_disk(d, sin);
        let (sin_p, cos_p) = ((second - 0.5) * arc).sin_cos();
        let light = DVec2::new(d * cos_p - sin, d * sin_p);
        let length = light.length_squared();
        let cos_i = (1.0 - length).max(0.0).sqrt();
        let along = if sin > 0.0 { view / sin } else { DVec2::X };
        let pdf = self.density(row, between, cell, [inner, outer], arc) * cos_i;
        Some(Sample {
            incident: along.rotate(light).extend(cos_i),
            pdf,
        })
    }

    /// Density over solid angle, sr⁻¹, with which [`Sampler::sample`] draws a light for a viewer; 0 where either is at
    /// or below the horizon.
    pub fn pdf(&self, incident: DVec3, exitant: DVec3) -> f64 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return 0.0;
        }
        let sin = exitant.truncate().length().min(1.0);
        let (row, between) = place(sin, exitant.z);
        let d = (incident + exitant).truncate().length();
        let share = (d / (1.0 + sin)).sqrt().sqrt();
        let cell = ((share * CELLS as f64) as usize).min(CELLS - 1);
        let arc = arc_on_disk(d, sin);
        self.density(row, between, cell, ring(cell, CELLS, sin), arc) * incident.z
    }

    /// Density over the projected area in a ring at which `arc` lies on the disk.
    fn density(&self, row: usize, between: f64, cell: usize, [inner, outer]: [f64; 2], arc: f64) -> f64 {
        let share = self.rows[row].shares[cell] * (1.0 - between) + self.rows[row + 1].shares[cell] * between;
        2.0 * share / ((outer * outer - inner * inner) * arc).max(f64::MIN_POSITIVE)
    }
}

/// The row before a viewer's zenith angle and how far it is to the next. Rows are even in tan(θ_o/2), which is nearly
/// as even as the angle itself, and needs no arctangent.
fn place(sin: f64, cos: f64) -> (usize, f64) {
    let place = (sin / (1.0 + cos)).clamp(0.0, 1.0) * (ROWS - 1) as f64;
    let row = (place as usize).min(ROWS - 2);
    (row, place - row as f64)
}

impl Row {
    fn new(model: &(impl Model + ?Sized), theta_o: f64) -> Self {
        // At the horizon itself a model is 0.
        let theta_o = theta_o.min(FRAC_PI_2 - 1e-3);
        let sin = theta_o.sin();
        let exitant = Spherical {
            theta: theta_o,
            phi: 0.0,
        }
        .direction();
        let azimuths = if model.phi_p_constant() { 1 } else { AZIMUTHS };
        let (mut shares, mut areas) = (Vec::with_capacity(CELLS), Vec::with_capacity(CELLS));
        for cell in 0..CELLS {
            let [inner, outer] = ring(cell, CELLS, sin);
            let (mut reflected, mut area) = (0.0, 0.0);
            for point in 0..POINTS {
                let t = (point as f64 + 0.5) / POINTS as f64;
                let d = (inner * inner + t * (outer * outer - inner * inner)).sqrt();
                let arc = arc_on_disk(d, sin);
                area += arc;
                for n in 0..azimuths {
                    let phi_p = ((n as f64 + 0.5) / azimuths as f64 - 0.5) * arc;
                    let pdv = Pdv {
                        theta_r: theta_o,
                        d_p: d,
                        phi_p: if azimuths == 1 { 0.0 } else { phi_p },
                    };
                    if let Some((incident, _)) = pdv.directions() {
                        reflected += arc * model.eval(incident, exitant).element_sum() / azimuths as f64;
                    }
                }
            }
            let width = outer * outer - inner * inner;
            shares.push(reflected * width);
            areas.push(area * width);
        }
        let (reflected, area) = (shares.iter().sum::<f64>(), areas.iter().sum::<f64>());
        let even = if reflected > 0.0 { EVEN } else { 1.0 };
        let scale = (1.0 - even) / reflected.max(f64::MIN_POSITIVE);
        let mut shares: Vec<f64> = shares
            .iter()
            .zip(&areas)
            .map(|(reflected, a)| reflected * scale + even * a / area)
            .collect();
        let total: f64 = shares.iter().sum();
        shares.iter_mut().for_each(|share| *share /= total);
        Self {
            aliases: aliases(&shares),
            shares,
        }
    }

    /// A ring and how far in it, 0 … 1, of an even number.
    fn draw(&self, number: f64) -> (usize, f64) {
        let place = number.clamp(0.0, 1.0) * CELLS as f64;
        let cell = (place as usize).min(CELLS - 1);
        let rest = place - cell as f64;
        let (own, alias) = self.aliases[cell];
        if rest < own {
            (cell, rest / own)
        } else {
            (usize::from(alias), ((rest - own) / (1.0 - own)).clamp(0.0, 1.0))
        }
    }
}

/// Walker's alias table (Vose 1991): of each cell the share that is its own, and whose the rest is.
fn aliases(shares: &[f64]) -> Vec<(f64, u8)> {
    let mut own: Vec<f64> = shares.iter().map(|share| share * CELLS as f64).collect();
    let mut table: Vec<(f64, u8)> = (0..=u8::MAX).take(CELLS).map(|cell| (1.0, cell)).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..CELLS).partition(|&cell| own[cell] < 1.0);
    while let (Some(poor), Some(&rich)) = (small.pop(), large.last()) {
        table[poor] = (own[poor], u8::try_from(rich).expect("there are 128 cells"));
        own[rich] -= 1.0 - own[poor];
        if own[rich] < 1.0 {
            large.pop();
            small.push(rich);
        }
    }
    table
}
