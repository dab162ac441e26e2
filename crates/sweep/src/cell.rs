use arms::{Arm, Envelope, Pose};

/// For each pose of a pass, the stretch of the lead arm's way from the first pose, rad, in which its light is collected:
/// half-way to its neighbours, and no further to either side than the arms stay clear of each other's shadow.
///
/// Light is collected evenly about the pose, so that what keeps clear on one side must keep clear on the other too.
/// `margin_rad` is how much further apart than the separation the arms must stay. A cell is empty where they do not at
/// the pose itself.
pub fn cells(poses: &[Pose], lead: Arm, envelope: &Envelope, margin_rad: f64) -> Vec<[f64; 2]> {
    let (Some(first), Some(last)) = (poses.first(), poses.last()) else {
        return Vec::new();
    };
    let moves = |&arm: &Arm| last.angle(arm) != first.angle(arm);
    // Each moving arm takes as much of the clearance as the lead.
    let moving = Arm::BOTH.iter().filter(|arm| moves(arm)).count().max(1) as f64;
    let along: Vec<f64> = poses
        .iter()
        .map(|pose| (pose.angle(lead) - first.angle(lead)).abs())
        .collect();
    let half =
        |i: usize, j: Option<usize>| j.and_then(|j| along.get(j)).map(|to| (to - along[i]).abs() / 2.0);
    let cell = |i: usize| {
        let (before, after) = (half(i, i.checked_sub(1)), half(i, Some(i + 1)));
        let outermost = before.or(after).unwrap_or(0.0);
        let clear = (envelope.clearance_rad(poses[i], [0.0; 2]) - margin_rad).max(0.0) / moving;
        [
            along[i] - before.unwrap_or(outermost).min(clear),
            along[i] + after.unwrap_or(outermost).min(clear),
        ]
    };
    (0..poses.len()).map(cell).collect()
}
