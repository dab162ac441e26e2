//! A small study of error against run time, whole and interrupted.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use study::{Shard, Study};

const TEXT: &str = "
study = \"error-against-time\"
materials = [\"gold-paint\", \"blue-rubber\", \"brass\"]
every = 2
models = [\"separable\", \"reciprocal\", \"planes\"]
plans = { planes_deg = [[30.0]], readings = [8], distribution = \"capped\", arc = [0, 8] }
adaptive = { planes_deg = [20.0, 70.0], readings = 8, arc = 8, budget_s = [30] }
pca = { readings = [2] }
compare = { pairs = 500, theta_max_deg = 80.0, seed = 3 }
";

fn rows(directory: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(directory.join("study.csv")).expect("the study wrote it");
    let cells = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().map(cells).collect()
}

/// Everything that a study says, byte for byte: all files but the ledgers, which have the seconds of this machine.
fn said(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = fs::read_dir(directory).expect("the study made it").map(|entry| {
        let path = entry.expect("it can be listed").path();
        let name = path
            .file_name()
            .expect("a file has a name")
            .to_string_lossy()
            .into_owned();
        (name, fs::read(path).expect("it can be read"))
    });
    files.filter(|(name, _)| !name.starts_with("rows")).collect()
}

#[test]
fn an_interrupted_study_ends_as_a_whole_one_does() {
    let directory = tempfile::tempdir().unwrap();
    let study = Study::parse(TEXT, "study.toml", false).unwrap();
    let words = study.run(directory.path(), &|_, _| ()).unwrap();
    assert!(words.contains("2 materials of 2 families, 6 captures"), "{words}");
    assert!(words.contains("planned on the way, "), "{words}");
    let whole = rows(directory.path());
    // Two plans with two models each, one made on the way, the floor of both models, black and PCA placed freely and in the
    // plane; two materials; the heading.
    assert_eq!(whole.len(), 2 * (4 + 1 + 2 + 3) + 1);
    for name in [
        "front.csv",
        "floor.csv",
        "families.csv",
        "summary.json",
        "male-against-time.png",
        "planes-against-time.svg",
    ] {
        assert!(
            fs::metadata(directory.path().join(name)).unwrap().len() > 100,
            "{name}"
        );
    }
    let page = fs::read_to_string(directory.path().join("index.html")).unwrap();
    assert!(!page.contains("src=\"http") && !page.contains("<script") && page.contains("<svg"));

    let all = said(directory.path());
    let csv = directory.path().join("study.csv");
    let ledger = directory.path().join("rows.csv");
    let text = fs::read_to_string(&ledger).unwrap();
    fs::remove_file(&csv).unwrap();
    // As if it had been killed in the midst of a line.
    fs::write(&ledger, &text[..text.len() / 2]).unwrap();
    study.run(directory.path(), &|_, _| ()).unwrap();
    assert!(said(directory.path()) == all);

    // An older version kept what it had done in study.csv.
    fs::remove_file(&ledger).unwrap();
    fs::write(&csv, &text).unwrap();
    let begun = |_, of| assert_eq!(of, 0, "nothing is done again");
    study.run(directory.path(), &begun).unwrap();
    assert!(said(directory.path()) == all);

    // In shards, one of them twice and one killed in the midst of a line: the same files.
    let shared = tempfile::tempdir().unwrap();
    let shard = |name: &str| {
        let shard: Shard = name.parse().unwrap();
        study.run_shard(shared.path(), shard, &|_, _| ()).unwrap()
    };
    let words = shard("2/3");
    assert!(
        words.contains("shard 2/3 has 3 of 9 tasks, of which 3 were done now"),
        "{words}"
    );
    let error = study.merge(shared.path()).unwrap_err().to_string();
    assert!(
        error.contains("6 of 9 tasks") && error.contains("run the shards again"),
        "{error}"
    );
    // Whoever does another part may be another user.
    let mode = |name: &str| {
        fs::metadata(shared.path().join(name))
            .unwrap()
            .permissions()
            .mode()
    };
    assert_eq!(mode("study.toml"), mode("rows-2-of-3.csv"));
    let first = shard("1/3");
    assert!(first.contains("3 were done now"), "{first}");
    assert!(shard("1/3").contains("of which 0 were done now"));
    let ledger = shared.path().join("rows-1-of-3.csv");
    let text = fs::read_to_string(&ledger).unwrap();
    fs::write(&ledger, &text[..text.len() - 20]).unwrap();
    shard("3/3");
    let error = study.merge(shared.path()).unwrap_err().to_string();
    assert!(error.contains("1 of 9 tasks"), "{error}");
    assert!(shard("1/3").contains("of which 1 were done now"));
    study.merge(shared.path()).unwrap();
    assert!(said(shared.path()) == all, "the merged study is another");
    // Whatever is done again afterwards changes nothing.
    shard("2/3");
    study.merge(shared.path()).unwrap();
    study.run(shared.path(), &begun).unwrap();
    assert!(said(shared.path()) == all);

    let other = Study::parse(&TEXT.replace("seed = 3", "seed = 4"), "study.toml", false).unwrap();
    let error = other.run(directory.path(), &|_, _| ()).unwrap_err().to_string();
    assert!(error.contains("another study"), "{error}");
}

#[test]
fn the_shipped_study_covers_the_grid() {
    let text = include_str!("../../../config/studies/error-against-time.toml");
    let grid = study::Grid::parse(text, "error-against-time.toml", false).unwrap();
    assert_eq!((grid.materials.len(), grid.known.len()), (20, 100));
    assert_eq!(grid.plans.len(), 9 * 6 * 6 + 6);
    for number in [1, 2, 3, 4, 7] {
        assert!(grid.plans.iter().any(|plan| plan.planes_deg.len() == number));
    }
    let quick = study::Grid::parse(text, "error-against-time.toml", true).unwrap();
    assert_eq!((quick.materials.len(), quick.plans.len()), (7, 9 * 3 * 3 + 3));
    let error = |from: &str, to: &str| {
        assert!(text.contains(from));
        let wrong = study::Grid::parse(&text.replacen(from, to, 1), "x.toml", false);
        wrong.err().map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(error("pairs = 20_000", "pairs = 0").contains("compare.pairs is 0, allowed is 1 … 1e6"));
    assert!(
        error("[30.0],", "[95.0],").contains("theta_r_deg"),
        "a job's limits hold"
    );
    assert!(error("every = 5", "evry = 5").contains("evry"));
    assert!(error("materials = \"all\"", "materials = [\"chrom\"]").contains("materials"));
}

/// A table of a format and scattered readings are materials like any other, and each is held out with its family.
#[test]
fn a_study_is_done_on_the_materials_of_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    let rubber = brdf::Fitted::named("blue-rubber").unwrap();
    brdf::MerlTable::fill(&rubber)
        .write(&folder.path().join("blue-rubber.binary"))
        .unwrap();
    let gold = brdf::Fitted::named("gold-paint").unwrap();
    let mut readings = "light_deg,sensor_deg,azimuth_deg,r,g,b\n".to_owned();
    let mut add = |light: f64, sensor: f64, azimuth: f64| {
        let direction = |theta: f64, phi: f64| {
            let (theta, phi) = (theta.to_radians(), phi.to_radians());
            brdf::Spherical { theta, phi }.direction()
        };
        let f = brdf::Brdf::eval(&gold, direction(light, azimuth), direction(sensor, 0.0));
        readings += &format!("{light},{sensor},{azimuth},{},{},{}\n", f.x, f.y, f.z);
    };
    for light in [0.0, 20.0, 40.0, 60.0] {
        for sensor in 0..80 {
            add(light, f64::from(sensor), 180.0);
            add(light, f64::from(sensor), 0.0);
            add(light, f64::from(sensor), 70.0);
        }
    }
    write("measured.csv", readings);

    let directory = tempfile::tempdir().unwrap();
    let text = TEXT.replace(
        "adaptive = { planes_deg = [20.0, 70.0], readings = 8, arc = 8, budget_s = [30] }\n",
        "",
    );
    let study = Study::parse(&text, "study.toml", false).unwrap();
    let study = study.on(&[folder.path().to_owned()], 1).unwrap();
    let words = study.run(directory.path(), &|_, _| ()).unwrap();
    assert!(words.contains("2 materials of 2 families"), "{words}");
    let found = rows(directory.path());
    let of =
        |material: &str| -> Vec<&Vec<String>> { found.iter().filter(|row| row[0] == material).collect() };
    assert!(
        of("blue-rubber")
            .iter()
            .all(|row| row.last().unwrap() == "rubber"),
        "{found:?}"
    );
    // Not listed: of the family of its folder.
    let folder_name = folder.path().file_name().unwrap().to_string_lossy().into_owned();
    assert!(
        !of("measured").is_empty()
            && of("measured")
                .iter()
                .all(|row| *row.last().unwrap() == folder_name)
    );
    // The floor of scattered readings of a material that the model knows well is at those readings, out of the plane too.
    let floor = of("measured")
        .into_iter()
        .find(|row| row[1] == "floor" && row[7] == "reciprocal");
    let male: f64 = floor.expect("there is a floor")[11].parse().unwrap();
    assert!(male < 0.01, "{male}");
    // Without another family there is nothing to learn from.
    assert!(!words.contains("PCA"), "{words}");

    let other = Study::parse(&text, "study.toml", false).unwrap();
    let error = other.run(directory.path(), &|_, _| ()).unwrap_err();
    assert!(error.to_string().contains("another study"), "{error}");
}
