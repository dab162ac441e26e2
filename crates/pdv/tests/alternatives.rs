//! What readings allow besides a model.

use brdf::{Brdf, Fitted, Spherical};
use glam::DVec3;
use pdv::{Alternatives, Observation, Planes};
use proptest::prelude::*;

fn plane(of: &dyn Brdf, theta_r: f64, readings: usize) -> Vec<Observation> {
    let at = |n: usize| (2.0 * n as f64 / readings as f64 - 0.9).powi(3) * 1.4;
    (0..=readings)
        .filter_map(|n| Observation::of(of, theta_r, at(n)))
        .collect()
}

fn arc(of: &dyn Brdf) -> Vec<Observation> {
    (0..8)
        .filter_map(|n| Observation::of(of, f64::from(n) * 0.19, 0.0))
        .collect()
}

fn pairs() -> impl Iterator<Item = (DVec3, DVec3)> {
    let direction = |theta: f64, phi: f64| Spherical { theta, phi }.direction();
    (0..200).map(move |n| {
        let [a, b, c] = [0.7549, 0.5698, 0.4302].map(|step| (f64::from(n) * step).fract());
        (direction(1.35 * a, 3.1 * c), direction(1.35 * b, 0.0))
    })
}

/// Mean u of ln f over pairs.
fn mean(planes: &[Vec<Observation>], arc: &[Observation]) -> f64 {
    let model = Planes::from_observations(planes, arc).expect("a model");
    let alternatives = Alternatives::new(planes, arc).expect("a model has alternatives");
    let sum: f64 = pairs()
        .map(|(i, o)| alternatives.u_log(model.eval(i, o), i, o).element_sum())
        .sum();
    sum / 600.0
}

#[test]
fn more_planes_leave_less_to_choose_from() {
    for name in ["gold-paint", "blue-rubber", "nickel"] {
        let material = Fitted::named(name).unwrap();
        let planes = |degrees: &[f64]| -> Vec<Vec<Observation>> {
            degrees
                .iter()
                .map(|deg| plane(&material, deg.to_radians(), 30))
                .collect()
        };
        let arc = arc(&material);
        let [few, many] =
            [&[20.0, 70.0][..], &[10.0, 25.0, 40.0, 55.0, 70.0, 80.0]].map(|at| mean(&planes(at), &arc));
        println!("{name}: {few:.3} of two planes, {many:.3} of six");
        assert!(many < few, "{name}: {few} of two planes, {many} of six");
    }
}

#[test]
fn what_the_model_of_one_plane_takes_for_granted_is_seen() {
    let material = Fitted::named("brass").unwrap();
    let one = mean(&[plane(&material, 0.5, 30)], &arc(&material));
    let three = mean(
        &[0.3, 0.8, 1.2].map(|theta_r| plane(&material, theta_r, 30)),
        &arc(&material),
    );
    assert!(one > three, "{one} of one plane, {three} of three");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever was read, negative readings and black channels among it.
    #[test]
    fn prop_it_is_a_number_above_its_floor(
        readings in prop::collection::vec((-1.0..1.9_f64, prop_oneof![-1e-3..1e-3_f64, 0.0..1e3_f64, Just(0.0)]), 2..30),
        theta_r in 0.0..1.4_f64,
        of_peak in 0.0..1e4_f64,
    ) {
        let plane: Vec<_> = readings
            .iter()
            .map(|&(deviation, f)| Observation { theta_r, deviation, rgb: DVec3::new(f, -f, 0.5 * f) })
            .collect();
        let arc = [Observation { theta_r, deviation: 0.0, rgb: DVec3::new(of_peak, 0.0, 1.0) }];
        if let Ok(alternatives) = Alternatives::new(&[plane], &arc) {
            for (i, o) in pairs().take(20) {
                for f in [DVec3::ZERO, DVec3::ONE, DVec3::splat(1e6)] {
                    let u = alternatives.u_log(f, i, o);
                    prop_assert!(u.is_finite() && u.min_element() >= 0.05, "{u}");
                }
            }
        }
    }
}
