//! The cases of docs/numerics.md: what the exact answer is, what the naive form makes of it, and what ours does.

use std::f64::consts::PI;

use brdf::{Brdf, Fitted, HalfDifference, Spherical};
use glam::DVec3;
use pdv::{Bivariate, Model, Observation, Pdv, Planes, Separable};

/// A Gaussian lobe over the half angle on a faint diffuser.
struct Lobe {
    width: f64,
    peak: f64,
    floor: f64,
}

impl Brdf for Lobe {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let sum = incident + exitant;
        let tan = sum.x.hypot(sum.y) / sum.z;
        DVec3::splat(self.floor + self.peak * (-0.5 * (tan.atan() / self.width).powi(2)).exp())
    }
}

/// A plane read at half angles that double from a fifth of `narrow`, on both sides, and an arc.
fn read(brdf: &dyn Brdf, theta_r: f64, narrow: f64) -> [Vec<Observation>; 2] {
    let halves = (0..60)
        .map(|n| 0.2 * narrow * 1.25_f64.powi(n))
        .take_while(|half| *half < 0.6);
    let both = std::iter::once(0.0).chain(halves.flat_map(|half| [half, -half]));
    let plane = both
        .filter_map(|half: f64| {
            let alpha = 2.0 * half - theta_r;
            (alpha.abs() < 1.5).then(|| Observation::of(brdf, theta_r, alpha.sin() + theta_r.sin()))?
        })
        .collect();
    let arc = (1..30)
        .filter_map(|n| Observation::of(brdf, f64::from(n) * 0.05, 0.0))
        .collect();
    [plane, arc]
}

fn all(plane: &[Observation], arc: &[Observation]) -> [Box<dyn Model>; 3] {
    let planes = [plane.to_vec()];
    [
        Box::new(Planes::from_observations(&planes, arc).expect("there are readings")),
        Box::new(Bivariate::from_observations(&planes, arc).expect("there are readings")),
        Box::new(Separable::from_observations(plane, arc).expect("there are readings")),
    ]
}

/// A pair at grazing, at retro-reflection, in the mirror direction, and with the largest d_p.
fn degenerate() -> Vec<(DVec3, DVec3)> {
    let at = |deg: f64, phi: f64| {
        Spherical {
            theta: deg.to_radians(),
            phi,
        }
        .direction()
    };
    let mut pairs = vec![
        (DVec3::Z, DVec3::Z),
        (DVec3::X, DVec3::NEG_X),
        (DVec3::X, DVec3::X),
    ];
    for deg in [0.0, 1e-7, 45.0, 89.9, 89.99, 89.999_999, 90.0] {
        for phi in [0.0, 1e-9, PI / 2.0, PI - 1e-9, PI] {
            pairs.push((at(deg, phi), at(deg, 0.0)));
            pairs.push((at(89.99, phi), at(deg, 0.0)));
        }
    }
    pairs.push((DVec3::new(1.0, 0.0, 1e-200), DVec3::new(-1.0, 0.0, 1e-200)));
    pairs
}

#[test]
fn a_lobe_of_a_hundredth_of_a_degree_and_ten_millions_is_kept() {
    let lobe = Lobe {
        width: 0.01_f64.to_radians(),
        peak: 1e7,
        floor: 1e-3,
    };
    let [plane, arc] = read(&lobe, 0.5, lobe.width);
    for model in all(&plane, &arc) {
        let at = |half: f64| {
            let o = Observation::of(&model, 0.5, (2.0 * half - 0.5).sin() + 0.5_f64.sin()).unwrap();
            o.rgb.x
        };
        // The bivariate table, 90 nodes, has its first beside the peak at 0.01°.
        assert!(
            (at(0.0) / 1e7).ln().abs() < 0.02,
            "{} at the peak: {}",
            at(0.0),
            model.about()
        );
        assert!(at(0.3) < 0.01, "{} far from it: {}", at(0.3), model.about());
        for (incident, exitant) in degenerate() {
            let f = model.eval(incident, exitant);
            assert!(
                f.is_finite() && f.min_element() >= 0.0,
                "{f} at {incident}, {exitant}: {}",
                model.about()
            );
        }
    }
    let planes = Planes::from_observations(&[plane], &arc).unwrap();
    let (incident, exitant) = Pdv::in_plane(0.5, 2.0 * lobe.width * 0.5_f64.cos())
        .directions()
        .unwrap();
    let ratio = planes.exact(incident, exitant).x / lobe.eval(incident, exitant).x;
    assert!((ratio - 1.0).abs() < 0.1, "{ratio} one width beside the peak");
}

#[test]
fn seven_decades_in_one_sweep_and_what_is_nearly_black_are_kept() {
    for (peak, floor) in [(1e4, 1e-3), (1e-12, 1e-13), (0.0, 0.0)] {
        let lobe = Lobe {
            width: 0.05,
            peak,
            floor,
        };
        let [plane, arc] = read(&lobe, 0.5, 0.05);
        let planes = Planes::from_observations(std::slice::from_ref(&plane), &arc).unwrap();
        for o in plane.iter().filter(|o| o.rgb.x > 1e-9) {
            let (incident, exitant) = o.pdv().directions().unwrap();
            let ratio = planes.exact(incident, exitant).x / o.rgb.x;
            assert!((ratio - 1.0).abs() < 0.01, "{ratio} at {o:?}");
        }
        for model in all(&plane, &arc) {
            for (incident, exitant) in degenerate() {
                let f = model.eval(incident, exitant);
                assert!(
                    f.is_finite() && f.min_element() >= 0.0,
                    "{f} at {incident}, {exitant}"
                );
                // Below 1e-9 nothing is told from black, and shadowing brightens that by (1/0.03)² at most.
                assert!(peak > 1e-9 || f.max_element() < 2e-6, "{f} of {peak}");
            }
        }
    }
}

