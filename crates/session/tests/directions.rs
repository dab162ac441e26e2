//! Job files that name a histogram of directions.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage};
use session::{SessionError, job_text};
use sweep::{Cell, Job, Scene};

const HEAD: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 12\n[scene]\n# what a renderer looked at\n";

fn read(folder: &Path, scene: &str) -> Result<Scene, SessionError> {
    let path = folder.join("job.toml");
    fs::write(&path, format!("{HEAD}{scene}\n")).unwrap();
    let text = job_text(&path)?;
    assert!(text.starts_with(HEAD), "the rest stays as it is");
    Ok(Job::parse(&text, "job.toml")?.scene.unwrap())
}

fn degrees(cell: &Cell) -> [f64; 5] {
    let [i, o] = [cell.theta_i, cell.theta_o].map(|range| range.map(|edge| edge.to_degrees().round()));
    [i[0], i[1], o[0], o[1], cell.weight]
}

#[test]
fn a_table_becomes_cells_of_5_degrees() {
    let folder = tempfile::tempdir().unwrap();
    let table = "theta_i_deg, theta_o_deg, weight\n1.0, 42.5, 2\n4.9, 44, 1.5\n90, 0, 0.25\n30, 30, 0\n";
    fs::write(folder.path().join("seen.csv"), table).unwrap();
    let scene = read(folder.path(), "directions = \"seen.csv\"").unwrap();
    let cells: Vec<[f64; 5]> = scene.cells.iter().map(degrees).collect();
    assert_eq!(cells, [[0.0, 5.0, 40.0, 45.0, 3.5], [85.0, 90.0, 0.0, 5.0, 0.25]]);
    let most = read(folder.path(), "directions = \"seen.csv\"\nshare = 0.9").unwrap();
    assert_eq!(
        most.cells,
        scene.cells[..1],
        "what is seldom looked at is left out"
    );
}

#[test]
fn a_picture_has_the_light_from_left_to_right_and_the_viewer_from_top_to_bottom() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("pictures")).unwrap();
    let weight = |at: Vec2<usize>| (if at == Vec2(7, 3) { 2.0_f32 } else { 0.0 },);
    let channels = SpecificChannels::build().with_channel("Y").with_pixel_fn(weight);
    let image = Image::from_channels((36, 18), channels);
    image
        .write()
        .to_file(folder.path().join("pictures/seen.exr"))
        .unwrap();
    let scene = read(folder.path(), "directions = \"pictures/seen.exr\"").unwrap();
    let cells: Vec<[f64; 5]> = scene.cells.iter().map(degrees).collect();
    // Pixels are 2.5° wide and 5° high.
    assert_eq!(cells, [[15.0, 20.0, 15.0, 20.0, 2.0]]);
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let table = |rows: &str| format!("theta_i_deg,theta_o_deg,weight\n{rows}\n");
    for (name, text) in [
        ("negative.csv", table("1,1,1\n1,1,-1")),
        ("steep.csv", table("91,1,1")),
        ("nan.csv", table("1,1,NaN")),
        ("words.csv", table("one,1,1")),
        ("black.csv", table("1,1,0")),
        ("columns.csv", "theta_i_deg,weight\n1,1\n".to_owned()),
        ("picture.exr", "no picture".to_owned()),
        ("notes.txt", "no histogram".to_owned()),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    for (directions, said) in [
        (
            "\"../seen.csv\"",
            "line 6: scene.directions: leads out of the folder",
        ),
        ("\"/etc/passwd\"", "leads out of the folder"),
        ("\"missing.csv\"", "missing.csv"),
        (
            "\"negative.csv\"",
            "negative.csv, line 3: angles, weight: allowed are",
        ),
        ("\"steep.csv\"", "steep.csv, line 2: angles, weight"),
        ("\"nan.csv\"", "nan.csv, line 2: angles, weight"),
        (
            "\"words.csv\"",
            "words.csv, line 2: theta_i_deg, theta_o_deg, weight",
        ),
        (
            "\"columns.csv\"",
            "columns.csv, line 2: theta_i_deg, theta_o_deg, weight",
        ),
        ("\"black.csv\"", "all its weights are 0"),
        ("\"picture.exr\"", "picture.exr"),
        ("\"notes.txt\"", "allowed are .csv and .exr"),
        ("[]", "empty"),
        ("[[0, 5, 0, 5]]", "the name of a file, or a list"),
        ("[[0, 5, 0, 5, 0]]", "a weight above 0"),
        ("[[5, 0, 0, 5, 1]]", "the smaller first"),
        ("[[0, 5, 0, 91, 1]]", "within 0 … 90"),
        (
            "[[0, 5, 0, 5, 1]]\ntheta_i_deg = [0, 5]",
            "allowed is one of both",
        ),
        ("[[0, 5, 0, 5, 1]]\nshare = 0", "scene.share"),
        ("7", "the name of a file, or a list"),
    ] {
        let refusal = read(folder.path(), &format!("directions = {directions}")).unwrap_err();
        let refusal = refusal.to_string();
        assert!(refusal.contains(said), "{directions}: {refusal}");
    }
    let alone = read(folder.path(), "share = 0.5").unwrap_err().to_string();
    assert!(alone.contains("without scene.directions"), "{alone}");
}

#[test]
fn nothing_is_read_from_a_name_that_comes_without_a_file() {
    let refusal = Job::parse(&format!("{HEAD}directions = \"/etc/passwd\""), "job").unwrap_err();
    assert!(refusal.to_string().contains("was not read"), "{refusal}");
}
