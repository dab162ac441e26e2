//! The model of one or more planes and an arc.

use std::f64::consts::{FRAC_PI_2, PI};

use brdf::{Black, Brdf, Fitted, Lambert, Mirror, Spherical};
use glam::DVec3;
use pdv::{
    Auto, Basis, Bivariate, Distribution, Draw, Error, Model, Observation, Planes, Shape, compare, spread,
};
use proptest::prelude::*;

/// The arms come no closer, rad.
const SEPARATION: f64 = 5.0 * PI / 180.0;
/// The arms go no further, rad.
const LIMIT: f64 = 85.0 * PI / 180.0;

/// A plane as a perfect rig would read it, both sides.
fn plane(brdf: &dyn Brdf, theta_r_deg: f64, readings: usize) -> Vec<Observation> {
    let theta_r = theta_r_deg.to_radians();
    let deviation = |alpha: f64| alpha.sin() + theta_r.sin();
    let ranges = [
        deviation(-LIMIT)..=deviation(theta_r - SEPARATION),
        deviation((theta_r + SEPARATION).min(LIMIT))..=deviation(LIMIT),
    ];
    let spread = spread(Distribution::Capped, theta_r, &ranges, readings, 1.5e-3);
    spread
        .deviations
        .iter()
        .filter_map(|&d| Observation::of(brdf, theta_r, d))
        .collect()
}

fn arc(brdf: &dyn Brdf, readings: usize, deviation: f64) -> Vec<Observation> {
    let from = SEPARATION / 2.0;
    (0..readings)
        .map(|n| from + (LIMIT - from) * n as f64 / (readings.max(2) - 1) as f64)
        .filter_map(|theta_r| Observation::of(brdf, theta_r, deviation))
        .collect()
}

fn model(brdf: &dyn Brdf, theta_r_deg: &[f64], readings: usize, along: usize) -> Planes {
    let planes: Vec<_> = theta_r_deg
        .iter()
        .map(|&deg| plane(brdf, deg, readings))
        .collect();
    Planes::from_observations(&planes, &arc(brdf, along, 0.0)).expect("there are readings")
}

fn fitted(name: &str) -> Fitted {
    Fitted::named(name).expect("a fitted material")
}

fn at(observation: &Observation) -> (DVec3, DVec3) {
    observation.pdv().directions().expect("it was read there")
}

fn pair(theta_i: f64, theta_o: f64, phi: f64) -> (DVec3, DVec3) {
    (
        Spherical { theta: theta_i, phi }.direction(),
        Spherical {
            theta: theta_o,
            phi: 0.0,
        }
        .direction(),
    )
}

/// Largest relative difference of the channels.
fn off(found: DVec3, truth: DVec3) -> f64 {
    ((found - truth) / truth.max(DVec3::splat(1e-3)))
        .abs()
        .max_element()
}

#[test]
fn gives_back_what_it_was_made_of() {
    let gold = fitted("gold-paint");
    for planes in [&[30.0][..], &[20.0, 45.0, 70.0]] {
        let model = model(&gold, planes, 30, 30);
        let planes = planes.iter().flat_map(|&deg| plane(&gold, deg, 30));
        for observation in planes.chain(arc(&gold, 30, 0.0)) {
            let (incident, exitant) = at(&observation);
            let found = model.exact(incident, exitant);
            assert!(
                off(found, observation.rgb) < 2e-3,
                "{found} instead of {observation:?}"
            );
            // Beyond 80° the table is coarse: it has a node every three degrees where f rises like 1/cos².
            if observation.theta_r > 80_f64.to_radians() {
                continue;
            }
            let (baked, cos) = (model.eval(incident, exitant), incident.z);
            let loss = ((baked * cos).map(f64::ln_1p) - (found * cos).map(f64::ln_1p)).abs();
            assert!(
                loss.max_element() < 0.01,
                "{baked} instead of {found} for {observation:?}"
            );
        }
    }
}

