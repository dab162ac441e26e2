//! The separable model as a BRDF.

use std::f64::consts::{FRAC_PI_2, PI};

use brdf::{Black, Brdf, Fitted, Lambert, MerlTable, Mirror, Spherical};
use glam::DVec3;
use pdv::{Distribution, Error, Model, Observation, Pdv, Separable, spread};
use proptest::prelude::*;

const THETA_R: f64 = 1.2;

fn deviations(low: f64) -> Vec<f64> {
    let range = low..=THETA_R.sin() + 85.0_f64.to_radians().sin();
    spread(Distribution::Capped, THETA_R, &[range], 90, 1.5e-3).deviations
}

fn arc() -> Vec<f64> {
    (0..90)
        .map(|n| (f64::from(n) * 85.0 / 89.0).to_radians())
        .collect()
}

fn model(brdf: &dyn Brdf) -> Separable {
    Separable::sample(brdf, THETA_R, &deviations(0.0), &arc(), 0.0).expect("poses exist")
}

fn fitted(name: &str) -> Fitted {
    Fitted::named(name).expect("a fitted material")
}

fn close(a: DVec3, b: DVec3, tolerance: f64) -> bool {
    (a - b).abs().max_element() <= tolerance * b.max_element()
}

#[test]
fn gives_back_what_it_was_made_of() {
    let gold = fitted("gold-paint");
    let model = model(&gold);
    for deviation in deviations(0.0) {
        let (incident, exitant) = Pdv::in_plane(THETA_R, deviation).directions().unwrap();
        let (f, g) = (gold.eval(incident, exitant), model.eval(incident, exitant));
        // F(θ_r^dp) lies between two nodes of the arc.
        assert!(close(g, f, 2e-4), "{g} instead of {f} at d_p = {deviation}");
    }
    for theta in arc() {
        let (incident, exitant) = Pdv::in_plane(theta, 0.0).directions().unwrap();
        let (f, g) = (gold.eval(incident, exitant), model.eval(incident, exitant));
        assert!(close(g, f, 1e-12), "{g} instead of {f} at θ_r = {theta}");
    }
    let at = model.f().at(THETA_R.sin().powi(2));
    assert!(close(at, DVec3::ONE, 1e-4), "F(θ_r^dp) is {at}");
}

#[test]
fn the_intersection_may_be_anywhere() {
    let gold = fitted("gold-paint");
    for x in [-0.03, 0.02, 0.4] {
        let model = Separable::sample(&gold, THETA_R, &deviations(-0.06), &arc(), x).unwrap();
        assert!((model.intersection() - x).abs() < 1e-15);
        let at = model.f().at(THETA_R.sin().powi(2));
        assert!(close(at, DVec3::ONE, 2e-3), "F(θ_r^dp) is {at} with x = {x}");
    }
}

#[test]
fn both_sides_are_averaged_and_the_outward_one_fades() {
    let observe = |deviation: f64, rho: f64| Observation {
        theta_r: THETA_R,
        deviation,
        rgb: DVec3::splat(rho),
    };
    let plane = [
        observe(-0.06, 8.0),
        observe(-0.03, 8.0),
        observe(0.0, 2.0),
        observe(0.03, 2.0),
        observe(1.0, 2.0),
    ];
    let model = Separable::from_observations(&plane, &[]).unwrap();
    let (low, high) = (2.0_f64.ln_1p(), 8.0_f64.ln_1p());
    let quarter = low + 0.25 * (high - low);
    assert!(
        (model.g().at(0.03 * 0.03).x - quarter).abs() < 1e-12,
        "{}",
        model.g().at(0.03 * 0.03)
    );
    assert!(
        (model.g().at(0.06 * 0.06).x - low).abs() < 1e-12,
        "{}",
        model.g().at(0.06 * 0.06)
    );
    assert_eq!(model.g().range(), (0.0, 1.0));
}

#[test]
fn a_diffuser_is_reconstructed_everywhere() {
    let half = Lambert::new(0.5).unwrap();
    let model = model(&half);
    let incident = Spherical { theta: 1.3, phi: 0.3 }.direction();
    let exitant = Spherical { theta: 0.2, phi: 2.0 }.direction();
    assert!(close(
        model.eval(incident, exitant),
        half.eval(incident, exitant),
        1e-12
    ));
}

#[test]
fn black_stays_black_and_a_mirror_stays_finite() {
    let black = model(&Black);
    assert_eq!(black.eval(DVec3::Z, DVec3::Z), DVec3::ZERO);
    let mirror = Mirror::new(1.0, Mirror::HALF_ANGLE_RAD).unwrap();
    let seen = model(&mirror);
    let (incident, exitant) = Pdv::in_plane(0.5, 0.0).directions().unwrap();
    assert!(close(
        seen.eval(incident, exitant),
        mirror.eval(incident, exitant),
        0.01
    ));
    assert_eq!(seen.eval(DVec3::Z, exitant), DVec3::ZERO);
}

#[test]
fn where_the_intersection_is_black_the_plane_stands_alone() {
    let observe = |theta_r: f64, deviation: f64, rho: f64| Observation {
        theta_r,
        deviation,
        rgb: DVec3::splat(rho),
    };
    let plane = [observe(THETA_R, 0.0, 0.0), observe(THETA_R, 0.5, 0.3)];
    let arc = [observe(0.3, 0.0, 0.2), observe(1.3, 0.0, 0.4)];
    let model = Separable::from_observations(&plane, &arc).unwrap();
    let (incident, exitant) = Pdv::in_plane(0.7, 0.5).directions().unwrap();
    assert!((model.eval(incident, exitant).x - 0.3).abs() < 1e-12);
}

