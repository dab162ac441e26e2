//! Values of a run's model, straight from its journal, for whoever reads the exported BRDF by other means.
//!
//! `model_values RUN_DIR`: each line of stdin holds ω_i and ω_o (six numbers); each line of stdout the model's red,
//! green and blue in sr⁻¹.

use std::error::Error;
use std::path::Path;

use brdf::Brdf;
use glam::DVec3;
use tests::Captured;

fn main() -> Result<(), Box<dyn Error>> {
    let directory = std::env::args().nth(1).ok_or("usage: model_values RUN_DIR")?;
    let model = Captured::read(Path::new(&directory)).model();
    for line in std::io::stdin().lines() {
        let numbers = line?
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<Vec<f64>, _>>()?;
        let [ix, iy, iz, ox, oy, oz] = numbers[..] else {
            return Err(format!("six numbers a line, not {}", numbers.len()).into());
        };
        let value = model.eval(DVec3::new(ix, iy, iz), DVec3::new(ox, oy, oz));
        println!("{:?} {:?} {:?}", value.x, value.y, value.z);
    }
    Ok(())
}
