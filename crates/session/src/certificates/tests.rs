use rig::{Conditions, White, Zero};
use serde_json::{Value, json};

use super::*;

/// A time later than any program that runs these tests was installed.
const TODAY: &str = "2096-03-01T00:00:00Z";

fn clock(now: &str) -> WallClock {
    WallClock {
        now: humantime::parse_rfc3339(now).unwrap(),
        installed: Some(humantime::parse_rfc3339("2095-12-01T00:00:00Z").unwrap()),
    }
}

fn conditions(made: &str) -> Conditions {
    Conditions {
        made: made.to_owned(),
        ..Conditions::default()
    }
}

fn certificate(rig: &RigFile, id: &str, made: &str) -> Certificate {
    Certificate {
        id: id.to_owned(),
        made: made.to_owned(),
        rig: rig.fingerprint.clone(),
        white: Some(White {
            conditions: conditions(made),
            u_nonlinearity: 1e-4,
            ..White::nominal(rig)
        }),
        zero: Some(Zero {
            conditions: conditions(made),
            offset_rad: 1e-4,
            u_rad: 1e-4,
        }),
        ..Certificate::default()
    }
}

/// An empty directory of certificates and the built-in rig.
fn empty() -> (tempfile::TempDir, Certificates, RigFile) {
    let directory = tempfile::tempdir().unwrap();
    let certificates = Certificates::at(directory.path());
    (directory, certificates, RigFile::default())
}

fn refused(certificates: &Certificates, rig: &RigFile, now: &str) -> String {
    certificates.valid(rig, clock(now)).unwrap_err().to_string()
}

/// Writes a certificate as older programs did: without number and digest.
fn write_old(certificates: &Certificates, certificate: &Certificate) -> PathBuf {
    let mut content = serde_json::to_value(certificate).unwrap();
    content.as_object_mut().unwrap().remove("number");
    let path = certificates.path().join(format!("{}.json", certificate.id));
    fs::write(&path, content.to_string()).unwrap();
    path
}

#[test]
fn a_run_gets_the_newest_certificate_of_its_rig_and_no_old_one() {
    let (_directory, certificates, rig) = empty();
    let missing = Certificates::at(certificates.path().join("not/there"));
    assert!(refused(&missing, &rig, TODAY).contains("there is none for this rig file"));

    certificates
        .keep(certificate(&rig, "01A", "2096-01-01T00:00:00Z"))
        .unwrap();
    let text = refused(&certificates, &rig, TODAY);
    assert!(text.contains("max_age_h allows 720.0 h"), "{text}");
    certificates
        .keep(certificate(&rig, "01B", "2096-02-20T00:00:00Z"))
        .unwrap();
    assert_eq!(certificates.valid(&rig, clock(TODAY)).unwrap().id, "01B");

    let changed = RigFile::parse("[light]\nzero_deg = 181", "rig.toml".as_ref()).unwrap();
    let text = refused(&certificates, &changed, TODAY);
    assert!(text.contains("there is none"), "{text}");
    fs::write(certificates.path().join("02.json"), "{").unwrap();
    assert!(certificates.newest(&rig).is_err());
}

#[test]
fn the_order_of_certificates_is_that_in_which_they_were_made_whatever_the_clock_said() {
    let (_directory, certificates, rig) = empty();
    // The clock ran a year ahead, and so did the ids, which hold the time.
    let ahead = Certificate {
        white: Some(White {
            responsivity: [1.1; 3],
            ..certificate(&rig, "", "2097-03-01T00:00:00Z").white.unwrap()
        }),
        ..certificate(&rig, "09AHEAD", "2097-03-01T00:00:00Z")
    };
    certificates.keep(ahead).unwrap();
    let text = refused(&certificates, &rig, TODAY);
    for part in [
        "white part is of 2097-03-01",
        TODAY,
        "Set the clock",
        "gonioctl calibrate white",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    certificates
        .keep(certificate(&rig, "01RIGHT", "2096-02-29T00:00:00Z"))
        .unwrap();
    let valid = certificates.valid(&rig, clock(TODAY)).unwrap();
    assert_eq!((valid.id.as_str(), valid.number), ("01RIGHT", 2));
    assert_eq!(valid.white.unwrap().responsivity, [1.0; 3]);
}

#[test]
fn a_part_from_when_the_clock_ran_ahead_is_refused_in_a_new_certificate_too() {
    let (_directory, certificates, rig) = empty();
    let mut new = certificate(&rig, "01A", "2096-02-29T00:00:00Z");
    new.zero.as_mut().unwrap().conditions = conditions("2097-03-01T00:00:00Z");
    certificates.keep(new).unwrap();
    let text = refused(&certificates, &rig, TODAY);
    assert!(text.contains("gonioctl calibrate mirror"), "{text}");
}

#[test]
fn no_age_is_told_by_a_clock_that_cannot_be_right() {
    let (_directory, certificates, rig) = empty();
    certificates.keep(certificate(&rig, "01A", TODAY)).unwrap();
    assert!(certificates.valid(&rig, clock(TODAY)).is_ok());
    for now in [
        "1970-01-01T00:00:07Z",
        "2095-11-30T00:00:00Z",
        "2196-01-01T00:00:00Z",
    ] {
        let text = refused(&certificates, &rig, now);
        assert!(text.contains(now) && text.contains("set the clock"), "{text}");
    }
}

#[test]
fn a_time_that_is_none_is_refused() {
    let (_directory, certificates, rig) = empty();
    certificates.keep(certificate(&rig, "01A", "yesterday")).unwrap();
    let text = refused(&certificates, &rig, TODAY);
    assert!(text.contains("\"yesterday\", which is no time"), "{text}");
}

/// What the certificate's file says, changed, without its digest if it is to be taken for an old one.
fn refused_with(change: impl FnOnce(&mut Value)) -> String {
    let (_directory, certificates, rig) = empty();
    let path = write_old(&certificates, &certificate(&rig, "01A", TODAY));
    let mut content: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut content);
    fs::write(&path, content.to_string()).unwrap();
    let text = refused(&certificates, &rig, TODAY);
    assert!(
        text.contains("01A.json") && text.contains("Restore the file from a copy"),
        "{text}"
    );
    text
}