/// All materials for the few readings, every tenth for the many, at few pairs.
#[test]
fn comes_near_the_fitted_materials() {
    for (planes, readings, along, step, bar) in [
        (&[30.0][..], 90, 90, 4, 0.0012),
        (&[20.0, 45.0, 70.0], 13, 9, 1, 0.0012),
        (&[5.0, 20.0, 35.0, 50.0, 65.0, 75.0, 82.0], 90, 90, 10, 0.0005),
    ] {
        let draw = Draw {
            pairs: 1000,
            ..Draw::default()
        };
        let male: Vec<f64> = Fitted::all()
            .step_by(step)
            .filter_map(|(_, material)| {
                let model = model(&material, planes, readings, along);
                compare(&material, &[&model], &draw)[0].overall.male
            })
            .collect();
        let mean = male.iter().sum::<f64>() / male.len() as f64;
        assert!(
            mean < bar,
            "{mean} with planes at {planes:?}, at most {bar}: {male:?}"
        );
    }
}

/// What lies out of the plane is not read: the bars are those of this model, whose rule for it is the point.
#[test]
fn the_table_is_small_and_loses_little() {
    for name in ["gold-paint", "silver-metallic-paint2", "white-fabric"] {
        let model = model(&fitted(name), &[20.0, 45.0, 70.0], 30, 30);
        assert!(4 * model.numbers() <= 16_000, "{} numbers", model.numbers());
        assert!(model.loss() < 1e-3, "{name} loses {}", model.loss());
        struct Exact<'a>(&'a Planes);
        impl Brdf for Exact<'_> {
            fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
                self.0.exact(incident, exitant)
            }
        }
        let draw = Draw {
            pairs: 20_000,
            ..Draw::default()
        };
        let loss = compare(&Exact(&model), &[&model], &draw)[0].overall.male.unwrap();
        // The stated loss is over other pairs, in the plane.
        assert!(
            loss < 2.0 * model.loss() + 1e-5,
            "{name} loses {loss}, not {}",
            model.loss()
        );
    }
}

#[test]
fn a_diffuser_is_reconstructed_everywhere() {
    let half = Lambert::new(0.5).unwrap();
    let model = model(&half, &[30.0], 20, 10);
    for (theta_i, theta_o, phi) in [
        (0.0, 0.0, 0.0),
        (1.3, 0.2, 2.0),
        (1.5, 1.5, 0.1),
        (1.57, 1.57, 3.0),
    ] {
        let (incident, exitant) = pair(theta_i, theta_o, phi);
        let found = model.eval(incident, exitant);
        assert!(
            off(found, half.eval(incident, exitant)) < 1e-6,
            "{found} at {theta_i}, {theta_o}, {phi}, exactly {}, {:?} {:?}",
            model.exact(incident, exitant),
            model.shape(),
            model.error()
        );
    }
}

#[test]
fn black_stays_black_also_in_one_channel() {
    let (incident, exitant) = pair(0.5, 0.7, 2.0);
    let black = model(&Black, &[30.0, 60.0], 20, 10);
    assert_eq!(black.eval(incident, exitant), DVec3::ZERO);
    let without_green = |mut o: Observation| {
        o.rgb.y = 0.0;
        o
    };
    let gold = fitted("gold-paint");
    let planes = vec![plane(&gold, 30.0, 20).into_iter().map(without_green).collect()];
    let along: Vec<_> = arc(&gold, 10, 0.0).into_iter().map(without_green).collect();
    let found = Planes::from_observations(&planes, &along)
        .unwrap()
        .eval(incident, exitant);
    assert!(found.y == 0.0 && found.x > 0.0 && found.z > 0.0, "{found}");
}

#[test]
fn a_mirror_is_bright_in_its_direction_alone() {
    let mirror = Mirror::new(1.0, Mirror::HALF_ANGLE_RAD).unwrap();
    let model = model(&mirror, &[30.0], 40, 20);
    let (incident, exitant) = pair(0.5, 0.5, PI);
    assert!(off(model.eval(incident, exitant), mirror.eval(incident, exitant)) < 0.05);
    let (incident, exitant) = pair(0.2, 0.9, 1.0);
    assert!(
        model.eval(incident, exitant).max_element() < 1e-6,
        "beside the mirror direction"
    );
}

#[test]
fn faint_reflectance_keeps_its_shape() {
    let faint = |mut o: Observation| {
        o.rgb *= 1e-6;
        o
    };
    let gold = fitted("gold-paint");
    let planes = vec![plane(&gold, 30.0, 40).into_iter().map(faint).collect()];
    let along: Vec<_> = arc(&gold, 20, 0.0).into_iter().map(faint).collect();
    let model = Planes::from_observations(&planes, &along).unwrap();
    for observation in &along {
        let (incident, exitant) = at(observation);
        let found = model.exact(incident, exitant);
        assert!(
            (found / observation.rgb - 1.0).abs().max_element() < 0.02,
            "{found} instead of {observation:?}"
        );
    }
}

