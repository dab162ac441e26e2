//! MERL tables as files and as BRDFs.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::PathBuf;
use std::sync::LazyLock;

use brdf::{Brdf, Error, Fitted, MerlTable, Spherical};
use glam::DVec3;
use proptest::prelude::*;

static TABLE: LazyLock<MerlTable> =
    LazyLock::new(|| MerlTable::fill(&Fitted::named("gold-paint").expect("known to hold")));
static BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut bytes = Vec::new();
    TABLE.write_to(&mut bytes).expect("known to hold");
    bytes
});

fn offset(channel: usize, [i, j, k]: [usize; 3]) -> usize {
    12 + 8 * (channel * MerlTable::NODES + k + 180 * (j + 90 * i))
}

fn stored(channel: usize, index: [usize; 3]) -> f64 {
    let at = offset(channel, index);
    f64::from_le_bytes(BYTES[at..at + 8].try_into().expect("known to hold"))
}

/// The written bytes with another number in one place.
fn altered(channel: usize, index: [usize; 3], value: f64) -> Vec<u8> {
    let mut bytes = BYTES.clone();
    let at = offset(channel, index);
    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
    bytes
}

fn message(bytes: &[u8]) -> String {
    MerlTable::read_from(bytes)
        .expect_err("must be refused")
        .to_string()
}

#[test]
fn is_laid_out_as_the_database() {
    assert_eq!(BYTES.len(), 34_992_012);
    assert_eq!(BYTES[..12], [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]);
    let gold = Fitted::named("gold-paint").unwrap();
    for index in [[0, 0, 0], [12, 30, 45], [40, 10, 179], [70, 15, 90]] {
        let (incident, exitant) = MerlTable::coordinates(index).directions();
        let f = gold.eval(incident, exitant).to_array();
        for (channel, scale) in [1.0, 1.15, 1.66].into_iter().enumerate() {
            let expected = f[channel] * 1500.0 / scale;
            assert!(
                (stored(channel, index) / expected - 1.0).abs() < 1e-12,
                "{index:?}, channel {channel}"
            );
        }
    }
    assert_eq!(stored(0, [89, 89, 0]), -1.0, "a node below the horizon");
    let invalid = TABLE.nodes().iter().filter(|node| node[0] < 0.0).count();
    let share = invalid as f64 / MerlTable::NODES as f64;
    assert!(
        (share - 0.238).abs() < 0.001,
        "{share} of the nodes are below the horizon"
    );
}

#[test]
fn written_and_read_it_is_the_same() {
    let back = MerlTable::read_from(BYTES.as_slice()).unwrap();
    for (index, (there, back)) in TABLE.nodes().iter().zip(back.nodes()).enumerate() {
        for channel in 0..3 {
            let (there, back) = (there[channel], back[channel]);
            let same = if there < 0.0 {
                back < 0.0
            } else {
                (back - there).abs() <= 1e-12 * there
            };
            assert!(same, "node {index}, channel {channel}: {there} became {back}");
        }
    }
}

#[test]
fn a_file_is_written_whole_or_not_at_all() {
    let directory = tempfile::tempdir().unwrap();
    let directory = directory.path();
    let path = directory.join("gold-paint.binary");
    TABLE.write(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), *BYTES);
    assert_eq!(
        std::fs::read_dir(directory).unwrap().count(),
        1,
        "a temporary file is left"
    );
    assert!(MerlTable::read(&path).is_ok());

    let truncated = directory.join("truncated.binary");
    std::fs::write(&truncated, &BYTES[..1_000_000]).unwrap();
    let text = MerlTable::read(&truncated).unwrap_err().to_string();
    assert!(
        text.contains("truncated.binary has 1000000 bytes, a MERL file has 34992012"),
        "{text}"
    );

    let nowhere = PathBuf::from("/no/such/directory/out.binary");
    assert!(matches!(
        TABLE.write(&nowhere),
        Err(Error::Io { what: "write", .. })
    ));
}

