use std::ops::Range;

use arms::{Arm, Pose};
use pdv::{Reads, Scene};

use crate::targets::Targets;
use crate::{Job, LeftOut, Model, Plan, Step, Sweep};

/// What the scene does not need, in words.
const WHY: &str = "no value that the scene asks for is made of it";

/// Takes out of the sweeps what no value in the scene is made of, and says so with the seconds that `whole`, the plan
/// with everything, needs for it.
pub(crate) fn cut(job: &Job, scene: &Scene, sweeps: &mut [Targets], whole: &Plan) {
    let Some(reads) = reads(job.model, scene, sweeps) else {
        return;
    };
    let mut planes = reads.planes.into_iter();
    for sweep in sweeps {
        let read = match sweep.sweep {
            Sweep::Arc => reads.arc.clone(),
            _ => planes.next().unwrap_or_default(),
        };
        keep(sweep, &read, whole);
    }
}

/// Takes out of what is to be added to a plan what no value in the scene would be made of.
pub(crate) fn cut_added(job: &Job, scene: &Scene, plan: &Plan, added: &mut Targets) {
    let planned = |sweep: Sweep| {
        let steps = plan.steps.iter().filter(|step| step.sweep == sweep);
        let mut poses: Vec<Pose> = steps.map(Step::pose).collect();
        if sweep == added.sweep {
            poses.extend(&added.poses);
        }
        Targets {
            sweep,
            poses,
            left_out: Vec::new(),
        }
    };
    // An added plane is the next one.
    let sweeps = (0..=job.planes.len()).map(Sweep::Plane).chain([Sweep::Arc]);
    let sweeps: Vec<Targets> = sweeps
        .map(planned)
        .filter(|sweep| !sweep.poses.is_empty())
        .collect();
    let Some(reads) = reads(job.model, scene, &sweeps) else {
        return;
    };
    let planes = sweeps
        .iter()
        .filter(|sweep| sweep.sweep != Sweep::Arc)
        .zip(&reads.planes);
    let arc = sweeps
        .iter()
        .filter(|sweep| sweep.sweep == Sweep::Arc)
        .zip([&reads.arc]);
    let read = planes.chain(arc).find(|(sweep, _)| sweep.sweep == added.sweep);
    let Some((sweep, read)) = read else { return };
    // Its own come last.
    let before = sweep.poses.len() - added.poses.len();
    let mut index = before..;
    added
        .poses
        .retain(|_| index.next().and_then(|i| read.get(i)) == Some(&true));
}

/// The channels that nobody looks at; the photometer reads all at once, so that it costs nothing to read them.
pub(crate) fn channels(scene: &Scene) -> impl Iterator<Item = LeftOut> {
    let named = ["red", "green", "blue"].into_iter().zip(scene.channels);
    named.filter(|(_, wanted)| !wanted).map(|(name, _)| LeftOut {
        what: format!("channel {name}"),
        why: "the scene does not ask for it; it is read with the others and left out of the result"
            .to_owned(),
        readings: 0,
        seconds: 0.0,
    })
}

/// What is read of each sweep, planes in their order; `None` where the job is too small to tell.
fn reads(model: Model, scene: &Scene, sweeps: &[Targets]) -> Option<Reads> {
    let place = |pose: &Pose| (pose.sensor.rad(), pose.deviation());
    let of = |sweep: &Targets| -> Vec<(f64, f64)> { sweep.poses.iter().map(place).collect() };
    let (arc, planes): (Vec<&Targets>, Vec<&Targets>) =
        sweeps.iter().partition(|sweep| sweep.sweep == Sweep::Arc);
    let arc = arc.first().map(|arc| of(arc)).unwrap_or_default();
    let mut planes: Vec<Vec<(f64, f64)>> = planes.into_iter().map(of).collect();
    let count = planes.len();
    let product = |planes: &[Vec<(f64, f64)>]| Some(scene.reads_of_product(planes.first()?, &arc));
    if model.of_one_plane() {
        planes.truncate(1);
    }
    let lobe = |planes: &[Vec<(f64, f64)>]| scene.reads_of_lobe(planes, &arc).ok();
    let table = |planes: &[Vec<(f64, f64)>]| scene.reads_of_table(planes, &arc).ok();
    let mut reads: Reads = match model {
        Model::Separable => product(&planes)?,
        Model::Reciprocal | Model::Planes => lobe(&planes)?,
        Model::Bivariate => table(&planes)?,
        Model::Auto => lobe(&planes)?.or(&table(&planes)?).or(&product(&planes)?),
    };
    reads.planes.resize(count, Vec::new());
    Some(reads)
}

/// Leaves of a sweep what is read.
fn keep(sweep: &mut Targets, read: &[bool], whole: &Plan) {
    let is_read = |i: &usize| read.get(*i).copied().unwrap_or(false);
    let seconds = |poses: &[Pose]| -> f64 {
        let of_sweep = whole.steps.iter().filter(|step| step.sweep == sweep.sweep);
        of_sweep
            .filter(|step| poses.contains(&step.pose()))
            .map(|step| step.seconds)
            .sum()
    };
    let indices: Vec<usize> = (0..sweep.poses.len()).collect();
    let unread = indices
        .chunk_by(|a, b| is_read(a) == is_read(b))
        .filter(|chunk| !is_read(&chunk[0]));
    let left_out: Vec<LeftOut> = unread
        .map(|chunk| {
            let poses = &sweep.poses[Range {
                start: chunk[0],
                end: chunk[0] + chunk.len(),
            }];
            LeftOut {
                what: stretch(sweep.sweep, poses),
                why: WHY.to_owned(),
                readings: poses.len(),
                seconds: seconds(poses),
            }
        })
        .collect();
    sweep.left_out.extend(left_out);
    let mut index = 0..;
    sweep.poses.retain(|_| index.next().is_some_and(|i| is_read(&i)));
}

/// Poses of a sweep in words.
fn stretch(sweep: Sweep, poses: &[Pose]) -> String {
    let (arm, name) = match sweep {
        Sweep::Arc => (Arm::Sensor, "arc".to_owned()),
        Sweep::Leg(_) => (Arm::Sensor, sweep.to_string()),
        _ => (Arm::Light, format!("plane {:.1}°", poses[0].sensor.deg())),
    };
    let [first, last] = [poses[0], poses[poses.len() - 1]].map(|pose| pose.angle(arm).deg());
    format!("{name}, {arm} {first:.1}° … {last:.1}°")
}
