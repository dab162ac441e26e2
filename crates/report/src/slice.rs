use std::fs::File;
use std::io::{self, BufWriter};

use glam::DVec3;
use pdv::{Model, Pdv};

use crate::Picture;

/// Columns of the slice.
const COLUMNS: usize = 256;
/// Rows: θ_r = 0°, 1°, … 89°.
const ROWS: usize = 90;

/// d_p of a column: quadratic, so that the lobe has most of them; 0 … 2.
fn d_p(column: usize) -> f64 {
    2.0 * (column as f64 / (COLUMNS - 1) as f64).powi(2)
}

/// Writes slice.exr: f in sr⁻¹ over θ_r (rows) and d_p (columns) at φ_p = 0, zero where no pair of directions is
/// that far apart. The header attributes `theta_r_deg` and `d_p` hold the value of every row and column.
///
/// # Errors
/// The medium refused.
pub(crate) fn write(model: &dyn Model, file: &mut BufWriter<File>) -> io::Result<()> {
    let slice = Picture::of(COLUMNS, ROWS, |column, row| {
        let pdv = Pdv {
            theta_r: (row as f64).to_radians(),
            d_p: d_p(column),
            phi_p: 0.0,
        };
        pdv.directions()
            .map_or(DVec3::ZERO, |(incident, exitant)| model.eval(incident, exitant))
    });
    let list = |values: Vec<String>| values.join(" ");
    let attributes = [
        (
            "theta_r_deg",
            list((0..ROWS).map(|row| row.to_string()).collect()),
        ),
        (
            "d_p",
            list((0..COLUMNS).map(|column| d_p(column).to_string()).collect()),
        ),
        ("phi_p_deg", "0".to_owned()),
        ("unit", "1/sr".to_owned()),
    ];
    slice.write_exr(file, &attributes)
}