#[test]
fn an_arc_beside_the_mirror_direction_serves_as_well() {
    let gold = fitted("gold-paint");
    let planes = vec![plane(&gold, 30.0, 90)];
    let model = Planes::from_observations(&planes, &arc(&gold, 60, 0.02)).unwrap();
    let mut worst = 0.0_f64;
    for observation in arc(&gold, 17, 0.0)
        .iter()
        .filter(|o| (0.2..1.2).contains(&o.theta_r))
    {
        let (incident, exitant) = at(observation);
        worst = worst.max(off(model.eval(incident, exitant), observation.rgb));
    }
    assert!(worst < 0.1, "off by {worst} in the mirror direction");
}

#[test]
fn one_reading_of_each_is_enough() {
    let gold = fitted("gold-paint");
    let one = plane(&gold, 30.0, 9)[7];
    let model = Planes::from_observations(&[vec![one]], &arc(&gold, 1, 0.0)).unwrap();
    assert_eq!((model.shape(), model.error()), (Shape::DEFAULT, None));
    assert!(
        model.about().contains("no two sides to compare"),
        "{}",
        model.about()
    );
    let (incident, exitant) = at(&one);
    assert!(off(model.exact(incident, exitant), one.rgb) < 1e-6);
    let peak = Observation::of(&gold, 0.5, 0.0).unwrap();
    let alone = Planes::from_observations(&[vec![peak]], &[]).unwrap();
    let (incident, exitant) = at(&peak);
    assert!(off(alone.exact(incident, exitant), peak.rgb) < 1e-6);
    assert!(alone.extrapolated(DVec3::Z, DVec3::Z));
}

#[test]
fn order_and_repetition_do_not_matter() {
    let gold = fitted("gold-paint");
    let (there, along) = (plane(&gold, 30.0, 40), arc(&gold, 20, 0.0));
    let model = Planes::from_observations(std::slice::from_ref(&there), &along).unwrap();
    let mut twice: Vec<_> = there.iter().rev().copied().collect();
    // Twice the same on average.
    twice.extend(there.iter().map(|o| Observation {
        rgb: o.rgb * 1.5,
        ..*o
    }));
    twice.extend(there.iter().map(|o| Observation {
        rgb: o.rgb * 0.5,
        ..*o
    }));
    let back = Planes::from_observations(&[twice], &along).unwrap();
    let (incident, exitant) = pair(0.3, 0.8, 2.5);
    assert!(off(back.eval(incident, exitant), model.eval(incident, exitant)) < 1e-9);
}

#[test]
fn what_is_no_number_is_dropped_and_counted() {
    let gold = fitted("gold-paint");
    let mut there = plane(&gold, 30.0, 40);
    let first = there[5];
    there.push(Observation {
        rgb: DVec3::new(f64::NAN, 1.0, 1.0),
        ..first
    });
    there.push(Observation {
        deviation: f64::INFINITY,
        ..first
    });
    there.push(Observation {
        deviation: 1.9,
        ..first
    });
    there.push(Observation {
        deviation: 0.9,
        rgb: DVec3::splat(-1e-4),
        ..first
    });
    let mut along = arc(&gold, 20, 0.0);
    along.push(Observation {
        theta_r: f64::NAN,
        ..along[0]
    });
    let model = Planes::from_observations(&[there], &along).unwrap();
    assert_eq!(model.dropped(), 4, "a negative reading counts as 0");
    let (incident, exitant) = pair(0.3, 0.8, 2.5);
    assert!(model.eval(incident, exitant).is_finite());
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let gold = fitted("gold-paint");
    let empty = |factor, dropped| Error::Empty { factor, dropped };
    assert_eq!(Planes::from_observations(&[], &[]), Err(empty("G", 0)));
    assert_eq!(
        Planes::from_observations(&[vec![]], &arc(&gold, 3, 0.0)),
        Err(empty("G", 0))
    );
    let mut blind = arc(&gold, 1, 0.0);
    blind[0].rgb.x = f64::NAN;
    assert_eq!(
        Planes::from_observations(&[plane(&gold, 30.0, 9)], &blind),
        Err(empty("F", 1))
    );
    let both: Vec<_> = [30.0, 45.0]
        .iter()
        .flat_map(|&deg| plane(&gold, deg, 9))
        .collect();
    assert!(matches!(
        Planes::from_observations(&[both], &[]),
        Err(Error::Mixed { .. })
    ));
}

