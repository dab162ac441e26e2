/// Steps per octave, as bits of the mantissa: a bin is at most 0.4 % wide.
const BITS: u32 = 8;
/// Exponents of the smallest and the largest number told apart from 0 and ∞.
const EXPONENTS: std::ops::Range<i64> = -40..24;
const BINS: usize = ((EXPONENTS.end - EXPONENTS.start) << BITS) as usize;
/// Bits of a double's mantissa, and the bias of its exponent.
const MANTISSA: u32 = 52;
const BIAS: i64 = 1023;

/// Quantiles of a stream of non-negative numbers, to 0.2 % of their value; numbers below 1e-12 count as 0.
#[derive(Clone, Debug)]
pub(crate) struct Quantiles {
    zeros: u64,
    bins: Vec<u32>,
    above: u64,
}

impl Quantiles {
    pub(crate) fn new() -> Self {
        Self {
            zeros: 0,
            bins: vec![0; BINS],
            above: 0,
        }
    }

    #[inline]
    pub(crate) fn add(&mut self, value: f64) {
        // The leading bits of a positive double count up with its logarithm.
        let bin = (value.to_bits() >> (MANTISSA - BITS)) as i64 - ((BIAS + EXPONENTS.start) << BITS);
        if bin < 0 {
            self.zeros += 1;
        } else if let Some(count) = self.bins.get_mut(bin as usize) {
            *count += 1;
        } else {
            self.above += 1;
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.zeros += other.zeros;
        self.above += other.above;
        for (bin, other) in self.bins.iter_mut().zip(&other.bins) {
            *bin += other;
        }
    }

    /// The number below which the share `q` (0 … 1) of the stream lies; 0 for an empty one.
    pub(crate) fn quantile(&self, q: f64) -> f64 {
        let total = self.zeros + self.above + self.bins.iter().map(|&n| u64::from(n)).sum::<u64>();
        let wanted = q * total as f64;
        let mut below = self.zeros as f64;
        if total == 0 || wanted <= below {
            return 0.0;
        }
        for (bin, &count) in self.bins.iter().enumerate() {
            let next = below + f64::from(count);
            if count > 0 && wanted <= next {
                let within = (wanted - below) / f64::from(count);
                return edge(bin) + within * (edge(bin + 1) - edge(bin));
            }
            below = next;
        }
        f64::INFINITY
    }
}

/// Lower edge of a bin.
fn edge(bin: usize) -> f64 {
    f64::from_bits(((bin as i64 + ((BIAS + EXPONENTS.start) << BITS)) as u64) << (MANTISSA - BITS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn zeros_are_zero() {
        let mut quantiles = Quantiles::new();
        assert_eq!(quantiles.quantile(0.5), 0.0);
        (0..10).for_each(|_| quantiles.add(0.0));
        assert_eq!((quantiles.quantile(0.5), quantiles.quantile(0.95)), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn prop_agrees_with_sorting(logs in prop::collection::vec(-25.0..15.0_f64, 100..2000), q in 0.01..0.99_f64) {
            let mut values: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
            let mut quantiles = Quantiles::new();
            values.iter().for_each(|&value| quantiles.add(value));
            values.sort_by(f64::total_cmp);
            let at = q * values.len() as f64;
            let low = values[(at.ceil() as usize).saturating_sub(1).min(values.len() - 1)];
            prop_assert!((quantiles.quantile(q) / low - 1.0).abs() < 0.004, "{} for {}", quantiles.quantile(q), low);
        }
    }
}
