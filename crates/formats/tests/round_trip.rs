//! Every format gives back what was written into it, or says by how much it does not.

use std::f64::consts::PI;

use brdf::{Brdf, Fitted, Lambert, MerlTable, Spherical};
use formats::{Error, Export, FORMATS, Fidelity, Format, Metadata, Reading, Tolerance, recognise};
use glam::DVec3;

fn material(name: &str) -> Fitted {
    Fitted::named(name).expect("a material that is known")
}

fn write(format: &str, brdf: &dyn Brdf) -> Result<Vec<u8>, Error> {
    let export = Export::of(brdf, "specimen");
    Ok(Format::named(format)?.export(&export)?.bytes)
}

/// What a file holds at a pair of directions in the plane of incidence, the light at azimuth π; degrees.
fn at(file: &dyn Brdf, theta_i_deg: f64, theta_r_deg: f64) -> DVec3 {
    let direction = |theta_deg: f64, phi| {
        let theta = theta_deg.to_radians();
        Spherical { theta, phi }.direction()
    };
    file.eval(direction(theta_i_deg, PI), direction(theta_r_deg, 0.0))
}

#[test]
fn each_format_holds_a_matt_and_a_glossy_specimen_and_knows_its_own_files() {
    for format in &FORMATS {
        for name in ["blue-rubber", "gold-paint"] {
            let brdf = material(name);
            let file = format
                .export(&Export::of(&brdf, name))
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            println!(
                "{name} {} {} bytes; {}",
                format.name,
                file.bytes.len(),
                file.fidelity
            );
            let recognised = recognise(&file.bytes).map(|format| format.name);
            assert_eq!(recognised, Some(format.name));
        }
    }
}

#[test]
fn a_white_diffuser_comes_back() {
    let white = Lambert::new(1.0).unwrap();
    for format in &FORMATS {
        let file = format.export(&Export::of(&white, "white")).unwrap();
        let back = (format.read)(&file.bytes).unwrap();
        let f = at(back.as_ref(), 40.0, 30.0);
        assert!(
            (f * PI - DVec3::ONE).abs().max_element() < 0.01,
            "{}: {f}",
            format.name
        );
    }
}

#[test]
fn colours_keep_their_channels() {
    let gold = material("gold-paint");
    let truth = at(&gold, 30.0, 50.0);
    assert!(truth.x > 1.5 * truth.z, "gold is yellow: {truth}");
    for format in FORMATS
        .iter()
        .filter(|format| format.tolerance != Tolerance::ANY || format.name == "merl")
    {
        let back = (format.read)(&write(format.name, &gold).unwrap()).unwrap();
        let f = at(back.as_ref(), 30.0, 50.0);
        assert!(
            (f / truth - DVec3::ONE).abs().max_element() < 0.03,
            "{}: {f} instead of {truth}",
            format.name
        );
    }
}

#[test]
fn tensor_files_hold_narrow_lobes_within_five_megabytes_and_refuse_a_mirror_with_its_figure() {
    for (name, format) in [
        ("chrome", "rgl-rgb"),
        ("chrome", "rgl-spectral"),
        ("white-paint", "rgl-rgb"),
        ("alum-bronze", "rgl-spectral"),
    ] {
        let brdf = material(name);
        let file = Format::named(format).unwrap().export(&Export::of(&brdf, name));
        let file = file.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(
            file.bytes.len() <= 5_000_000 && file.fidelity.male <= 0.0005,
            "{name}: {}",
            file.fidelity
        );
    }
    let mirror = brdf::specimen("mirror:0.9").unwrap();
    let refused = write("rgl-rgb", mirror.as_ref()).unwrap_err().to_string();
    assert!(
        refused.contains("rgl-rgb does not hold this specimen") && refused.contains("allowed is at most"),
        "{refused}"
    );
}

#[test]
fn a_grid_of_zenith_angles_refuses_a_narrow_lobe_with_its_figure() {
    let refused = write("astm", &material("chrome")).unwrap_err();
    let Error::Refused {
        format,
        found,
        allowed,
        ..
    } = refused
    else {
        panic!("{refused}")
    };
    assert!(format == "astm" && found > allowed);
}

/// Light and viewer cannot be swapped on it, as in the separable model of the paper.
struct OneWay;