/// A line in half and difference angle, degrees, read at `n` places.
fn leg(brdf: &dyn Brdf, half_deg: [f64; 2], difference_deg: [f64; 2], n: usize) -> Vec<Observation> {
    let at = |[from, to]: [f64; 2], share: f64| (from + share * (to - from)).to_radians();
    (0..n)
        .filter_map(|i| {
            let share = i as f64 / (n - 1) as f64;
            let (half, difference) = (at(half_deg, share), at(difference_deg, share));
            let (light, sensor) = (half - difference, half + difference);
            Observation::of(brdf, sensor, light.sin() + sensor.sin())
        })
        .collect()
}

/// Where both arms move the model is as good as where the sensor stands, and gives back what was read.
#[test]
fn lines_along_which_both_arms_move_make_a_model_as_planes_do() {
    let corners = [
        [-3.0, 5.0],
        [70.0, 15.0],
        [-3.0, 30.0],
        [43.0, 42.0],
        [-3.0, 55.0],
        [18.0, 67.0],
        [-3.0, 78.0],
    ];
    let draw = Draw {
        pairs: 20_000,
        ..Draw::default()
    };
    let (mut of_legs, mut of_planes) = (0.0, 0.0);
    for name in [
        "gold-paint",
        "nickel",
        "blue-rubber",
        "pink-fabric",
        "alum-bronze",
        "yellow-phenolic",
    ] {
        let brdf = fitted(name);
        let legs: Vec<Vec<Observation>> = corners
            .windows(2)
            .map(|ends| leg(&brdf, [ends[0][0], ends[1][0]], [ends[0][1], ends[1][1]], 120))
            .collect();
        let model = Planes::from_observations(&legs, &[]).unwrap();
        let planes: Vec<_> = [10.0, 45.0, 75.0]
            .iter()
            .map(|&deg| plane(&brdf, deg, 60))
            .collect();
        let beside = Planes::from_observations(&planes, &[]).unwrap();
        let male = |model: &dyn Brdf| compare(&brdf, &[model], &draw)[0].overall.male.unwrap();
        let (legs_male, planes_male) = (male(&model), male(&beside));
        println!("{name}: legs {legs_male:.5}, planes {planes_male:.5}");
        of_legs += legs_male;
        of_planes += planes_male;
        for o in legs.iter().flat_map(|leg| leg.iter().step_by(7)) {
            let (incident, exitant) = o.pdv().directions().unwrap();
            let found = model.exact(incident, exitant);
            // Readings that lie densely are averaged.
            let off = (found / o.rgb - 1.0).abs().max_element();
            assert!(off < 0.05, "{name}: {found} beside {} that was read", o.rgb);
        }
    }
    assert!(
        of_legs < of_planes,
        "mean MALE {of_legs} of legs, {of_planes} of planes"
    );
}

#[test]
fn says_what_it_has_not_measured() {
    let model = model(&fitted("gold-paint"), &[30.0], 30, 30);
    let extrapolated = |theta_i: f64, theta_o: f64, phi: f64| {
        let (incident, exitant) = pair(theta_i, theta_o, phi);
        model.extrapolated(incident, exitant)
    };
    assert!(!extrapolated(0.5, 0.9, 2.0) && !extrapolated(1.4, 1.4, PI));
    assert!(extrapolated(1.5, 1.5, PI), "beyond the arc");
    assert!(
        extrapolated(1.3, 1.3, 0.1),
        "beyond the largest half angle of the plane"
    );
    assert!(extrapolated(0.3, 0.31, 0.0), "where the arms hide each other");
}

#[test]
fn what_lies_beyond_the_readings_or_in_a_gap_between_them_is_extrapolated() {
    let gold = fitted("gold-paint");
    let planes: Vec<_> = [20.0, 60.0].map(|deg| plane(&gold, deg, 30)).into();
    let along = arc(&gold, 30, 0.0);
    let models: [Box<dyn Model>; 2] = [
        Box::new(Planes::from_observations(&planes, &along).unwrap()),
        Box::new(Bivariate::from_observations(&planes, &along).unwrap()),
    ];
    for model in models {
        let basis = |theta_i: f64, theta_o: f64, phi: f64| {
            let (incident, exitant) = pair(theta_i, theta_o, phi);
            model.basis(incident, exitant)
        };
        assert_eq!(basis(0.5, 0.9, 2.0), Basis::Interpolated, "{}", model.about());
        assert_eq!(basis(0.5, 0.51, 0.0), Basis::Extrapolated, "{}", model.about());
        assert_eq!(basis(1.5, 1.5, PI), Basis::Extrapolated, "{}", model.about());
    }
}

