use sweep::{Model, Plan, Sweep, plan};

use crate::{job, mechanics, poses};

const PLANES: &str = "[[plane]]\ntheta_r_deg = 20\nreadings = 60\n[[plane]]\ntheta_r_deg = 45\nreadings = 60\n\
    [[plane]]\ntheta_r_deg = 60\nreadings = 60\n[[plane]]\ntheta_r_deg = 80\nreadings = 60\n[arc]\nreadings = 60\n";

fn planned(model: Model, scene: &str) -> Plan {
    let text = format!("{PLANES}[reconstruction]\nmodel = \"{}\"\n{scene}", model.name());
    plan(&job(&text), &mechanics()).expect("the rig can do it")
}

fn sweeps() -> impl Iterator<Item = Sweep> {
    (0..4).map(Sweep::Plane).chain([Sweep::Arc])
}

#[test]
fn what_the_scene_does_not_read_is_left_out_with_its_seconds_and_the_rest_stays_as_it_was() {
    for model in [
        Model::Separable,
        Model::Reciprocal,
        Model::Planes,
        Model::Bivariate,
        Model::Auto,
    ] {
        let whole = planned(model, "");
        let cut = planned(model, "[scene]\ntheta_i_deg = [0, 50]\ntheta_o_deg = [0, 50]");
        let saved: f64 = cut.left_out.iter().map(|left| left.seconds).sum();
        let less = whole.seconds() - cut.seconds();
        assert!(less > 1.0, "{model:?}: {less} s");
        // Both are planned times; a way that leads past a gap is a little longer than the sum.
        assert!(
            (saved - less).abs() < 0.3 * less + 1.0,
            "{model:?}: {saved} s of {less} s"
        );
        let readings: usize = cut.left_out.iter().map(|left| left.readings).sum();
        assert_eq!(whole.steps.len() - cut.steps.len(), readings, "{model:?}");
        for sweep in sweeps() {
            let [all, kept] = [&whole, &cut].map(|plan| poses(plan, sweep));
            assert!(kept.iter().all(|pose| all.contains(pose)), "{model:?}, {sweep}");
        }
        assert!(!poses(&cut, Sweep::Plane(0)).is_empty(), "{model:?}");
    }
}

#[test]
fn a_plane_that_nothing_reads_is_dropped() {
    let cut = planned(
        Model::Planes,
        "[scene]\ntheta_i_deg = [0, 40]\ntheta_o_deg = [0, 40]",
    );
    assert!(poses(&cut, Sweep::Plane(3)).is_empty());
    let names: Vec<&str> = cut.left_out.iter().map(|left| left.what.as_str()).collect();
    assert!(names.iter().any(|name| name.starts_with("plane 80")), "{names:?}");
    // What one plane's models never read at all.
    let cut = planned(Model::Separable, "[scene]\ntheta_o_deg = [0, 89]");
    assert!(poses(&cut, Sweep::Plane(1)).is_empty());
}

#[test]
fn of_the_whole_hemisphere_next_to_nothing_is_left_out() {
    let (whole, cut) = (planned(Model::Planes, ""), planned(Model::Planes, "[scene]"));
    assert_eq!(whole.steps.len(), cut.steps.len(), "{:?}", cut.left_out);
}

#[test]
fn channels_that_nobody_asks_for_are_named() {
    let cut = planned(Model::Planes, "[scene]\nchannels = [\"g\"]");
    let names: Vec<&str> = cut.left_out.iter().map(|left| left.what.as_str()).collect();
    assert!(
        names.contains(&"channel red") && names.contains(&"channel blue"),
        "{names:?}"
    );
    assert!(!names.contains(&"channel green"), "{names:?}");
}

#[test]
fn a_histogram_is_the_union_of_its_cells() {
    let ranges = planned(
        Model::Planes,
        "[scene]\ntheta_i_deg = [0, 40]\ntheta_o_deg = [0, 40]",
    );
    let cells = "[[0, 40, 0, 20, 3], [0, 40, 20, 40, 0.01]]";
    let cut = planned(Model::Planes, &format!("[scene]\ndirections = {cells}"));
    assert_eq!(poses(&cut, Sweep::Arc), poses(&ranges, Sweep::Arc));
    // What is hardly ever looked at may be left out, and then more need not be read.
    let most = planned(
        Model::Planes,
        &format!("[scene]\ndirections = {cells}\nshare = 0.99"),
    );
    assert!(
        most.seconds() < cut.seconds(),
        "{} s of {} s",
        most.seconds(),
        cut.seconds()
    );
}