#[test]
fn values_that_no_rig_has_are_refused_with_key_value_and_what_is_allowed() {
    let cases = [
        (
            "/white/responsivity/1",
            json!(0.0),
            "white.responsivity[1] is 0.0, allowed: 0.1 … 10.0",
        ),
        (
            "/white/responsivity/0",
            json!(-1.0),
            "white.responsivity[0] is -1.0",
        ),
        (
            "/white/responsivity/2",
            json!(261.0),
            "white.responsivity[2] is 261.0",
        ),
        (
            "/white/responsivity/2",
            json!(null),
            "white.responsivity[2]: invalid type",
        ),
        (
            "/white/responsivity/2",
            json!("1.0"),
            "white.responsivity[2]: invalid type",
        ),
        (
            "/white/u_responsivity/0",
            json!(0.0),
            "white.u_responsivity[0] is 0.0",
        ),
        (
            "/white/u_responsivity/0",
            json!(1.5),
            "white.u_responsivity[0] is 1.5",
        ),
        (
            "/white/gains",
            json!([1.0, 0.0, 0.0]),
            "white.gains[1] is 0.0, allowed: 12.0 … 20.0",
        ),
        (
            "/white/gains",
            json!([1.0, 256.0, 16.0]),
            "white.gains[1] is 256.0",
        ),
        (
            "/white/gains",
            json!([0.5, 16.0, 256.0]),
            "white.gains[0] is 0.5, allowed: 1.0 … 1.0",
        ),
        ("/white/gains", json!([1.0, 16.0]), "white.gains"),
        (
            "/white/nonlinearity",
            json!(50.0),
            "white.nonlinearity is 50.0, allowed: -0.25 … 0.25",
        ),
        ("/white/u_nonlinearity", json!(0.0), "white.u_nonlinearity is 0.0"),
        ("/zero/offset_rad", json!(0.5), "zero.offset_rad is 0.5"),
        // Degrees for radians.
        ("/zero/offset_rad", json!(-0.12), "zero.offset_rad is -0.12"),
        ("/zero/u_rad", json!(0.0), "zero.u_rad is 0.0"),
        (
            "/zero/conditions/temperature_c",
            json!(1e9),
            "zero.conditions.temperature_c is 1000000000.0",
        ),
    ];
    for (key, value, why) in cases {
        let text = refused_with(|content| *content.pointer_mut(key).unwrap() = value.clone());
        assert!(text.contains(why), "{key} = {value}: {text}");
    }
    let text = refused_with(|content| content["white"]["k"] = json!(2.0));
    assert!(text.contains("unknown key white.k"), "{text}");
}

#[test]
fn numbers_that_json_cannot_hold_are_refused() {
    for number in ["NaN", "Infinity", "1e999"] {
        let (_directory, certificates, rig) = empty();
        let path = write_old(&certificates, &certificate(&rig, "01A", TODAY));
        let text = fs::read_to_string(&path).unwrap();
        fs::write(
            &path,
            text.replace("\"nonlinearity\":0.0", &format!("\"nonlinearity\":{number}")),
        )
        .unwrap();
        let text = refused(&certificates, &rig, TODAY);
        assert!(
            text.contains("01A.json") && text.contains("line 1"),
            "{number}: {text}"
        );
    }
}

