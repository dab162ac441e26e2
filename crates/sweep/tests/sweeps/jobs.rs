use std::fs;
use std::path::Path;

use sweep::{Distribution, Job, Model, Plane};

use crate::PAPER;

const QUICKSTART: &str = include_str!("../../../../config/jobs/quickstart.toml");

#[test]
fn the_papers_job_is_read() {
    let job = Job::parse(PAPER, "paper.toml").unwrap();
    assert_eq!(job.name, "paper.toml");
    assert_eq!(job.planes.len(), 1);
    assert!((job.planes[0].theta_r.to_degrees() - 70.0).abs() < 1e-12);
    assert_eq!(
        (job.planes[0].readings, job.planes[0].distribution),
        (90, Distribution::Capped)
    );
    assert_eq!(job.arc.map(|arc| (arc.readings, arc.offset)), Some((90, 0.0)));
    assert_eq!(job.model, Model::Separable);
}

#[test]
fn what_is_not_said_is_capped_of_planes_and_without_arc() {
    let job = Job::parse("[[plane]]\ntheta_r_deg = 45\nreadings = 5", "").unwrap();
    assert_eq!(job.planes[0].distribution, Distribution::Capped);
    assert_eq!((job.arc, job.model), (None, Model::Planes));
}

/// Whoever copies a job must not copy with it that the specimen is there, or a model that is worse than the rest.
#[test]
fn no_job_that_comes_with_the_program_says_that_its_specimen_is_on_the_stage() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/jobs");
    let files: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path())
        .collect();
    assert!(files.len() > 4, "{files:?}");
    for file in files {
        let name = file.file_name().unwrap().to_str().unwrap();
        let job = Job::parse(&fs::read_to_string(&file).unwrap(), name).unwrap();
        assert!(!job.on_stage, "{name}");
        let expected = match name {
            "paper.toml" => Model::Separable,
            _ => Model::Planes,
        };
        assert_eq!(job.model, expected, "{name}");
    }
}

#[test]
fn the_first_job_is_three_planes_and_a_short_arc() {
    let job = Job::parse(QUICKSTART, "quickstart.toml").unwrap();
    let planes: Vec<_> = job
        .planes
        .iter()
        .map(|plane| {
            (
                plane.theta_r.to_degrees().round(),
                plane.readings,
                plane.distribution,
            )
        })
        .collect();
    let plane = |theta_r_deg| (theta_r_deg, 14, Distribution::Lobe);
    assert_eq!(planes, [plane(20.0), plane(45.0), plane(70.0)]);
    assert_eq!(job.arc.map(|arc| arc.readings), Some(6));
}

/// A job that stops when good enough may leave its first sweeps to the program, which goes by its scene.
#[test]
fn first_sweeps_that_are_not_named_follow_from_the_scene() {
    const OPEN: &str = "[reconstruction]\nmodel = \"planes\"\n[sweep]\ntarget_male = 0.001\n";
    let first = |rest: &str| {
        let job = Job::parse(&format!("{OPEN}{rest}"), "job.toml").unwrap();
        let place = |plane: &Plane| (plane.theta_r.to_degrees().round(), plane.readings);
        let arc = job.arc.map(|arc| arc.readings);
        (job.planes.iter().map(place).collect::<Vec<_>>(), arc)
    };
    let two = vec![(20.0, 16), (70.0, 16)];
    assert_eq!(first(""), (two.clone(), Some(8)));
    assert_eq!(
        first("[scene]\ntheta_i_deg = [0, 60]"),
        (two, Some(8)),
        "every viewer is"
    );
    let below = "[scene]\ntheta_i_deg = [0, 60]\ntheta_o_deg = [0, 40]\n";
    assert_eq!(first(below), (vec![(45.0, 16)], Some(4)));
    assert_eq!(
        first(&format!("{below}[arc]\nreadings = 9")),
        (vec![(45.0, 16)], Some(9))
    );
    let named = first(&format!("{below}[[plane]]\ntheta_r_deg = 10\nreadings = 20"));
    assert_eq!(named, (vec![(10.0, 20)], None), "what is named stays");
}

