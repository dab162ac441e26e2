use arms::{Arm, ArmAngle, Pose, Profile};
use rig::{Axis, Observation, RigFile};
use sweep::Step;

use crate::track::Track;

/// Share of its deceleration that an arm is planned to brake with: it is told to only between two readings.
const BRAKING: f64 = 0.6;
/// Share of its cell that an integration is planned to fill, so that one that begins late holds up no other.
const FILLED: f64 = 0.85;
/// By how much the newest measure counts in the expected time between two integrations.
const NEWEST: f64 = 0.3;
/// How much farther an arm must be allowed to go for it to be told, rad: half a degree.
const STRIDE_RAD: f64 = 0.0087;
/// Arms whose ways differ by less than this share move alike.
const ALIKE: f64 = 0.02;
/// An infinite acceleration in figures, rad/s²: a thousand times what an arm can do.
const ABRUPT: f64 = 1e4;

/// One pass over a stretch of steps, without a stop: where the arms are, and how fast they may go.
///
/// Each step has its cell, half-way to its neighbours and clear of the arms' shadow; its light is collected within. An arm goes as fast as the light
/// that is needed fits into the cells, and no faster than its profile.
#[derive(Clone, Debug)]
pub(crate) struct Flight<'a> {
    pub(crate) steps: &'a [Step],
    /// Step whose reading comes next, by its place in the pass.
    pub(crate) next: usize,
    /// The arms that move, the first one being judged by.
    pub(crate) moving: Vec<Arm>,
    /// The way of each arm as a share of the first one's.
    shares: [f64; 2],
    /// Where the arms were told to go: the end, or as far towards it as was safe.
    pub(crate) goals: Pose,
    /// Where the pass ends, as the servos take it.
    pub(crate) end: Pose,
    tracks: [Track; 2],
    /// Angle of the first step, +1 or −1, and the way from there to each step and its cell's ends, rad.
    from: f64,
    sign: f64,
    along: Vec<f64>,
    edges: Vec<[f64; 2]>,
    axis: Axis,
    /// The fastest profile, and the one that the arms have.
    fastest: Profile,
    pub(crate) profile: Profile,
    /// Expected time between the end of an integration and the next, s.
    idle_s: f64,
}

impl<'a> Flight<'a> {
    /// A pass of at least one step, from rest at the first.
    pub(crate) fn new(steps: &'a [Step], file: &RigFile, idle_s: f64) -> Self {
        let [first, last] = [steps[0].pose(), steps[steps.len() - 1].pose()];
        let way = |arm: Arm| (last.angle(arm) - first.angle(arm)).abs();
        let mut moving: Vec<Arm> = Arm::BOTH.into_iter().filter(|&arm| way(arm) > 0.0).collect();
        moving.sort_by(|&a, &b| way(b).total_cmp(&way(a)));
        let lead = moving.first().copied().unwrap_or(Arm::Light);
        let shares = Arm::BOTH.map(|arm| match way(arm) / way(lead) {
            share if (share - 1.0).abs() < ALIKE => 1.0,
            share => share,
        });
        let along: Vec<f64> = steps
            .iter()
            .map(|step| (step.pose().angle(lead) - first.angle(lead)).abs())
            .collect();
        let poses: Vec<Pose> = steps.iter().map(Step::pose).collect();
        // Where an arm is in flight is foreseen no better than to where it comes to rest.
        let margin_rad = file.uncertainty.shadow_margin_rad() + file.motion.near_rad;
        let edges = sweep::cells(&poses, lead, &file.envelope, margin_rad);
        let arm = file.arm(lead);
        Self {
            steps,
            next: 0,
            tracks: Arm::BOTH.map(|of| Track::resting(first.angle(of).rad(), arm.profile)),
            from: first.angle(lead).rad(),
            sign: (last.angle(lead) - first.angle(lead)).signum(),
            along,
            edges,
            axis: arm.axis,
            fastest: arm.profile,
            profile: arm.profile,
            moving,
            shares,
            goals: first,
            end: file.nearest(last),
            idle_s,
        }
    }

    fn lead(&self) -> &Track {
        &self.tracks[self.moving.first().copied().unwrap_or(Arm::Light) as usize]
    }

    /// Whether the arms were told to go to the end.
    pub(crate) fn ends(&self) -> bool {
        self.goals == self.end
    }

    /// The rig was observed.
    pub(crate) fn saw(&mut self, t_s: f64, seen: &Observation) {
        for arm in Arm::BOTH {
            self.tracks[arm as usize].saw(t_s, seen.snapshot.pose().angle(arm).rad());
        }
    }

    /// The moving arms were told to go (on) to their goals, on the profile that [`Self::pace`] chose.
    pub(crate) fn steered(&mut self, t_s: f64) {
        for arm in self.moving.clone() {
            let goal = self.goals.angle(arm).rad();
            let profile = self.profile_of(arm);
            self.tracks[arm as usize].steer(t_s, goal, profile);
        }
    }

