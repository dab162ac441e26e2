//! A small study of error against run time, whole and interrupted.

use std::fs;
use std::path::Path;

use study::Study;

const TEXT: &str = "
study = \"error-against-time\"
materials = [\"gold-paint\", \"blue-rubber\", \"brass\"]
every = 2
models = [\"separable\", \"reciprocal\", \"planes\"]
plans = { planes_deg = [[30.0]], readings = [8], distribution = \"capped\", arc = [0, 8] }
adaptive = { planes_deg = [20.0, 70.0], readings = 8, arc = 8, budget_s = [30] }
pca = { readings = [2], folds = 3 }
compare = { pairs = 500, theta_max_deg = 80.0, seed = 3 }
";

/// Rows without the seconds that this machine took.
fn rows(directory: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(directory.join("study.csv")).expect("the study wrote it");
    let cells = |line: &str| -> Vec<String> {
        let cells = line.split(',').map(str::to_owned).enumerate();
        cells.filter(|(i, _)| *i != 10).map(|(_, cell)| cell).collect()
    };
    text.lines().map(cells).collect()
}

#[test]
fn an_interrupted_study_ends_as_a_whole_one_does() {
    let directory = tempfile::tempdir().unwrap();
    let study = Study::parse(TEXT, "study.toml", false).unwrap();
    let words = study.run(directory.path(), &|_, _| ()).unwrap();
    assert!(words.contains("2 materials, 6 captures"), "{words}");
    assert!(words.contains("planned on the way, "), "{words}");
    let whole = rows(directory.path());
    // Two plans with two models each, one made on the way, the floor of both models, black and PCA; two materials; the
    // heading.
    assert_eq!(whole.len(), 2 * (4 + 1 + 2 + 2) + 1);
    for name in [
        "front.csv",
        "floor.csv",
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

    let csv = directory.path().join("study.csv");
    let text = fs::read_to_string(&csv).unwrap();
    // As if it had been killed in the midst of a line.
    fs::write(&csv, &text[..text.len() / 2]).unwrap();
    study.run(directory.path(), &|_, _| ()).unwrap();
    assert_eq!(rows(directory.path()), whole);

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
