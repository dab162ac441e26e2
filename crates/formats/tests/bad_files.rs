//! Whatever bytes a reader is given, it gives a BRDF of finite values or says what is wrong, where, and what is allowed.

use std::sync::LazyLock;

use brdf::{Lambert, Spherical};
use formats::{Error, Export, FORMATS, Format};
use proptest::prelude::*;

/// A small file of every format but MERL, whose reader is tried in its own crate.
static FILES: LazyLock<Vec<(&'static Format, Vec<u8>)>> = LazyLock::new(|| {
    let grey = Lambert::new(0.5).expect("0.5 is allowed");
    let formats = FORMATS.iter().filter(|format| format.name != "merl");
    formats
        .map(|format| {
            let file = format
                .export(&Export::of(&grey, "grey"))
                .expect("a diffuser can be held");
            (format, file.bytes)
        })
        .collect()
});

/// Reads bytes in a format; whatever comes out is finite and not negative.
fn try_out(format: &Format, bytes: &[u8]) -> Result<(), Error> {
    let brdf = (format.read)(bytes)?;
    for n in 0..40 {
        let theta = f64::from(n) / 40.0 * 1.57;
        let incident = Spherical { theta, phi: 3.0 }.direction();
        let exitant = Spherical {
            theta: (theta * 7.0) % 1.57,
            phi: theta,
        }
        .direction();
        let f = brdf.eval(incident, exitant);
        assert!(f.is_finite() && f.min_element() >= 0.0, "{}: {f}", format.name);
    }
    Ok(())
}

fn file(name: &str) -> &'static (&'static Format, Vec<u8>) {
    FILES
        .iter()
        .find(|(format, _)| format.name == name)
        .expect("a format that is known")
}

fn message(name: &str, bytes: &[u8]) -> String {
    let (format, _) = file(name);
    match try_out(format, bytes) {
        Ok(()) => panic!("{name} accepts it"),
        Err(error) => error.to_string(),
    }
}

/// A text file with a part replaced.
fn altered(name: &str, from: &str, to: &str) -> String {
    let text = String::from_utf8(file(name).1.clone()).expect("a text format");
    assert!(text.contains(from), "{from} does not occur");
    message(name, text.replacen(from, to, 1).as_bytes())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn prop_a_file_cut_short_or_with_other_bytes_does_no_harm(
        cut in 0.0..1.0_f64,
        changes in proptest::collection::vec((0.0..1.0_f64, any::<u8>()), 0..6),
        early in any::<bool>(),
    ) {
        for (format, bytes) in FILES.iter() {
            let length = (bytes.len() as f64 * cut) as usize;
            let mut short = bytes[..length].to_vec();
            for (at, byte) in &changes {
                // Most of what can go wrong stands at the start.
                let reach = if early { length.min(600) } else { length };
                if reach > 0 {
                    short[(reach as f64 * at) as usize] = *byte;
                }
            }
            let _ = try_out(format, &short);
            let mut whole = bytes.clone();
            for (at, byte) in &changes {
                let reach = if early { whole.len().min(600) } else { whole.len() };
                whole[(reach as f64 * at) as usize] = *byte;
            }
            let _ = try_out(format, &whole);
        }
    }

    #[test]
    fn prop_any_bytes_do_no_harm(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        for (format, _) in FILES.iter() {
            let _ = try_out(format, &bytes);
        }
    }

    #[test]
    fn prop_tensor_files_with_any_numbers_in_their_header_do_no_harm(
        at in 12_usize..420,
        value in prop_oneof![any::<u64>(), Just(u64::MAX), Just(1 << 40), 0_u64..16],
    ) {
        for name in ["rgl-rgb", "rgl-spectral"] {
            let (format, bytes) = file(name);
            let mut bytes = bytes.clone();
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
            let _ = try_out(format, &bytes);
        }
    }
}

/// Words that stand in no file, or not where they are put.
const ODD: [&str; 20] = [
    "-1",
    "0",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-320",
    "NaN",
    "inf",
    "-inf",
    "1e999",
    "18446744073709551616",
    "4294967295",
    "-2147483648",
    "0x10",
    "1.",
    "",
    "\"",
    "\u{feff}",
    "\u{202e}9",
    "1 1 1 1 1 1 1 1 1",
];