    /// The profile of an arm with which it keeps step with the first one, as nearly as its servo has it.
    pub(crate) fn profile_of(&self, arm: Arm) -> Profile {
        let share = self.shares[arm as usize];
        if share == 1.0 {
            return self.profile;
        }
        // 0 stands for an infinite acceleration.
        let of = |register: u32| match register {
            0 => 0,
            some => ((f64::from(some) * share).round() as u32).max(1),
        };
        self.axis
            .profile(self.axis.profile_registers(self.profile).map(of))
    }

    /// Takes note of how far the arms may go now; returns whether they must be told.
    pub(crate) fn lead_to(&mut self, goals: Pose) -> bool {
        let farther = self.moving.iter().any(|&arm| {
            let by = (goals.angle(arm) - self.goals.angle(arm)).abs();
            by >= STRIDE_RAD || (by > 0.0 && goals.angle(arm) == self.end.angle(arm))
        });
        if farther {
            self.goals = goals;
        }
        farther
    }

    /// Time between two integrations was measured.
    pub(crate) fn idled(&mut self, idle_s: f64) {
        self.idle_s += NEWEST * (idle_s.max(0.0) - self.idle_s);
    }

    /// When the middle of the next cell will be reached, s.
    pub(crate) fn due_s(&self) -> f64 {
        self.lead().when(self.from + self.sign * self.along[self.next])
    }

    /// Passes over the cells of which less is left at a moment than a quarter of the seconds of light that they need. The
    /// arms rest in the last one.
    pub(crate) fn skip_missed(&mut self, t_s: f64, needed_s: impl Fn(&Step) -> f64) {
        let left = |flight: &Self| {
            flight
                .lead()
                .when(flight.from + flight.sign * flight.edges[flight.next][1])
        };
        while self.next + 1 < self.steps.len() && left(self) - t_s < needed_s(&self.steps[self.next]) / 4.0 {
            self.next += 1;
        }
    }

    /// The longest integration that stays within the next cell, s.
    pub(crate) fn longest_s(&self, t_s: f64) -> f64 {
        let [low, high] = self.edges[self.next];
        let crossing_s = (high - low) / self.lead().speed(t_s).abs().max(f64::MIN_POSITIVE);
        match self.next + 1 < self.steps.len() {
            true => crossing_s.min((self.lead().when(self.from + self.sign * high) - t_s).max(0.0)),
            // The arms come to rest in the last one.
            false => crossing_s,
        }
    }

    /// Chooses how fast the arms may go at a moment, given the seconds of light that each step to come needs. Returns
    /// whether that is another profile than before.
    pub(crate) fn pace(&mut self, t_s: f64, needed_s: impl Fn(&Step) -> f64) -> bool {
        let at = (self.lead().expected(t_s) - self.from) * self.sign;
        let fastest = self.fastest.velocity_rad_s;
        let braking = BRAKING * self.fastest.acceleration_rad_s2.min(ABRUPT);
        let mut speed = fastest;
        // In the last cell the arms come to rest on their profile.
        for i in self.next..self.steps.len().saturating_sub(1) {
            let [low, high] = self.edges[i];
            let ahead = (low - at).max(0.0);
            if 2.0 * braking * ahead > fastest * fastest {
                break;
            }
            let slow = FILLED * (high - low) / (needed_s(&self.steps[i]) + self.idle_s);
            speed = speed.min((slow * slow + 2.0 * braking * ahead).sqrt());
        }
        let profile = self.axis.quantised(Profile {
            velocity_rad_s: speed,
            ..self.fastest
        });
        let changed = profile != self.profile;
        self.profile = profile;
        changed
    }

    /// Where an arm should be at a moment, rad.
    pub(crate) fn expected(&self, arm: Arm, t_s: f64) -> f64 {
        self.tracks[arm as usize].expected(t_s)
    }

    /// Where the arms were at a moment, and the standard deviations of what was measured around then from that, rad.
    pub(crate) fn pose(&self, t_s: f64) -> (Pose, [f64; 2]) {
        let at = self.tracks.each_ref().map(|track| track.at(t_s));
        let pose = Pose {
            light: ArmAngle::from_rad(at[0].0),
            sensor: ArmAngle::from_rad(at[1].0),
        };
        (pose, [at[0].1, at[1].1])
    }

    /// Twice the way, rad, that each arm went from the middle of an integration to that end of it which was further.
    pub(crate) fn reach(&self, middle_s: f64, duration_s: f64) -> [f64; 2] {
        self.tracks.each_ref().map(|track| {
            let middle = track.expected(middle_s);
            let way = |t_s: f64| (track.expected(t_s) - middle).abs();
            2.0 * way(middle_s - duration_s / 2.0).max(way(middle_s + duration_s / 2.0))
        })
    }

    /// How fast each arm was then, rad/s.
    pub(crate) fn speeds(&self, t_s: f64) -> [f64; 2] {
        self.tracks.each_ref().map(|track| track.speed(t_s))
    }
}
