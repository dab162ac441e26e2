//! Computes E of the paper's Eq. 1 anew and writes the table that the crate stores.
//!
//! `cargo run --release -p pdv --example regenerate_distribution`

fn main() -> std::io::Result<()> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/d_p-distribution.csv");
    std::fs::write(path, pdv::Density::compute().table())
}
