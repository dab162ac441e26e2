use serde::Serialize;

/// One reconstruction and how far it is from its material, channels pooled: a line of study.csv. Metrics are those of
/// [`pdv::Metrics`]; what does not exist is empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Which material.
    pub material: String,
    /// θ_r^dp, degrees.
    pub theta_r_deg: f64,
    /// MALE.
    pub male: f64,
    /// Median relative error, of the first 50,000 pairs.
    pub median_rel: f64,
    /// 95th percentile of the relative error, of the first 50,000 pairs.
    pub p95_rel: f64,
    /// Root mean square of the relative error with its floor.
    pub rel_rms: f64,
    /// Eq. 4 of the paper.
    pub eq4: Option<f64>,
    /// What an all-zero estimate scores in Eq. 4.
    pub eq4_black: Option<f64>,
    /// N of Eq. 4: pairs with a reference above 0, mean of the channels.
    pub pairs: u64,
    /// Share of the drawn pairs that are not among those N.
    pub left_out: f64,
}
