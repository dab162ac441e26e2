use arms::Pose;

use crate::Mechanics;
use crate::route::{Standing, route};

/// Stands for a way that does not exist: dearer than any real one, and still comparable.
const NO_WAY_S: f64 = 1e6;

/// Order and direction of the sweeps with the least time of motion: pairs of a sweep's index and whether it is run
/// backwards. `returns` says which of them go back to where they began.
///
/// Exact: every sequence is covered by the recursion of Held and Karp (1962) over sets of finished sweeps, so time
/// and memory grow like 2ⁿ; n ≤ 13 here.
pub(crate) fn order(
    mechanics: &Mechanics,
    start: Option<Standing>,
    sweeps: &[Vec<Pose>],
    returns: &[bool],
) -> Vec<(usize, bool)> {
    let n = sweeps.len();
    let run = |node: usize| Run {
        poses: &sweeps[node / 2],
        backwards: node % 2 == 1,
        returns: returns[node / 2],
    };
    let within: Vec<f64> = (0..2 * n).map(|node| run(node).seconds(mechanics)).collect();
    let between = |from: usize, to: usize| {
        let from = Standing {
            pose: run(from).last(),
            approached: true,
        };
        way_s(mechanics, from, run(to).first())
    };
    let between: Vec<Vec<f64>> = (0..2 * n)
        .map(|from| (0..2 * n).map(|to| between(from, to)).collect())
        .collect();

    // Per set of finished sweeps and last one: least seconds, and the one before.
    let mut best = vec![vec![(f64::INFINITY, usize::MAX); 2 * n]; 1 << n];
    for node in 0..2 * n {
        let to_first = start.map_or(0.0, |start| way_s(mechanics, start, run(node).first()));
        best[1 << (node / 2)][node] = (to_first + within[node], usize::MAX);
    }
    for done in 1..1_usize << n {
        for last in (0..2 * n).filter(|last| done >> (last / 2) & 1 == 1) {
            for next in (0..2 * n).filter(|next| done >> (next / 2) & 1 == 0) {
                let seconds = best[done][last].0 + between[last][next] + within[next];
                let entry = &mut best[done | 1 << (next / 2)][next];
                if seconds < entry.0 {
                    *entry = (seconds, last);
                }
            }
        }
    }

    let mut done = (1 << n) - 1;
    let mut last = (0..2 * n).min_by(|&a, &b| best[done][a].0.total_cmp(&best[done][b].0));
    let mut order = Vec::with_capacity(n);
    while let Some(node) = last {
        order.push((node / 2, node % 2 == 1));
        let before = best[done][node].1;
        done &= !(1 << (node / 2));
        last = (before != usize::MAX).then_some(before);
    }
    order.reverse();
    order
}

fn way_s(mechanics: &Mechanics, from: Standing, to: Pose) -> f64 {
    route(mechanics, from, to).map_or(NO_WAY_S, |route| route.seconds)
}

/// A sweep in one of its two directions; its poses are not empty.
struct Run<'a> {
    poses: &'a [Pose],
    backwards: bool,
    returns: bool,
}

impl Run<'_> {
    fn at(&self, i: usize) -> Pose {
        self.poses[if self.backwards {
            self.poses.len() - 1 - i
        } else {
            i
        }]
    }

    fn first(&self) -> Pose {
        self.at(0)
    }

    fn last(&self) -> Pose {
        match self.returns {
            true => self.first(),
            false => self.at(self.poses.len() - 1),
        }
    }

    fn seconds(&self, mechanics: &Mechanics) -> f64 {
        (1..self.poses.len())
            .map(|i| {
                way_s(
                    mechanics,
                    Standing {
                        pose: self.at(i - 1),
                        approached: true,
                    },
                    self.at(i),
                )
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use arms::{ArmAngle, Envelope, Limits, Profile};
    use proptest::prelude::*;

    use super::*;

    fn mechanics(approach: i8) -> Mechanics {
        let limits = Limits {
            min: ArmAngle::from_deg(-88.0),
            max: ArmAngle::from_deg(88.0),
        };
        let profile = Profile {
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 3.5,
        };
        Mechanics {
            envelope: Envelope {
                light: limits,
                sensor: limits,
                separation_rad: 0.1,
                can_pass: false,
            },
            margin_rad: 0.0,
            tolerance_rad: 0.0,
            profiles: [profile; 2],
            resolution_rad: [TAU / 4096.0; 2],
            grid_rad: [0.0; 2],
            approach,
            overshoot_rad: 0.02,
            settle_s: 0.0,
            late_s: 0.0,
            integration_us: [100, 1000],
            exposures: 9,
            transaction_s: 0.0,
            in_flight: true,
            flight_s: 0.0,
            warm_up_s: 0.0,
            dark_every_s: 0.0,
            reference: None,
            start: None,
        }
    }

    fn poses() -> impl Strategy<Value = Pose> {
        (-80.0..-5.0_f64, 5.0..80.0_f64).prop_map(|(light, sensor)| Pose::from_deg(light, sensor))
    }

    fn seconds(mechanics: &Mechanics, start: Standing, sweeps: &[Vec<Pose>], order: &[(usize, bool)]) -> f64 {
        let mut at = start;
        let mut total = 0.0;
        for &(sweep, backwards) in order {
            let mut poses = sweeps[sweep].clone();
            if backwards {
                poses.reverse();
            }
            for pose in poses {
                total += way_s(mechanics, at, pose);
                at = Standing {
                    pose,
                    approached: true,
                };
            }
        }
        total
    }

    fn all_orders() -> Vec<Vec<(usize, bool)>> {
        let sequences = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let directions = |bits: usize| move |i: usize| bits >> i & 1 == 1;
        sequences
            .into_iter()
            .flat_map(|sequence| (0..8).map(move |bits| sequence.map(|i| (i, directions(bits)(i))).to_vec()))
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn prop_no_other_order_takes_less_time(
            start in poses(),
            sweeps in prop::collection::vec(prop::collection::vec(poses(), 1..4), 3),
            approach in -1_i8..=1,
        ) {
            let mechanics = mechanics(approach);
            let start = Standing { pose: start, approached: false };
            let found = seconds(&mechanics, start, &sweeps, &order(&mechanics, Some(start), &sweeps, &[false; 3]));
            let best = all_orders().iter().map(|order| seconds(&mechanics, start, &sweeps, order)).fold(f64::INFINITY, f64::min);
            prop_assert!((found - best).abs() < 1e-9, "{found} s, possible are {best} s");
        }
    }
}
