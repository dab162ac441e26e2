/// Cells per octave, as bits of the mantissa.
const BITS: u32 = 8;
/// Added to every number, so that cells do not shrink without end towards 0.
const BASE: f64 = 1.0 / 16384.0;
const SHIFT: u32 = 52 - BITS;
/// Leading bits of [`BASE`].
const OFFSET: u64 = BASE.to_bits() >> SHIFT;

/// Finds the interval of a number ≥ 0 between sorted nodes in a time that does not depend on their number.
///
/// Evaluation of a model is little else, so this is laid out for the processor: the leading bits of a double count
/// up with its logarithm, which makes a table of cells that are dense towards 0, as lobes are, without conversion,
/// division or a branch that could not be foreseen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    /// For every cell, the interval in which it begins.
    cells: Vec<u16>,
    /// Begin of every interval: 0 and the nodes.
    begins: Vec<f64>,
    /// End of every interval: the nodes and ∞.
    ends: Vec<f64>,
    /// Whether a cell holds more than one node.
    crowded: bool,
}

impl Grid {
    /// A grid over ascending nodes.
    pub(crate) fn new(nodes: &[f64]) -> Self {
        let ends: Vec<f64> = nodes.iter().copied().chain([f64::INFINITY]).collect();
        let cell_of = |&node: &f64| Self::cell(node) as usize;
        // One cell behind the last node for all that lies beyond.
        let count = nodes.iter().map(cell_of).max().unwrap_or_default() + 2;
        let mut cells = vec![0_u16; count];
        let mut crowded = ends.len() > usize::from(u16::MAX);
        // A cell begins in the interval behind the last node that lies in a cell before it. Filled in stretches: a
        // sum carried from cell to cell was half of what a capture's judgement cost.
        let mut filled = 0;
        for (interval, node) in nodes.iter().map(cell_of).enumerate() {
            crowded |= interval > 0 && filled == node + 1;
            // More nodes than a cell can number are left to the search.
            cells[filled..=node].fill(u16::try_from(interval).unwrap_or(u16::MAX));
            filled = node + 1;
        }
        cells[filled..].fill(u16::try_from(nodes.len()).unwrap_or(u16::MAX));
        Self {
            cells,
            begins: std::iter::once(0.0).chain(nodes.iter().copied()).collect(),
            ends,
            crowded,
        }
    }

    #[inline(always)]
    fn cell(x: f64) -> u64 {
        ((x + BASE).to_bits() >> SHIFT).wrapping_sub(OFFSET)
    }

    /// The interval that holds x, finite and ≥ 0, and how far beyond its begin x lies: interval 0 lies before the
    /// first node, interval n between node n − 1 and node n, the last one behind the nodes.
    #[inline(always)]
    pub(crate) fn locate(&self, x: f64) -> (usize, f64) {
        let cell = (Self::cell(x) as usize).min(self.cells.len() - 1);
        let mut interval = usize::from(self.cells[cell]);
        interval += usize::from(self.ends[interval] <= x);
        if self.crowded {
            while self.ends[interval] <= x {
                interval += 1;
            }
        }
        (interval, x - self.begins[interval])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn prop_finds_the_interval_that_a_search_finds(
            points in prop::collection::vec(0.0..4.0_f64, 0..300), crowd in 0..12, at in 0.0..5.0_f64,
        ) {
            let mut nodes: Vec<f64> = points.iter().map(|x| x.powi(crowd)).collect();
            nodes.sort_by(f64::total_cmp);
            nodes.dedup();
            let grid = Grid::new(&nodes);
            for x in nodes.iter().copied().chain([0.0, at, at.powi(crowd), f64::MAX]) {
                let expected = nodes.partition_point(|&node| node <= x);
                let (interval, t) = grid.locate(x);
                prop_assert_eq!(interval, expected, "{} among {:?}", x, nodes);
                prop_assert_eq!(t, x - expected.checked_sub(1).map_or(0.0, |n| nodes[n]));
            }
        }
    }
}