#[test]
fn says_what_it_has_not_measured() {
    let model = model(&fitted("gold-paint"));
    let extrapolated = |theta_r: f64, deviation: f64| {
        let (incident, exitant) = Pdv::in_plane(theta_r, deviation).directions().unwrap();
        model.extrapolated(incident, exitant)
    };
    assert!(!extrapolated(0.5, 0.3) && !extrapolated(THETA_R, 1.5));
    assert!(extrapolated(86.0_f64.to_radians(), 0.1), "beyond the arc");
    assert!(extrapolated(84.0_f64.to_radians(), 1.99), "beyond the plane");
    let alone = Separable::from_observations(
        &[
            Observation::of(&Black, 0.5, 0.0).unwrap(),
            Observation::of(&Black, 0.5, 1.0).unwrap(),
        ],
        &[],
    );
    let (incident, exitant) = Pdv::in_plane(0.6, 0.3).directions().unwrap();
    assert!(
        alone.unwrap().extrapolated(incident, exitant),
        "without an arc other θ_r are not known"
    );
}

#[test]
fn readings_that_are_no_numbers_are_dropped_and_counted() {
    let gold = fitted("gold-paint");
    let mut plane: Vec<_> = deviations(0.0)
        .iter()
        .map(|&d| Observation::of(&gold, THETA_R, d).unwrap())
        .collect();
    plane.push(Observation {
        theta_r: THETA_R,
        deviation: 0.5,
        rgb: DVec3::new(f64::NAN, 1.0, 1.0),
    });
    plane.push(Observation {
        theta_r: THETA_R,
        deviation: f64::NAN,
        rgb: DVec3::ONE,
    });
    plane.push(Observation {
        theta_r: THETA_R,
        deviation: 1.7,
        rgb: DVec3::splat(-1e-5),
    });
    let model = Separable::from_observations(&plane, &[]).unwrap();
    assert_eq!(model.dropped(), 2);
    let (incident, exitant) = Pdv::in_plane(THETA_R, 1.7).directions().unwrap();
    assert_eq!(
        model.eval(incident, exitant),
        DVec3::ZERO,
        "a negative reading counts as 0"
    );
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let at = |theta_r, deviation| Observation {
        theta_r,
        deviation,
        rgb: DVec3::ONE,
    };
    assert_eq!(
        Separable::from_observations(&[], &[]),
        Err(Error::Empty {
            factor: "G",
            dropped: 0
        })
    );
    let two_planes = Separable::from_observations(&[at(0.5, 0.0), at(0.6, 0.1)], &[]);
    assert!(
        two_planes.unwrap_err().to_string().contains("0.5000 to 0.6000"),
        "two planes"
    );
    let two_arcs = Separable::from_observations(&[at(0.5, 0.0)], &[at(0.1, 0.0), at(0.2, 0.3)]);
    assert!(matches!(two_arcs, Err(Error::Mixed { .. })));
    let blind = Separable::from_observations(&[at(0.5, 0.0)], &[at(f64::NAN, 0.0)]);
    assert_eq!(
        blind,
        Err(Error::Empty {
            factor: "F",
            dropped: 1
        })
    );
}

#[test]
fn its_factors_are_tables() {
    let [f, g] = <[_; 2]>::try_from(model(&fitted("gold-paint")).factors()).unwrap();
    assert_eq!((f.name, f.variable, f.rows.len()), ("F", "theta_r_deg", 90));
    assert_eq!((g.name, g.variable, g.rows.len()), ("G", "d_p", 90));
    assert!((f.rows[89].0 - 85.0).abs() < 1e-9);
}

#[test]
fn fills_a_table_that_reads_as_the_model() {
    let model = model(&fitted("gold-paint"));
    let table = MerlTable::fill(&model);
    for index in [[5, 10, 20], [30, 40, 100], [60, 20, 170]] {
        let (incident, exitant) = MerlTable::coordinates(index).directions();
        assert_eq!(table.node(index), model.eval(incident, exitant), "{index:?}");
    }
}

fn direction() -> impl Strategy<Value = DVec3> {
    (0.0..=FRAC_PI_2, -PI..PI).prop_map(|(theta, phi)| Spherical { theta, phi }.direction())
}

proptest! {
    #[test]
    fn prop_is_finite_and_not_negative(material in 0_usize..100, incident in direction(), exitant in direction()) {
        let (name, fitted) = Fitted::all().nth(material).expect("there are 100");
        let f = model(&fitted).eval(incident, exitant);
        prop_assert!(f.is_finite() && f.min_element() >= 0.0, "{}: {}", name, f);
    }

    #[test]
    fn prop_depends_on_theta_r_and_d_p_alone(
        theta_r in 0.0..1.5_f64, d_p in 0.0..1.0_f64, phi in (-PI..PI, -PI..PI),
    ) {
        let model = model(&fitted("gold-paint"));
        let at = |phi_p| Pdv { theta_r, d_p, phi_p }.directions().filter(|(incident, _)| incident.z > 1e-6);
        let (Some(first), Some(second)) = (at(phi.0), at(phi.1)) else {
            return Err(TestCaseError::reject("off the disk"));
        };
        prop_assert!(close(model.eval(first.0, first.1), model.eval(second.0, second.1), 1e-9));
    }
}
