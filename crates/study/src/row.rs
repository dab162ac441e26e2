use std::io::{self, Write};

use pdv::Metrics;

/// One reconstruction and how far it is from its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Which material.
    pub material: String,
    /// θ_r^dp, degrees.
    pub theta_r_deg: f64,
    /// All metrics, channels pooled.
    pub metrics: Metrics,
}

impl Row {
    /// The heading of the CSV.
    pub const HEADING: &str =
        "material,theta_r_deg,male,median_rel,p95_rel,rel_rms,log_rel_rmse,eq4,eq4_black,pairs,left_out";

    /// Writes the row as a CSV line; what does not exist stays empty.
    ///
    /// # Errors
    /// The stream refused.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let m = &self.metrics;
        write!(out, "{},{:.3}", self.material, self.theta_r_deg)?;
        for value in [
            m.male,
            m.median_rel,
            m.p95_rel,
            m.rel_rms,
            m.log_rel_rmse,
            m.eq4,
            m.eq4_black,
        ] {
            match value {
                Some(value) => write!(out, ",{value:.6e}")?,
                None => write!(out, ",")?,
            }
        }
        writeln!(out, ",{},{:.6}", m.pairs, m.left_out)
    }
}
