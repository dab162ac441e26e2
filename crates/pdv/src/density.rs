use std::sync::LazyLock;

use brdf::{Brdf, Fitted};
use rayon::prelude::*;

use crate::Pdv;

/// Mean reflectance of the MERL materials over d_p: the vector E of the paper's Eq. 1.
///
/// 2000 bins of 0.001 over [0, 2), in arbitrary units.
#[derive(Clone, Debug, PartialEq)]
pub struct Density {
    bins: Vec<f64>,
}

/// The stored vector; `cargo run --release -p pdv --example regenerate_distribution` writes it.
static STORED: LazyLock<Density> = LazyLock::new(|| {
    let table = include_str!("../d_p-distribution.csv");
    Density::parse(table).expect("the built-in table is whole, as a test shows")
});

impl Density {
    /// Number of bins.
    pub const BINS: usize = 2000;
    /// Width of a bin in d_p.
    pub const WIDTH: f64 = 0.001;

    /// The vector that is stored in this crate.
    ///
    /// ```
    /// use pdv::Density;
    ///
    /// let bins = Density::stored().bins();
    /// assert_eq!(bins.len(), Density::BINS);
    /// assert!(bins[0] > 100.0 * bins[500], "lobes are sharp");
    /// ```
    pub fn stored() -> &'static Self {
        &STORED
    }

    /// The vector of all bins anew, on all cores: minutes of work.
    pub fn compute() -> Self {
        Self {
            bins: (0..Self::BINS).into_par_iter().map(mean_reflectance).collect(),
        }
    }

    /// E of every bin.
    pub fn bins(&self) -> &[f64] {
        &self.bins
    }

    fn parse(table: &str) -> Option<Self> {
        let lines = table.lines().filter(|line| !line.starts_with('#')).skip(1);
        let bins: Vec<f64> = lines
            .map(|line| line.split_once(',')?.1.parse().ok())
            .collect::<Option<_>>()?;
        (bins.len() == Self::BINS).then_some(Self { bins })
    }

    /// The vector as a table: comments, a heading, then `d_p,E`.
    ///
    /// ```
    /// let table = pdv::Density::stored().table();
    /// assert!(table.lines().any(|line| line == "d_p,E"));
    /// ```
    pub fn table(&self) -> String {
        let mut table = String::from(
            "# E of Eq. 1: reflectance of the 100 fitted MERL materials (1/sr, mean of RGB and of the materials)\n\
             # summed over theta_r = 1, 3 ... 79 deg and phi_p = 0, 4 ... 356 deg, directions below 80 deg.\n\
             # Made by: cargo run --release -p pdv --example regenerate_distribution\n\
             d_p,E\n",
        );
        for (j, e) in self.bins.iter().enumerate() {
            table.push_str(&format!("{:.3},{e:.6e}\n", j as f64 * Self::WIDTH));
        }
        table
    }
}

/// E of one bin: mean over the fitted materials of the reflectance (mean of RGB) summed over θ_r = 1, 3 … 79° and
/// φ_p = 0, 4 … 356° at d_p = `bin`·0.001, as far as both directions lie below 80°, the range of the fits.
///
/// The fits are smooth in both angles, so that the paper's steps of 1° would only take eight times as long.
///
/// ```
/// use pdv::{Density, mean_reflectance};
///
/// let stored = Density::stored().bins()[1500];
/// assert!((mean_reflectance(1500) / stored - 1.0).abs() < 1e-6);
/// ```
pub fn mean_reflectance(bin: usize) -> f64 {
    let d_p = bin as f64 * Density::WIDTH;
    let limit = 80.0_f64.to_radians().cos();
    let mut sum = 0.0;
    for theta_r_deg in (1..80).step_by(2) {
        for phi_p_deg in (0..=180).step_by(4) {
            // Both halves of the circle mirror each other.
            let weight = if phi_p_deg % 180 == 0 { 1.0 } else { 2.0 };
            let (theta_r, phi_p) = (
                f64::from(theta_r_deg).to_radians(),
                f64::from(phi_p_deg).to_radians(),
            );
            let Some((incident, exitant)) = (Pdv { theta_r, d_p, phi_p }).directions() else {
                continue;
            };
            if incident.z > limit {
                sum += weight
                    * Fitted::all()
                        .map(|(_, m)| m.eval(incident, exitant).element_sum())
                        .sum::<f64>();
            }
        }
    }
    sum / (3 * Fitted::all().len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stored_table_is_what_the_command_makes() {
        let stored = Density::stored();
        for bin in (0..Density::BINS).step_by(97).chain([1, Density::BINS - 1]) {
            let (stored, computed) = (stored.bins()[bin], mean_reflectance(bin));
            assert!(
                (stored - computed).abs() <= 1e-6 * computed,
                "bin {bin}: {stored} stored, {computed} computed"
            );
        }
        assert_eq!(Density::parse(&stored.table()).as_ref(), Some(stored));
    }
}
