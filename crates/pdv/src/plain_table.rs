/// The numbers of a table of [`crate::Planes`] as they are, for whoever evaluates it elsewhere, such as a renderer on a
/// graphics card.
///
/// With ω_i and ω_o as unit vectors, s and d the flat parts of sum and difference, h the height of the sum, p the product
/// of both cosines, e the height of the cross product, L = s² + h² and C = h² + d²: the place of a pair is a column and a
/// row, and there are two. That of the same half angle has the column of tan² = s²/(√L + h)² and the row √(pL)/h, that of
/// the same difference angle the column of 4 (s² − e²)/(L (2 + √C)²) and the row 2 √(p/C); a row counts in units of
/// `rows` − 1. The column of a tan² is the bits of the f32 1 + `inverse`·tan², less those of 1, times `cells`. Between its
/// nodes the table is linear. With l₁ and l₂ found at the two places, f is 2 to the power of
/// l₁ + min(max(0.4 (l₂ − l₁), 0), log₂(e) e²/(½ L² + e²)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainTable<'a> {
    /// log₂ of the reflectance in sr⁻¹: row after row, in each column after column, of each red, green and blue.
    pub logs: &'a [f32],
    /// Nodes over the half angle.
    pub columns: usize,
    /// Nodes over the cosines.
    pub rows: usize,
    /// What tan²(θ_h/2) is multiplied by.
    pub inverse: f32,
    /// Columns per unit of the last place.
    pub cells: f32,
    /// Which channels are not black; f is 0 in one that is.
    pub light: [bool; 3],
}