#[test]
fn an_edited_certificate_is_refused_and_a_reformatted_one_is_not() {
    let (_directory, certificates, rig) = empty();
    let (_, path) = certificates.keep(certificate(&rig, "01A", TODAY)).unwrap();
    let whole = fs::read_to_string(&path).unwrap();
    let mut content: Value = serde_json::from_str(&whole).unwrap();
    fs::write(&path, content.to_string()).unwrap();
    assert!(
        certificates.valid(&rig, clock(TODAY)).is_ok(),
        "spaces say nothing"
    );

    // Half of it agrees with everything else in the file.
    content["white"]["responsivity"] = json!([0.5, 0.5, 0.5]);
    fs::write(&path, content.to_string()).unwrap();
    let text = refused(&certificates, &rig, TODAY);
    assert!(
        text.contains("01A.json") && text.contains("edited or damaged"),
        "{text}"
    );
    content.as_object_mut().unwrap().remove("sha256");
    fs::write(&path, content.to_string()).unwrap();
    let text = refused(&certificates, &rig, TODAY);
    assert!(text.contains("no digest"), "{text}");
}

#[test]
fn a_damaged_byte_is_found_or_says_the_same() {
    let (_directory, certificates, rig) = empty();
    let (kept, path) = certificates.keep(certificate(&rig, "01A", TODAY)).unwrap();
    let whole = fs::read(&path).unwrap();
    let mut found = 0;
    for at in 0..whole.len() {
        for flipped in [1, 2, 16, 32, 128] {
            let mut damaged = whole.clone();
            damaged[at] ^= flipped;
            fs::write(&path, &damaged).unwrap();
            match certificates.newest(&rig) {
                Err(_) => found += 1,
                Ok(Some(read)) => assert_eq!(read, kept, "byte {at} ^ {flipped}"),
                Ok(None) => panic!("byte {at} ^ {flipped}: taken for another rig's"),
            }
        }
        // The last byte ends the line.
        if at < whole.len() - 1 {
            fs::write(&path, &whole[..at]).unwrap();
            assert!(certificates.newest(&rig).is_err(), "cut after {at} bytes");
        }
    }
    assert!(
        found > 4 * whole.len(),
        "{found} of {} were found",
        5 * whole.len()
    );
}

#[test]
fn a_certificate_without_number_and_digest_is_read_with_a_remark_and_comes_before_numbered_ones() {
    let (_directory, certificates, rig) = empty();
    write_old(&certificates, &certificate(&rig, "01A", TODAY));
    write_old(&certificates, &certificate(&rig, "02A", TODAY));
    let old = certificates.valid(&rig, clock(TODAY)).unwrap();
    assert_eq!(old.id, "02A");
    assert!(
        old.remarks.iter().any(|remark| remark.contains("no digest")),
        "{:?}",
        old.remarks
    );
    certificates.keep(certificate(&rig, "00NEW", TODAY)).unwrap();
    let new = certificates.valid(&rig, clock(TODAY)).unwrap();
    assert_eq!(
        (new.id.as_str(), new.remarks.as_slice()),
        ("00NEW", [].as_slice())
    );
}

#[test]
fn a_responsivity_that_differs_from_what_was_known_is_told_with_its_ratio() {
    let (_directory, certificates, rig) = empty();
    let of = |id: &str, responsivity: f64| {
        let mut made = certificate(&rig, id, TODAY);
        made.white.as_mut().unwrap().responsivity = [responsivity; 3];
        made
    };
    let remarks = |made: Certificate| {
        certificates.keep(made).unwrap();
        certificates.valid(&rig, clock(TODAY)).unwrap().remarks.join("\n")
    };
    let text = remarks(of("01", 0.5));
    assert!(text.contains("0.500 times that of the rig file"), "{text}");
    assert_eq!(remarks(of("02", 0.51)), "", "as the one before");
    let text = remarks(of("03", 1.02));
    assert!(
        text.contains("2.000 times that of the certificate before"),
        "{text}"
    );
    let mut slipped = of("04", 1.02);
    slipped.zero.as_mut().unwrap().offset_rad = 0.01;
    let text = remarks(slipped);
    assert!(text.contains("zeros of the arms"), "{text}");
}

#[test]
fn two_certificates_with_one_number_are_refused() {
    let (_directory, certificates, rig) = empty();
    let (_, path) = certificates.keep(certificate(&rig, "01A", TODAY)).unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let other = Certificates::at(elsewhere.path());
    other.keep(certificate(&rig, "01B", TODAY)).unwrap();
    fs::copy(path, other.path().join("01A.json")).unwrap();
    let text = refused(&other, &rig, TODAY);
    assert!(text.contains("01A.json") && text.contains("01B.json"), "{text}");
}
