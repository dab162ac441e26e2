//! Whether what is stated of readings and of the reconstruction holds where lobes are sharp and readings few.

use std::sync::Arc;

use brdf::{Brdf, MerlTable};
use glam::DVec3;
use pdv::metric::quantile;
use report::{Measurement, ModelUncertainty, MonteCarlo, Sweeps, measurements};
use sweep::{Job, Sweep};

use crate::bench::{FINE_SERVOS, Laboratory};

const THREE_PLANES: &str = include_str!("../../../../config/jobs/three-planes.toml");
/// Arms that pass each other, so that nothing hides the peaks at small angles.
const CAN_PASS: &str = "[envelope]\ncan_pass = true\n[uncertainty]\nplay_deg = 0.02\n[sim]\n";

/// A capture of the three planes with its readings that count.
struct Captured {
    laboratory: Laboratory,
    records: Vec<capture::Record>,
    specimen: Arc<dyn Brdf>,
    all: Vec<Measurement>,
}

impl Captured {
    async fn new(rig: &str, name: &str) -> Self {
        let specimen = brdf::specimen(name).expect("a known specimen");
        let laboratory = Laboratory::new(rig);
        let records = laboratory.measure(specimen.clone(), THREE_PLANES).await;
        let all = measurements(&records, &laboratory.file);
        Self {
            laboratory,
            records,
            specimen,
            all,
        }
    }

    fn counting(&self) -> impl Iterator<Item = (&Measurement, DVec3, DVec3)> {
        let counts = |m: &&Measurement| {
            m.reading.accepted && !m.shadowed && matches!(m.reading.sweep, Sweep::Plane(_) | Sweep::Arc)
        };
        self.all
            .iter()
            .filter(counts)
            .filter_map(|m| Some((m, m.rgb()?, m.u?)))
    }

    /// What is reconstructed, its uncertainty and the truth, at entries all over a MERL table below 80°.
    fn entries(&self) -> Vec<[f64; 3]> {
        let job = Job::parse(THREE_PLANES, "job.toml").expect("a good job");
        let sweeps = Sweeps::new(&job, &self.all);
        let model = sweeps.model(&job).expect("planes and an arc make a model");
        let draws = MonteCarlo::new(&job, &self.all, &self.records, &self.laboratory.file);
        let uncertainty = ModelUncertainty::new(model.as_ref(), &sweeps, &draws);
        let [_, rows, columns] = MerlTable::SHAPE;
        let pairs = (0..MerlTable::NODES).step_by(487).map(|at| {
            MerlTable::coordinates([at / columns / rows, at / columns % rows, at % columns]).directions()
        });
        let below = pairs.filter(|(i, o)| i.z.min(o.z) > 80_f64.to_radians().cos());
        below
            .flat_map(|(i, o)| {
                let [f, u, truth] = [model.eval(i, o), uncertainty.eval(i, o), self.specimen.eval(i, o)]
                    .map(|rgb| rgb.to_array());
                [0, 1, 2].map(|c| [f[c], u[c], truth[c]])
            })
            .collect()
    }
}

/// Chrome was stated to half a million times itself: a slope from neighbours many widths of its lobe away, and draws below 0.
#[tokio::test(start_paused = true)]
async fn the_table_of_uncertainties_is_of_use_and_holds_the_truth() {
    for (name, largest_median) in [("chrome", 1.0), ("gold-paint", 0.4), ("blue-rubber", 0.3)] {
        let entries = Captured::new(&format!("[sim]\n{FINE_SERVOS}"), name)
            .await
            .entries();
        let stated: Vec<_> = entries.iter().filter(|[_, u, _]| *u >= 0.0).collect();
        for [f, u, _] in &stated {
            assert!(
                u.is_finite() && *u <= 10.0 * f * (1.0 + 1e-9),
                "{name}: {f} ± {u}"
            );
        }
        let inside = stated
            .iter()
            .filter(|[f, u, truth]| (f - truth).abs() <= *u)
            .count();
        let held = inside as f64 / stated.len() as f64;
        let mut relative: Vec<f64> = stated.iter().map(|[f, u, _]| u / f).collect();
        let median = quantile(&mut relative, 0.5).expect("there are entries");
        let flagged = 1.0 - stated.len() as f64 / entries.len() as f64;
        println!("{name}: {held:.3} hold the truth, median u/f {median:.3}, {flagged:.3} flagged");
        assert!(held > 0.9, "{name}: {held}");
        assert!(median < largest_median, "{name}: {median}");
        assert!(flagged < 0.1, "{name}: {flagged}");
    }
}

/// Nickel was 2.9 of its uncertainties off on the arc, and chrome 28 % low where 1 % was stated.
#[tokio::test(start_paused = true)]
async fn what_the_apertures_take_from_a_sharp_peak_is_within_what_is_stated() {
    for name in ["nickel", "chrome", "chrome-steel", "brass"] {
        let captured = Captured::new(&format!("{CAN_PASS}{FINE_SERVOS}"), name).await;
        let peaks = captured
            .counting()
            .filter(|(m, ..)| m.deviation.abs() < 1e-3 && m.theta_r < 1.3);
        let mut read = 0;
        for (m, f, u) in peaks {
            let truth = captured.specimen.eval(m.pose.incident(), m.pose.exitant());
            let off = ((f - truth) / u).abs().max_element();
            println!(
                "{name}, {} at {:.1}°: {off:.2} u",
                m.reading.sweep,
                m.theta_r.to_degrees()
            );
            assert!(
                off <= 1.0,
                "{name} at {:.1}°: {off} u, {f} ± {u}",
                m.theta_r.to_degrees()
            );
            read += 1;
        }
        assert!(read >= 7, "{name}: the peaks were not read");
    }
}

/// One reading was stated as 0.25 ± 228: between two readings no lobe passes either.
#[tokio::test(start_paused = true)]
async fn no_reading_that_sees_light_is_stated_to_many_times_itself() {
    for name in ["chrome", "steel", "mirror:0.9", "black-obsidian", "gold-paint"] {
        let captured = Captured::new(&format!("{CAN_PASS}{FINE_SERVOS}"), name).await;
        let brightest = captured
            .counting()
            .fold(DVec3::ZERO, |most, (_, f, _)| most.max(f));
        for (m, f, u) in captured.counting() {
            for c in 0..3 {
                // What one reading in ten million of the peak is lost in noise.
                let dark = 1e-7 * brightest[c] + 1e-3;
                assert!(
                    // The apertures hide up to 11.9 times what is read, and what the angles may be off comes to that.
                    u[c] <= 14.0 * f[c].abs() + dark,
                    "{name} at {:?}: {} ± {}",
                    m.pose,
                    f[c],
                    u[c]
                );
            }
        }
    }
}