#[test]
fn what_is_no_table_is_refused_with_the_place() {
    let mut header = BYTES.clone();
    header[8] = 181;
    assert!(
        message(&header).contains("dimensions 90 × 90 × 181, allowed is 90 × 90 × 180"),
        "{}",
        message(&header)
    );
    let short = message(&BYTES[..20_000_000]);
    assert!(
        short.contains("ends after 20000000 bytes, 34992012 are needed"),
        "{short}"
    );
    assert!(
        message(&BYTES[..5]).contains("ends after 5 bytes"),
        "{}",
        message(&BYTES[..5])
    );
    let mut long = BYTES.clone();
    long.push(0);
    assert!(message(&long).contains("bytes behind"), "{}", message(&long));
    for value in [f64::NAN, f64::INFINITY] {
        let text = message(&altered(1, [3, 4, 5], value));
        let byte = offset(1, [3, 4, 5]);
        assert!(
            text.contains(&format!("byte {byte}: green at θ_h index 3, θ_d 4°, φ_d 5°")),
            "{text}"
        );
    }
}

#[test]
fn invalid_neighbours_are_left_out_of_the_interpolation() {
    let index = [20, 20, 20];
    let table = MerlTable::read_from(altered(0, index, -1.0).as_slice()).unwrap();
    let (incident, exitant) = MerlTable::coordinates(index).directions();
    // On the node itself rounding leaves a trace of weight to the neighbours or none; half-way they share it.
    let mut half_way = MerlTable::coordinates(index);
    half_way.phi_d += 0.5_f64.to_radians();
    let between = half_way.directions();
    let red = table.eval(between.0, between.1);
    let whole = TABLE.eval(between.0, between.1);
    assert!(
        (red.x / whole.x - 1.0).abs() < 0.02,
        "{red} instead of about {whole}"
    );
    assert_eq!(red.y, whole.y, "only red is invalid");
    assert!(table.valid(between.0, between.1));
    assert!(table.eval(incident, exitant).min_element() >= 0.0);
}

#[test]
fn without_a_valid_neighbour_it_is_black_and_says_so() {
    let mut bytes = BYTES.clone();
    for value in bytes[12..].chunks_exact_mut(8) {
        value.copy_from_slice(&(-1.0_f64).to_le_bytes());
    }
    let table = MerlTable::read_from(bytes.as_slice()).unwrap();
    assert_eq!(table.eval(DVec3::Z, DVec3::Z), DVec3::ZERO);
    assert!(!table.valid(DVec3::Z, DVec3::Z));
}

#[test]
fn interpolates_between_nodes() {
    let gold = Fitted::named("gold-paint").unwrap();
    let mut worst = 0.0_f64;
    for i in 0..40 {
        for j in 0..40 {
            let incident = Spherical {
                theta: f64::from(i) * 0.033,
                phi: 1.0,
            }
            .direction();
            let exitant = Spherical {
                theta: f64::from(j) * 0.033,
                phi: 3.3,
            }
            .direction();
            let (f, g) = (gold.eval(incident, exitant), TABLE.eval(incident, exitant));
            worst = worst.max(((f - g) / f).abs().max_element());
        }
    }
    assert!(worst < 0.02, "relative error of {worst} between the nodes");
}

fn direction() -> impl Strategy<Value = DVec3> {
    (0.0..=FRAC_PI_2, -PI..PI).prop_map(|(theta, phi)| Spherical { theta, phi }.direction())
}

proptest! {
    #[test]
    fn prop_lookup_is_finite_and_not_negative(incident in direction(), exitant in direction()) {
        let f = TABLE.eval(incident, exitant);
        prop_assert!(f.is_finite() && f.min_element() >= 0.0, "{}", f);
    }

    #[test]
    fn prop_lookup_is_reciprocal(incident in direction(), exitant in direction()) {
        let (there, back) = (TABLE.eval(incident, exitant), TABLE.eval(exitant, incident));
        prop_assert!((there - back).abs().max_element() <= 1e-9 * there.max_element(), "{} {}", there, back);
    }

    #[test]
    fn prop_a_node_gives_its_entry(i in 1_usize..89, j in 1_usize..89, k in 0_usize..180) {
        let entry = TABLE.node([i, j, k]);
        let (incident, exitant) = MerlTable::coordinates([i, j, k]).directions();
        prop_assume!(entry.min_element() >= 0.0 && incident.z > 0.01 && exitant.z > 0.01);
        let f = TABLE.eval(incident, exitant);
        prop_assert!((f - entry).abs().max_element() <= 1e-9 * entry.max_element(), "{} {}", f, entry);
    }
}