/// What is wrong with a job file, and what is said about it.
#[test]
fn bad_input_is_named_with_line_key_and_range() {
    let plane = "[[plane]]\ntheta_r_deg = 70.0\nreadings = 90\n";
    let table = [
        (
            "".to_owned(),
            "job.toml: [[plane]]: 0 planes and 0 legs, allowed are 1 … 12 together, or none where sweep.target_male or sweep.budget_s is given",
        ),
        (
            plane.repeat(13),
            "job.toml: [[plane]]: 13 planes and 0 legs, allowed are 1 … 12 together, or none where sweep.target_male or sweep.budget_s is given",
        ),
        (
            "[snake]\nlegs = 5".to_owned(),
            "job.toml, line 2: snake.legs: 5 is not one of 3, 6, 10",
        ),
        (
            format!("{}[snake]\nlegs = 10", plane.repeat(3)),
            "job.toml: [[plane]]: 3 planes and 10 legs, allowed are 1 … 12 together, or none where sweep.target_male or sweep.budget_s is given",
        ),
        (
            "[[leg]]\nhalf_deg = [10.0, 12.0]\ndifference_deg = [20.0, 40.0]".to_owned(),
            "job.toml, line 2: leg[0].half_deg: from 10 to 12 is less than 5°: a leg runs over the half angle, for the mirror arc there is [arc]",
        ),
        (
            "[[leg]]\nhalf_deg = [-10.0, 20.0]\ndifference_deg = [5.0, 40.0]".to_owned(),
            "job.toml, line 2: leg[0].half_deg: with a half angle of -10 and a difference angle of 5 the sensor would stand at -5, allowed are 0 … 85",
        ),
        (
            "[[leg]]\nhalf_deg = [0.0, 20.0]\ndifference_deg = [5.0, 86.0]".to_owned(),
            "job.toml, line 3: leg[0].difference_deg: 86 is not within 0 … 85",
        ),
        (
            "[snake]\nlegs = 3\n[sweep]\ntarget_male = 0.001\n".to_owned(),
            "job.toml: sweep: what is added on the way are planes; a job with legs has neither target_male nor budget_s",
        ),
        (
            "[snake]\nlegs = 3\n[reconstruction]\nmodel = \"separable\"".to_owned(),
            "job.toml: reconstruction.model: readings of legs make the model \"planes\" alone, this job's is \"separable\"",
        ),
        (
            "[[plane]]\ntheta_r_deg = 85.1\nreadings = 90".to_owned(),
            "job.toml, line 2: plane[0].theta_r_deg: 85.1 is not within 0 … 85",
        ),
        (
            format!("{plane}[[plane]]\nreadings = 1\ntheta_r_deg = -1"),
            "job.toml, line 6: plane[1].theta_r_deg: -1 is not within 0 … 85",
        ),
        (
            "[[plane]]\ntheta_r_deg = nan\nreadings = 90".to_owned(),
            "job.toml, line 2: plane[0].theta_r_deg: NaN is not within 0 … 85",
        ),
        (
            "[[plane]]\ntheta_r_deg = 70\nreadings = 0".to_owned(),
            "job.toml, line 3: plane[0].readings: 0 is not within 1 … 2000",
        ),
        (
            format!("{plane}[arc]\nreadings = 2001"),
            "job.toml, line 5: arc.readings: 2001 is not within 1 … 2000",
        ),
        (
            format!("{plane}[arc]\nreadings = 2\noffset = 1.5"),
            "job.toml, line 6: arc.offset: 1.5 is not within -1 … 1",
        ),
        (
            format!("{plane}speed = 3"),
            "job.toml, line 4: plane[0].speed: unknown field `speed`, expected one of `theta_r_deg`, `readings`, `distribution`",
        ),
        (
            format!("{plane}distribution = \"dense\""),
            "job.toml, line 4: plane[0].distribution: unknown variant `dense`, expected one of `capped`, `paper`, `uniform`, `lobe`",
        ),
        (
            "[[plane]]\ntheta_r_deg = \"70\"\nreadings = 90".to_owned(),
            "job.toml, line 2: plane[0].theta_r_deg: invalid type: string \"70\", expected f64",
        ),
        (
            "[[plane]]\ntheta_r_deg = 70\nreadings = 9.5".to_owned(),
            "job.toml, line 3: plane[0].readings: invalid type: floating point `9.5`, expected i64",
        ),
        (
            "[[plane]]\ntheta_r_deg = 70".to_owned(),
            "job.toml, line 1: plane[0]: missing field `readings`",
        ),
        (
            format!("{plane}[reconstruction]\nmodel = \"magic\""),
            "job.toml, line 5: reconstruction.model: unknown variant `magic`, expected one of `separable`, `reciprocal`, `planes`, `bivariate`, `auto`",
        ),
        (
            format!("formats = [\"jpeg\"]\n{plane}"),
            "job.toml, line 1: formats: there is no format \"jpeg\"; there are merl, csv-long, rgl-rgb, rgl-spectral, astm, zemax, ssdd, pab-opto, exr, exr-half-difference, materialx, gltf",
        ),
        (
            format!("formats = [\n  \"astm\",\n  \"astm\",\n]\n{plane}"),
            "job.toml, line 3: formats: \"astm\" is given twice",
        ),
        (
            format!("{plane}[scene]\ntheta_i_deg = [60, 0]"),
            "job.toml, line 5: scene.theta_i_deg: [60, 0] is no range within 0 … 90, the smaller first",
        ),
        (
            format!("{plane}[scene]\ntheta_o_deg = [0, nan]"),
            "job.toml, line 5: scene.theta_o_deg: [0, NaN] is no range within 0 … 90, the smaller first",
        ),
        (
            format!("{plane}[scene]\nchannels = []"),
            "job.toml, line 5: scene.channels: empty, allowed are \"r\", \"g\", \"b\", at least one",
        ),
        (
            format!("{plane}[scene]\nchannels = [\"x\"]"),
            "job.toml, line 5: scene.channels[0]: unknown variant `x`, expected one of `r`, `g`, `b`",
        ),
    ];
    for (text, expected) in table {
        let error = Job::parse(&text, "job.toml").unwrap_err();
        assert_eq!(error.to_string(), expected, "of\n{text}");
    }
}

#[test]
fn what_is_no_toml_is_refused_with_its_line() {
    for text in [
        "[[plane]]\ntheta_r_deg = = 3",
        "\u{0}",
        "[[plane",
        "a = 1\na = 2",
        "ä = \"",
        "\n\n]",
    ] {
        let error = Job::parse(text, "job.toml").unwrap_err().to_string();
        assert!(error.starts_with("job.toml, line "), "{text:?}: {error}");
    }
}
