/// Why no factor or model can be made of what was observed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No usable value is left for a factor.
    #[error("factor {factor} has no finite value ({dropped} dropped), at least one is needed")]
    Empty {
        /// "F" or "G".
        factor: &'static str,
        /// Values that were not finite.
        dropped: usize,
    },
    /// Observations of one sweep do not belong to one sweep.
    #[error("{what} goes from {low:.4} to {high:.4} within one sweep, allowed is a difference of {allowed}")]
    Mixed {
        /// The quantity that should stand still.
        what: &'static str,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Largest difference.
        allowed: f64,
    },
}
