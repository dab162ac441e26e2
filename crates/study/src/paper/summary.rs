use std::fmt;

use serde::Serialize;

use super::Row;
use crate::statistics::median;

/// A study in a few numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// One entry for each θ_r^dp.
    pub angles: Vec<Angle>,
}

/// What the materials score at one θ_r^dp.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Angle {
    /// θ_r^dp, degrees.
    pub theta_r_deg: f64,
    /// Number of materials.
    pub materials: usize,
    /// Mean of MALE.
    pub male_mean: f64,
    /// Median of the medians of the relative error.
    pub median_rel_median: f64,
    /// Median of Eq. 4.
    pub eq4_median: f64,
    /// What an all-zero answer scores in Eq. 4 with the same N.
    pub eq4_black: f64,
}

impl Summary {
    /// The summary of rows in any order.
    pub fn new(rows: &[Row]) -> Self {
        let mut angles: Vec<f64> = rows.iter().map(|row| row.theta_r_deg).collect();
        angles.sort_by(f64::total_cmp);
        angles.dedup();
        let angle = |theta_r_deg: f64| {
            let rows: Vec<&Row> = rows.iter().filter(|row| row.theta_r_deg == theta_r_deg).collect();
            let male: Vec<f64> = rows.iter().map(|row| row.male).collect();
            Angle {
                theta_r_deg,
                materials: rows.len(),
                male_mean: male.iter().sum::<f64>() / male.len() as f64,
                median_rel_median: median(rows.iter().map(|row| row.median_rel)),
                eq4_median: median(rows.iter().filter_map(|row| row.eq4)),
                eq4_black: median(rows.iter().filter_map(|row| row.eq4_black)),
            }
        };
        Self {
            angles: angles.into_iter().map(angle).collect(),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "theta_r   materials   mean MALE   median rel. error   median Eq. 4   black in Eq. 4"
        )?;
        for angle in &self.angles {
            writeln!(
                f,
                "{:6.1}°   {:9}   {:9.4}   {:15.1} %   {:10.4} %   {:12.4} %",
                angle.theta_r_deg,
                angle.materials,
                angle.male_mean,
                angle.median_rel_median * 100.0,
                angle.eq4_median * 100.0,
                angle.eq4_black * 100.0,
            )?;
        }
        Ok(())
    }
}