/// What depends on half and difference angle alone is the bivariate table's own.
#[test]
fn a_bivariate_material_is_bivariate() {
    struct Bump;
    impl Brdf for Bump {
        fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
            let half = (incident + exitant).normalize();
            let (tan, cos_d) = (half.x.hypot(half.y) / half.z, half.dot(incident));
            DVec3::new(1.0, 0.5, 0.2) * (3.0 * (-tan * tan / 0.1).exp() + 0.2 + (1.0 - cos_d).powi(5))
        }
    }
    let planes: Vec<_> = [10.0, 30.0, 50.0, 70.0].map(|deg| plane(&Bump, deg, 60)).into();
    let model = Bivariate::from_observations(&planes, &arc(&Bump, 60, 0.0)).unwrap();
    for (theta_i, theta_o, phi) in [(0.3, 0.6, 2.0), (0.9, 0.4, 1.0), (1.0, 1.1, 3.0), (0.7, 0.7, 1.6)] {
        let (incident, exitant) = pair(theta_i, theta_o, phi);
        let (found, truth) = (model.eval(incident, exitant), Bump.eval(incident, exitant));
        assert!(
            off(found, truth) < 0.03,
            "{found} instead of {truth} at {theta_i}, {theta_o}, {phi}"
        );
        assert_eq!(found, model.eval(exitant, incident));
    }
}

#[test]
fn auto_keeps_to_planes_and_says_why() {
    let gold = fitted("gold-paint");
    let planes: Vec<_> = [20.0, 45.0, 70.0].map(|deg| plane(&gold, deg, 14)).into();
    let model = Auto::from_observations(&planes, &arc(&gold, 6, 0.0)).unwrap();
    assert_eq!(model.chosen(), "planes");
    let error = |name: &str| {
        let found = model.errors().iter().find(|(candidate, _)| *candidate == name);
        found.and_then(|(_, error)| *error).expect("it was tried")
    };
    assert!(error("planes") < error("bivariate") && error("planes") < error("separable"));
    let about = model.about();
    assert!(
        about.contains("half of its error") && about.contains("separable 0."),
        "{about}"
    );
    // With one side of one plane there is nothing to leave out.
    let one: Vec<_> = plane(&gold, 30.0, 20)
        .into_iter()
        .filter(|o| o.deviation >= 0.0)
        .collect();
    let model = Auto::from_observations(&[one], &arc(&gold, 6, 0.0)).unwrap();
    assert_eq!((model.chosen(), model.errors()[0].1), ("planes", None));
}

/// The margin was chosen on the materials of one half of the families, of which the name's first word tells; these are the
/// others.
#[test]
fn auto_is_never_worse_than_planes() {
    let family = |name: &str| {
        name.bytes()
            .take_while(u8::is_ascii_alphabetic)
            .map(u64::from)
            .sum::<u64>()
    };
    let held_out = Fitted::all().filter(|(name, _)| family(name) % 2 == 1);
    for (n, (name, material)) in held_out.step_by(3).enumerate() {
        let (at, readings): (&[f64], _) =
            [(&[30.0][..], 30), (&[15.0, 60.0], 21), (&[20.0, 45.0, 70.0], 14)][n % 3];
        let planes: Vec<_> = at.iter().map(|&deg| plane(&material, deg, readings)).collect();
        let along = arc(&material, 6, 0.0);
        let auto = Auto::from_observations(&planes, &along).unwrap();
        if at.len() == 1 {
            assert_eq!(auto.chosen(), "planes", "{name}");
            continue;
        }
        let own = Planes::from_observations(&planes, &along).unwrap();
        let draw = Draw {
            pairs: 3000,
            ..Draw::default()
        };
        let [auto_male, male] =
            [0, 1].map(|n| compare(&material, &[&auto, &own], &draw)[n].overall.male.unwrap());
        // A twentieth, for models that are as good as equal.
        assert!(
            auto_male <= 1.05 * male,
            "{name}: {} is {auto_male} off, planes {male}",
            auto.chosen()
        );
    }
}

