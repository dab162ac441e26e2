/// Median and the band around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Band {
    pub(crate) p10: f64,
    pub(crate) median: f64,
    pub(crate) p90: f64,
    pub(crate) mean: f64,
}

impl Band {
    /// Of at least one value; NaN where there is none.
    pub(crate) fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        Self {
            p10: quantile(&values, 0.1),
            median: quantile(&values, 0.5),
            p90: quantile(&values, 0.9),
            mean: values.iter().sum::<f64>() / values.len() as f64,
        }
    }
}

/// Median; NaN of an empty list.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    Band::of(values).median
}

/// Of ascending values, linear between them; NaN where there is none.
fn quantile(values: &[f64], q: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = q * last as f64;
    let below = at as usize;
    let above = (below + 1).min(last);
    values[below] + (values[above] - values[below]) * (at - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_the_values() {
        let band = Band::of([3.0, 1.0, 2.0, 4.0]);
        assert_eq!((band.median, band.mean), (2.5, 2.5));
        assert!((band.p10 - 1.3).abs() < 1e-12 && (band.p90 - 3.7).abs() < 1e-12);
        assert!(median([]).is_nan());
        assert_eq!(median([7.0]), 7.0);
    }
}