/// F = F_m/G(x) where G(x) goes to 0: the ratio of two zeros is not used.
#[test]
fn an_arc_beside_a_lobe_where_nothing_is_left_does_not_run_away() {
    let lobe = Lobe {
        width: 0.001,
        peak: 1e3,
        floor: 0.0,
    };
    let [plane, _] = read(&lobe, 0.5, 0.001);
    let arc: Vec<_> = (1..20)
        .filter_map(|n| Observation::of(&lobe, f64::from(n) * 0.05, 0.4))
        .collect();
    for model in all(&plane, &arc) {
        for (incident, exitant) in degenerate() {
            let f = model.eval(incident, exitant);
            assert!(
                f.is_finite() && f.max_element() < 1e9,
                "{f} at {incident}, {exitant}: {}",
                model.about()
            );
        }
    }
}

/// d_p and θ_h next to the mirror direction: the law of cosines and the arc cosine lose everything there.
#[test]
fn the_mirror_direction_is_not_lost_in_cancellation() {
    let (theta, d_p) = (0.8_f64, 1e-9);
    let (incident, exitant) = Pdv {
        theta_r: theta,
        d_p,
        phi_p: 1.0,
    }
    .directions()
    .unwrap();
    let found = Pdv::from_directions(incident, exitant).unwrap().d_p;
    let (s, t) = (incident.truncate().length(), theta.sin());
    let cos = incident.truncate().dot(exitant.truncate()) / (s * t);
    let naive = (s * s + t * t + 2.0 * s * t * cos).max(0.0).sqrt();
    assert!((found / d_p - 1.0).abs() < 1e-6, "{found}");
    assert!(
        (naive / d_p - 1.0).abs() > 0.5,
        "the naive form was good: {naive}"
    );
    let half = (incident + exitant).normalize();
    let (naive, found) = (half.z.acos(), half.x.hypot(half.y).atan2(half.z));
    assert!(
        naive == 0.0 || (naive / found - 1.0).abs() > 0.5,
        "the arc cosine was good: {naive}"
    );
    assert!(found > 1e-10 && found < 1e-9, "{found}");
}

#[test]
fn ln_of_what_is_small_keeps_its_digits() {
    let f = 1e-12_f64;
    assert!((f.ln_1p().exp_m1() / f - 1.0).abs() < 1e-15);
    assert!((((1.0 + f).ln().exp() - 1.0) / f - 1.0).abs() > 5e-5);
}

/// f32 against f64: half angles as large as a sharp lobe's width, of directions that are given in f32.
#[test]
fn a_half_angle_in_f32_is_lost_near_the_mirror_direction() {
    let half = 3e-4_f64;
    let [mut naive, mut found] = [0.0_f64; 2];
    for n in 0..1400 {
        let theta = 1e-3 * f64::from(n);
        let at = |theta: f64| DVec3::new(theta.sin(), 0.0, theta.cos());
        let (incident, exitant) = (at(-theta - 2.0 * half).as_vec3(), at(theta).as_vec3());
        let naive_rad = f64::from((incident + exitant).normalize().z.min(1.0).acos());
        naive = naive.max((naive_rad - half).abs());
        let rounded = HalfDifference::from_directions(incident.as_dvec3(), exitant.as_dvec3());
        found = found.max((rounded.theta_h - half).abs());
    }
    println!("off by {naive:.1e} rad with the arc cosine in f32, by {found:.1e} rad with sums in f64");
    assert!(naive >= half, "the arc cosine in f32 was good: {naive}");
    // What rounding the directions themselves costs.
    assert!(found < 2e-7, "{found}");
}

/// f32 against f64: the table beside the formula, over what a renderer asks for.
#[test]
fn the_table_in_f32_follows_the_formula_in_f64() {
    let gold = Fitted::named("gold-paint").unwrap();
    let [plane, arc] = read(&gold, 0.5, 0.02);
    let model = Planes::from_observations(&[plane], &arc).unwrap();
    let mut worst = 0.0_f64;
    for n in 0..20_000_u32 {
        let share = |ratio: f64| (f64::from(n) * ratio).fract();
        let at = |theta: f64, phi: f64| Spherical { theta, phi }.direction();
        let (incident, exitant) = (
            at(share(0.8191) * 1.39, share(0.671) * 2.0 * PI),
            at(share(0.5497) * 1.39, 0.0),
        );
        let log = |f: DVec3| (f * incident.z).map(f64::ln_1p);
        let loss = (log(model.eval(incident, exitant)) - log(model.exact(incident, exitant))).abs();
        worst = worst.max(loss.max_element());
    }
    assert!(worst < 0.05, "{worst}");
}

/// A few of the 10⁸ pairs that `cargo run --release -p pdv --example finite` tries.
#[test]
fn every_material_is_finite_everywhere() {
    for (name, material) in Fitted::all().step_by(25) {
        let [plane, arc] = read(&material, 0.5, 0.02);
        for model in all(&plane, &arc) {
            for (incident, exitant) in degenerate() {
                let f = model.eval(incident, exitant);
                assert!(
                    f.is_finite() && f.min_element() >= 0.0,
                    "{f} at {incident}, {exitant} of {name}"
                );
            }
        }
    }
}