#[test]
fn its_factors_are_tables() {
    let tables = model(&fitted("gold-paint"), &[30.0, 60.0], 30, 20).factors();
    let names: Vec<_> = tables.iter().map(|t| (t.name, t.variable)).collect();
    assert_eq!(names[0], ("F", "theta_d_deg"));
    assert_eq!(names[1..], [("G", "theta_h_deg"); 4], "two sides of two planes");
    assert_eq!(tables[0].rows.len(), 20);
    for table in &tables[1..] {
        assert_eq!(table.rows[0].0, 0.0);
        assert!(
            (table.rows[0].1 - DVec3::ONE).abs().max_element() < 1e-2,
            "{:?}",
            table.rows[0]
        );
        assert!(table.rows.windows(2).all(|w| w[0].0 < w[1].0));
    }
}

fn direction() -> impl Strategy<Value = DVec3> {
    (0.0..=FRAC_PI_2, -PI..PI).prop_map(|(theta, phi)| Spherical { theta, phi }.direction())
}

/// Readings as no rig would take them.
fn sweep(theta_r: f64) -> impl Strategy<Value = Vec<Observation>> {
    let channel = || {
        prop_oneof![
            Just(0.0),
            -1e-3..1e-3_f64,
            (-12.0..7.0_f64).prop_map(|log| 10_f64.powf(log)),
            Just(f64::NAN),
        ]
    };
    let reading =
        (-1.0..2.0_f64, channel(), channel(), channel()).prop_map(move |(deviation, r, g, b)| Observation {
            theta_r,
            deviation,
            rgb: DVec3::new(r, g, b),
        });
    prop::collection::vec(reading, 0..9)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn prop_is_finite_and_bounded_whatever_was_read(
        planes in (sweep(0.0), sweep(0.6), sweep(1.5)),
        along in prop::collection::vec((0.0..1.57_f64, -12.0..7.0_f64), 0..6),
        pairs in prop::collection::vec((direction(), direction()), 50),
    ) {
        let along: Vec<_> = along
            .into_iter()
            .map(|(theta_r, log)| Observation { theta_r, deviation: 0.0, rgb: DVec3::splat(10_f64.powf(log)) })
            .collect();
        let Ok(model) = Planes::from_observations(&[planes.0.clone(), planes.1.clone(), planes.2.clone()], &along) else {
            return Err(TestCaseError::reject("nothing to make a model of"));
        };
        // Twice what was read in the channel. How far readings lie below 0 says from where on anything is told from black,
        // and a lobe is never fainter; the tables are in f32.
        let sweeps = [&planes.0, &planes.1, &planes.2, &along];
        let finite = sweeps.into_iter().flatten().filter(|o| o.rgb.is_finite());
        let brightest = finite.fold(DVec3::splat(1e-9), |most, o| most.max(o.rgb.abs()));
        let most = 2.00002 * brightest;
        let bivariate = Bivariate::from_observations(&[planes.0.clone(), planes.1.clone(), planes.2.clone()], &along)
            .expect("it needs no more");
        let grazing = |x: f64| DVec3::new(x, 0.0, 1e-200);
        let degenerate = [(DVec3::Z, DVec3::Z), (DVec3::X, DVec3::NEG_X), (grazing(1.0), grazing(-1.0))];
        for (incident, exitant) in pairs.into_iter().chain(degenerate) {
            let f = model.eval(incident, exitant);
            for f in [f, bivariate.eval(incident, exitant), model.exact(incident, exitant)] {
                prop_assert!(f.is_finite() && f.min_element() >= 0.0, "{} at {}, {}", f, incident, exitant);
                prop_assert!(f.cmple(most).all(), "{}, at most {}, at {}, {}", f, most, incident, exitant);
            }
        }
    }

    #[test]
    fn prop_light_and_viewer_may_be_swapped(
        material in 0_usize..100,
        pairs in prop::collection::vec((direction(), direction()), 50),
    ) {
        let (name, fitted) = Fitted::all().nth(material).expect("there are 100");
        let model = model(&fitted, &[20.0, 45.0, 70.0], 12, 12);
        for (incident, exitant) in pairs {
            prop_assert_eq!(model.eval(incident, exitant), model.eval(exitant, incident), "{}", name);
        }
    }
}
