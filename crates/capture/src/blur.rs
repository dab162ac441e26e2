use arms::Pose;

/// How far along a flight each of its poses is, rad: the ways of both arms from pose to pose at right angles to each other, so
/// that an arm that stands adds nothing.
pub fn along(poses: impl IntoIterator<Item = Pose>) -> Vec<f64> {
    let mut before: Option<Pose> = None;
    let mut along = 0.0;
    let at = |pose: Pose| {
        if let Some(from) = before.replace(pose) {
            along += (pose.light - from.light).hypot(pose.sensor - from.sensor);
        }
        along
    };
    poses.into_iter().map(at).collect()
}

/// What an integration over a moving arm adds to a value: the mean over a stretch of width w is w²/24 times the second
/// derivative above the value in its middle.
///
/// `points` are angles, ascending or descending, and values; the derivative at `at` is that of the parabola through the
/// point and its neighbours, at the ends through the three outermost. 0 of fewer than three points, and where two are at
/// one angle.
pub fn blur(points: &[(f64, f64)], at: usize, width_rad: f64) -> f64 {
    if points.len() < 3 {
        return 0.0;
    }
    let middle = at.clamp(1, points.len() - 2);
    let [a, b, c] = [points[middle - 1], points[middle], points[middle + 1]];
    let (left, right) = (b.0 - a.0, c.0 - b.0);
    if left * right <= 0.0 {
        return 0.0;
    }
    let bend = 2.0 * ((c.1 - b.1) / right - (b.1 - a.1) / left) / (left + right);
    width_rad * width_rad / 24.0 * bend
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of a lobe over stretches that touch each other, as a slow integration takes them.
    #[test]
    fn a_lobe_that_motion_blurred_is_sharp_again() {
        let width: f64 = 0.3;
        let lobe = |x: f64| (-x * x / 2.0).exp();
        let mean = |x: f64| {
            let at = |i: i32| lobe(x + width * (f64::from(i) / 1000.0 - 0.5));
            (0..=1000).map(at).sum::<f64>() / 1001.0
        };
        let points: Vec<(f64, f64)> = (-8..=8)
            .map(|i| f64::from(i) * width)
            .map(|x| (x, mean(x)))
            .collect();
        let worst = |value: &dyn Fn(usize) -> f64| {
            (1..points.len() - 1)
                .map(|i| (value(i) - lobe(points[i].0)).abs())
                .fold(0.0, f64::max)
        };
        let (blurred, sharp) = (
            worst(&|i| points[i].1),
            worst(&|i| points[i].1 - blur(&points, i, width)),
        );
        println!("off by {blurred:.2e} blurred, {sharp:.2e} corrected");
        assert!(sharp < blurred / 10.0, "{blurred} blurred, {sharp} corrected");
        let backwards: Vec<_> = points.iter().rev().copied().collect();
        assert!((blur(&backwards, 8, width) - blur(&points, 8, width)).abs() < 1e-15);
        assert_eq!(blur(&[(0.0, 1.0), (0.0, 2.0), (1.0, 3.0)], 1, width), 0.0);
    }
}
