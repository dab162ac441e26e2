use glam::DVec3;
use pdv::{Model, Scene, albedo};
use serde_json::json;

use super::COLOURS;
use crate::{Check, Verdict};

/// Directions of the viewer at which the albedo is looked at, degrees: as far as the table goes.
const ALBEDO_DEG: [f64; 7] = [0.0, 30.0, 60.0, 75.0, 80.0, 85.0, 89.0];
/// The specimen gives off more light than it gets above this; much more, above the second, which no error of the scale
/// explains any more.
const MOST: [f64; 2] = [1.0, 2.0];
/// Less than this no specimen reflects: the blackest coatings have 0.0004.
const LEAST: f64 = 1e-5;

/// Nothing reflects more than it receives, and nothing reflects nothing: the directional albedo in the directions of
/// the viewer that the job asks for, over so many azimuths about the mirror direction; 1 is enough for a model that is
/// constant along them.
pub(crate) fn energy(model: &dyn Model, scene: Option<&Scene>, azimuths: usize) -> Check {
    let whole = Scene::whole();
    let scene = scene.unwrap_or(&whole);
    let albedos: Vec<(f64, DVec3)> = ALBEDO_DEG
        .into_iter()
        .filter(|&deg| is_seen(scene, deg.to_radians()))
        .map(|deg| (deg, albedo(model, deg.to_radians(), azimuths)))
        .collect();
    let wanted = (0..3).filter(|&c| scene.channels[c]);
    // NaN is worse than any number.
    let most = |c: usize| {
        let all = albedos.iter().map(move |(deg, a)| (*deg, a[c]));
        all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
    };
    let channels: Vec<(usize, f64, f64)> = wanted.map(|c| (c, most(c).0, most(c).1)).collect();
    let brightest = channels.iter().max_by(|a, b| a.2.total_cmp(&b.2)).copied();
    let (worst_deg, worst) = brightest.map_or((0.0, 0.0), |(_, deg, albedo)| (deg, albedo));
    let black: Vec<&str> = channels
        .iter()
        .filter(|channel| channel.2 < LEAST)
        .map(|channel| COLOURS[channel.0])
        .collect();
    let verdict = match albedos.is_empty() {
        true => Verdict::Unknown,
        false if worst.is_nan() || worst > MOST[1] || !black.is_empty() => Verdict::Bad,
        false if worst > MOST[0] => Verdict::Look,
        false => Verdict::Good,
    };
    let seen: Vec<String> = albedos.iter().map(|(deg, _)| deg.to_string()).collect();
    let mut text = format!(
        "The directional albedo is at most {worst:.3}, at {worst_deg}° (looked at: {}°); above 1 the specimen would give off more light than it gets.",
        seen.join("°, ")
    );
    if !black.is_empty() {
        text += &format!(" In {} it is 0, as of nothing that exists.", black.join(" and "));
    }
    Check {
        name: "energy",
        verdict,
        text,
        values: json!(
            albedos
                .iter()
                .map(|(deg, a)| json!({ "theta_deg": deg, "rgb": a.to_array() }))
                .collect::<Vec<_>>()
        ),
    }
}

/// Whether a scene looks at a zenith angle of the viewer.
fn is_seen(scene: &Scene, theta_o: f64) -> bool {
    scene
        .cells
        .iter()
        .any(|cell| cell.theta_o[0] <= theta_o && theta_o <= cell.theta_o[1])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use brdf::{Brdf, Spherical};
    use pdv::{Basis, FactorTable};

    use super::*;

    /// A model of some reflectance.
    struct Of<F>(F);

    impl<F: Fn(DVec3) -> DVec3 + Send + Sync> Brdf for Of<F> {
        fn eval(&self, _: DVec3, exitant: DVec3) -> DVec3 {
            (self.0)(exitant)
        }
    }

    impl<F: Fn(DVec3) -> DVec3 + Send + Sync> Model for Of<F> {
        fn basis(&self, _: DVec3, _: DVec3) -> Basis {
            Basis::Interpolated
        }
        fn about(&self) -> String {
            "made up".to_owned()
        }
        fn factors(&self) -> Vec<FactorTable> {
            Vec::new()
        }
    }

    fn verdict(albedo: impl Fn(DVec3) -> DVec3 + Send + Sync) -> Verdict {
        energy(&Of(move |exitant| albedo(exitant) / PI), None, 1).verdict
    }

    #[test]
    fn more_light_out_than_in_is_noticed_and_so_is_none_at_all() {
        assert_eq!(verdict(|_| DVec3::splat(0.9)), Verdict::Good);
        assert_eq!(verdict(|_| DVec3::splat(4e-4)), Verdict::Good);
        assert_eq!(verdict(|_| DVec3::splat(1.2)), Verdict::Look);
        assert_eq!(verdict(|_| DVec3::splat(3.0)), Verdict::Bad);
        assert_eq!(verdict(|_| DVec3::ZERO), Verdict::Bad);
        assert_eq!(verdict(|_| DVec3::new(0.5, 0.5, 0.0)), Verdict::Bad, "one colour");
        assert_eq!(verdict(|_| DVec3::NAN), Verdict::Bad);
    }

    #[test]
    fn the_albedo_is_looked_at_as_far_as_the_table_goes() {
        let at_grazing = |exitant: DVec3| {
            let beyond = Spherical::from_direction(exitant).theta > 88.0_f64.to_radians();
            DVec3::splat(if beyond { 1.5 } else { 0.5 })
        };
        assert_eq!(verdict(at_grazing), Verdict::Look);
    }

    #[test]
    fn what_the_scene_does_not_ask_for_is_not_judged() {
        let mut scene = Scene::whole();
        scene.channels = [true, true, false];
        scene.cells[0].theta_o = [0.0, 60.0_f64.to_radians()];
        let model = Of(|exitant: DVec3| {
            let beyond = Spherical::from_direction(exitant).theta > 61.0_f64.to_radians();
            DVec3::new(0.5, if beyond { 9.0 } else { 0.5 }, 0.0) / PI
        });
        assert_eq!(energy(&model, Some(&scene), 1).verdict, Verdict::Good);
        assert_eq!(energy(&model, None, 1).verdict, Verdict::Bad);
    }
}