/// What is done to the words and lines of a file.
#[derive(Clone, Debug)]
enum Change {
    /// A word becomes an odd one.
    Word(f64, usize),
    /// A line is left out.
    Drop(f64),
    /// A line comes again, so many times.
    Repeat(f64, usize),
    /// Two lines change places.
    Swap(f64, f64),
    /// From a line on, the file goes on as that of another format from a place.
    Splice(f64, usize, f64),
}

fn changes() -> impl Strategy<Value = Change> {
    let place = || 0.0..1.0_f64;
    prop_oneof![
        4 => (place(), 0..ODD.len()).prop_map(|(at, odd)| Change::Word(at, odd)),
        1 => place().prop_map(Change::Drop),
        1 => (place(), 1..40_usize).prop_map(|(at, times)| Change::Repeat(at, times)),
        1 => (place(), place()).prop_map(|(a, b)| Change::Swap(a, b)),
        1 => (place(), 0..FORMATS.len(), place()).prop_map(|(at, other, from)| Change::Splice(at, other, from)),
    ]
}

/// A share of a length as an index; most of what can go wrong stands at the start.
fn index(share: f64, length: usize) -> usize {
    ((share * share * length as f64) as usize).min(length.saturating_sub(1))
}

/// The bytes with a change made to their lines.
fn changed(bytes: &[u8], change: &Change) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = bytes.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect();
    let count = lines.len();
    match *change {
        Change::Word(at, odd) => {
            let line = &mut lines[index(at, count)];
            let mut words: Vec<Vec<u8>> = line
                .split(|byte| b" ,\t".contains(byte))
                .map(<[u8]>::to_vec)
                .collect();
            let separator = line
                .iter()
                .copied()
                .find(|byte| b" ,\t".contains(byte))
                .unwrap_or(b' ');
            let word = index((at * 7919.0).fract(), words.len());
            words[word] = ODD[odd].as_bytes().to_vec();
            *line = words.join(&separator);
        }
        Change::Drop(at) => {
            lines.remove(index(at, count));
        }
        Change::Repeat(at, times) => {
            let at = index(at, count);
            let line = lines[at].clone();
            lines.splice(at..at, std::iter::repeat_n(line, times));
        }
        Change::Swap(a, b) => lines.swap(index(a, count), index(b, count)),
        Change::Splice(at, other, from) => {
            let (_, other) = &FILES[other % FILES.len()];
            let mut spliced = lines[..index(at, count)].join(&b'\n');
            spliced.extend_from_slice(&other[index(from, other.len())..]);
            return spliced;
        }
    }
    lines.join(&b'\n')
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Whatever a text editor, a script or a broken download makes of a file: each format's own reader, and that of the format
    /// that it looks like then, read it or refuse it.
    #[test]
    fn prop_a_file_whose_words_and_lines_are_others_does_no_harm(
        changes in proptest::collection::vec(changes(), 1..5),
    ) {
        for (format, bytes) in FILES.iter() {
            let mutated = changes.iter().fold(bytes.clone(), |bytes, change| changed(&bytes, change));
            let _ = try_out(format, &mutated);
            if let Some(other) = formats::recognise(&mutated) {
                let _ = try_out(other, &mutated);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// The table of MERL has no words: three numbers, then as many as they say.
    #[test]
    fn prop_a_merl_file_with_another_head_or_another_length_or_odd_numbers_does_no_harm(
        head in proptest::collection::vec(prop_oneof![any::<i32>(), Just(90), Just(180)], 3),
        kept in any::<bool>(),
        length in 0..40_000_usize,
        number in prop_oneof![any::<f64>(), Just(f64::NAN), Just(f64::INFINITY), Just(-1.0)],
    ) {
        let merl = Format::named("merl").expect("it is one");
        let whole = if kept { vec![90, 90, 180] } else { head };
        let mut bytes: Vec<u8> = whole.iter().flat_map(|number: &i32| number.to_le_bytes()).collect();
        bytes.extend(number.to_le_bytes().iter().cycle().take(length));
        prop_assert!(try_out(merl, &bytes).is_err(), "it is far too short");
    }
}

#[test]
fn a_merl_file_of_numbers_that_are_none_is_read_as_nothing_or_refused() {
    let merl = Format::named("merl").expect("it is one");
    for number in [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN_POSITIVE,
        -1.0,
    ] {
        let mut bytes: Vec<u8> = [90, 90, 180]
            .iter()
            .flat_map(|number: &i32| number.to_le_bytes())
            .collect();
        bytes.extend(number.to_le_bytes().repeat(3 * 90 * 90 * 180));
        let _ = try_out(merl, &bytes);
    }
}

#[test]
fn a_missing_end_is_told_with_its_place() {
    for (format, bytes) in FILES.iter() {
        let error = try_out(format, &bytes[..bytes.len() / 2]);
        let text = error.expect_err("half a file is none").to_string();
        assert!(
            text.contains("allowed is") || text.contains("library refuses"),
            "{}: {text}",
            format.name
        );
    }
}

#[test]
fn numbers_that_are_none_are_told_with_their_line() {
    let text = altered("astm", "NUM_POINTS ", "NUM_POINTS 9");
    assert!(
        text.contains("line 4") && text.contains("number of rows"),
        "{text}"
    );
    let text = altered("ssdd", "\nDATA ascii\n", "\nDATA ascii\nNaN 0 0\n");
    assert!(
        text.contains("line 16: \"NaN\"; allowed is a finite number"),
        "{text}"
    );
    let text = altered("zemax", "AngleOfIncidence ", "AngleOfIncidence -7");
    assert!(
        text.contains("a list of -7") && text.contains("whole number"),
        "{text}"
    );
    let text = altered("zemax", "ScatterRadial ", "ScatterRadial 9999999");
    assert!(text.contains("whole number from 1 to"), "{text}");
    let text = altered("csv-long", "1.591549e-1", "inf");
    assert!(text.contains("\"inf\"; allowed is a finite number"), "{text}");
    let text = altered("csv-long", "1.591549e-1", "1e300");
    assert!(
        text.contains("a reflectance of 1e300") || text.contains("1/sr; allowed is at most"),
        "{text}"
    );
}

#[test]
fn angles_out_of_range_and_specimens_with_a_grain_are_refused() {
    let text = altered("ssdd", "PARAM0_LIST 0.000000", "PARAM0_LIST -5");
    assert!(text.contains("PARAM0_LIST of -5°; allowed is 0° … 90°"), "{text}");
    let text = altered("ssdd", "PARAM2_LIST", "PARAM1_LIST 0 90\nPARAM2_LIST");
    assert!(text.contains("isotropic"), "{text}");
    let text = altered("zemax", "SampleRotation 1\n0", "SampleRotation 2\n0 90");
    assert!(text.contains("isotropic"), "{text}");
    let text = altered("astm", ",0,0.0000000,", ",0.5,0.0000000,");
    assert!(text.contains("isotropic"), "{text}");
}

#[test]
fn a_tensor_file_of_another_version_or_with_an_array_beyond_its_end_is_refused() {
    let mut bytes = file("rgl-rgb").1.clone();
    bytes[12] = 3;
    let text = message("rgl-rgb", &bytes);
    assert!(
        text.contains("byte 12: version 3.0; allowed is version 1.0"),
        "{text}"
    );
    let mut bytes = file("rgl-rgb").1.clone();
    // The length of the first array's only dimension: name 2 + 7, dimensions 2, type 1, offset 8 bytes behind byte 18.
    bytes[38..46].copy_from_slice(&u64::MAX.to_le_bytes());
    let text = message("rgl-rgb", &bytes);
    assert!(text.contains("within the"), "{text}");
}

#[test]
fn a_file_is_named_in_the_message() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("wrong.ssdd");
    let text = String::from_utf8(file("ssdd").1.clone())
        .unwrap()
        .replace("DATA ascii", "DATA hex");
    std::fs::write(&path, text).unwrap();
    let Err(error) = formats::read(&path) else {
        panic!("accepted")
    };
    let text = error.to_string();
    assert!(text.contains("wrong.ssdd as ssdd"), "{text}");
    std::fs::write(&path, "holiday").unwrap();
    let Err(error) = formats::read(&path) else {
        panic!("accepted")
    };
    assert!(error.to_string().contains("it reads merl, "), "{error}");
}