impl Brdf for OneWay {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let above = incident.z > 0.0 && exitant.z > 0.0;
        DVec3::splat(if above { 0.2 + 0.1 * exitant.z } else { 0.0 })
    }
}

#[test]
fn what_is_not_reciprocal_is_not_made_so() {
    for name in ["csv-long", "astm", "zemax", "ssdd", "pab-opto", "rgl-rgb"] {
        let back = (Format::named(name).unwrap().read)(&write(name, &OneWay).unwrap()).unwrap();
        for (theta_i, theta_r) in [(20.0, 60.0), (60.0, 20.0)] {
            let (f, truth) = (at(back.as_ref(), theta_i, theta_r), at(&OneWay, theta_i, theta_r));
            assert!(
                (f / truth - DVec3::ONE).abs().max_element() < 0.01,
                "{name}: {f} instead of {truth}"
            );
        }
    }
}

#[test]
fn a_merl_file_is_that_of_the_brdf_crate() {
    let gold = material("gold-paint");
    let mut expected = Vec::new();
    MerlTable::fill(&gold).write_to(&mut expected).unwrap();
    assert!(write("merl", &gold).unwrap() == expected);
}

#[test]
fn readings_stand_in_the_long_table_before_the_model() {
    let grey = Lambert::new(0.5).unwrap();
    let readings = [Reading {
        index: 7,
        theta_i_rad: 0.5,
        phi_i_rad: PI,
        theta_r_rad: 0.25,
        phi_r_rad: 0.0,
        f: Some(DVec3::new(0.1, 0.2, 0.3)),
        u: Some(DVec3::splat(0.01)),
        flags: "saturated|dim".into(),
    }];
    let export = Export {
        brdf: &grey,
        readings: &readings,
        metadata: Metadata {
            specimen: "grey\ncard".into(),
            run: "01ABC".into(),
            ..Metadata::default()
        },
    };
    let file = Format::named("csv-long").unwrap().export(&export).unwrap();
    let text = String::from_utf8(file.bytes).unwrap();
    assert!(
        text.starts_with("# specimen: grey card\n# run: 01ABC\n"),
        "{}",
        &text[..80]
    );
    let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(
        rows[2],
        "28.6478897565,180.0000000000,14.3239448783,0.0000000000,550,2.000000e-1,1.000000e-2,saturated|dim,01ABC,7"
    );
    assert!(rows[4].ends_with(",model,01ABC,"), "{}", rows[4]);
}

#[test]
fn values_that_no_file_can_hold_are_refused() {
    struct Broken;
    impl Brdf for Broken {
        fn eval(&self, incident: DVec3, _exitant: DVec3) -> DVec3 {
            DVec3::splat(if incident.z > 0.9 { f64::NAN } else { 0.1 })
        }
    }
    for format in &FORMATS {
        let error = format
            .export(&Export::of(&Broken, "broken"))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("NaN") && error.contains("finite"),
            "{}: {error}",
            format.name
        );
    }
}

#[test]
fn the_figures_are_those_of_their_definitions() {
    let (half, tenth) = (Lambert::new(0.5).unwrap(), Lambert::new(0.6).unwrap());
    let fidelity = Fidelity::between(&half, &tenth);
    assert!((fidelity.median - 0.2).abs() < 1e-12 && (fidelity.p95 - 0.2).abs() < 1e-12);
    assert!((fidelity.peak_error() - 0.2).abs() < 1e-12);
    assert!(
        fidelity
            .albedo
            .iter()
            .all(|(a, b)| (a - 0.5).abs() < 1e-3 && (b - 0.6).abs() < 1e-3)
    );
    // Mean over θ_i of ln(1 + g cos θ_i) − ln(1 + f cos θ_i), by the midpoint rule.
    let (f, g) = (0.5 / PI, 0.6 / PI);
    let cos = |n: i32| (80.0 * (f64::from(n) + 0.5) / 1000.0).to_radians().cos();
    let male = (0..1000)
        .map(|n| ((1.0 + g * cos(n)) / (1.0 + f * cos(n))).ln())
        .sum::<f64>()
        / 1000.0;
    assert!(
        (fidelity.male / male - 1.0).abs() < 1e-3,
        "{} instead of {male}",
        fidelity.male
    );
}
