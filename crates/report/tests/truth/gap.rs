//! Readings beside the poses at which one arm shadows the other.

use capture::{Flag, Record};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use report::measurements;

use crate::bench::Laboratory;

/// Every reading that counts is clear of the shadow over its whole integration, wherever the zeros may be, and is true.
async fn nothing_that_counts_is_in_shadow(rig: &str, job: &str, specimen: &str) {
    let specimen = brdf::specimen(specimen).expect("known");
    let laboratory = Laboratory::new(rig);
    let records = laboratory.measure(specimen.clone(), job).await;
    let margin = laboratory.file.uncertainty.shadow_margin_rad();
    let mut beside = 0;
    for m in measurements(&records, &laboratory.file) {
        if !m.reading.lamp || !m.reading.accepted {
            continue;
        }
        let swept = m.reading.swept_rad.unwrap_or_default();
        let clearance = laboratory.file.envelope.clearance_rad(m.pose, swept);
        assert!(
            clearance >= margin && !m.shadowed && !m.reading.flags.contains(&Flag::Shadowed),
            "{rig}{job}: {:.3}° clear at {:?}, swept {swept:?}",
            clearance.to_degrees(),
            m.pose
        );
        let Some(f) = m.rgb() else { continue };
        if clearance < 5f64.to_radians() {
            beside += 1;
            let truth = specimen.eval(m.pose.incident(), m.pose.exitant());
            // Where it is so dark that nobody feels the noise, a reading in flight may have more of it, and says so.
            let allowed = (0.08 * truth).max(1.5 * m.u.unwrap_or_default());
            assert!(
                (f - truth).abs().cmple(allowed).all(),
                "{rig}{job}: {f} instead of {truth} at {:?}",
                m.pose
            );
        }
    }
    assert!(beside > 0, "nothing was read beside the shadow: {rig}{job}");
}

#[tokio::test(start_paused = true)]
async fn a_flight_past_the_shadow_counts_nothing_of_it() {
    let job = "[sweep]\nmode = \"fly\"\n[[plane]]\ntheta_r_deg = 45\nreadings = 90\n[arc]\nreadings = 30";
    nothing_that_counts_is_in_shadow("[envelope]\ncan_pass = true\n", job, "nickel").await;
}

#[tokio::test(start_paused = true)]
async fn whatever_the_envelope_nothing_that_counts_is_in_shadow() {
    let mut random = ChaCha8Rng::seed_from_u64(39);
    for _ in 0..8 {
        let (separation, theta) = (random.random_range(1.0..12.0), random.random_range(20.0..60.0));
        let (zero, can_pass) = (random.random_range(0.0..0.1), random.random_bool(0.7));
        let mode = if random.random_bool(0.7) { "fly" } else { "step" };
        let rig = format!(
            "[envelope]\ncan_pass = {can_pass}\nseparation_deg = {separation}\n[uncertainty]\nzero_deg = {zero}\n[sim]\n\
             light_zero_deg = {}\nsensor_zero_deg = {}\n",
            zero * random.random_range(-1.0..1.0),
            zero * random.random_range(-1.0..1.0),
        );
        let job = format!(
            "[sweep]\nmode = \"{mode}\"\n[[plane]]\ntheta_r_deg = {theta}\nreadings = 40\ndistribution = \"uniform\"\n\
             [arc]\nreadings = 20"
        );
        nothing_that_counts_is_in_shadow(&rig, &job, "nickel").await;
    }
}

#[tokio::test(start_paused = true)]
async fn every_pose_of_a_plan_beside_the_shadow_gets_its_reading() {
    let job =
        "[sweep]\nmode = \"fly\"\n[[plane]]\ntheta_r_deg = 45\nreadings = 60\ndistribution = \"uniform\"";
    let laboratory = Laboratory::new("[envelope]\ncan_pass = true\n");
    let specimen = brdf::specimen("nickel").expect("known");
    let records = laboratory.measure(specimen, job).await;
    let Some(Record::Header(header)) = records.first() else {
        panic!("a journal begins with its header");
    };
    let all = measurements(&records, &laboratory.file);
    for step in header.plan.steps.iter().filter(|step| step.lamp) {
        let at =
            |m: &&report::Measurement| m.reading.goal == step.pose() && m.reading.accepted && !m.shadowed;
        assert!(all.iter().any(|m| at(&m)), "nothing counts at {:?}", step.pose());
    }
}
