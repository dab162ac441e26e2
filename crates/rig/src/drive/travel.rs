use std::time::Duration;

use arms::{Arm, ArmAngle, Envelope, Pose};
use tokio::time::Instant;

use super::rest::Looks;
use super::retry::least;
use super::{Drive, DriveError, Hindrance, Rest};
use crate::{Approach, Rig, Snapshot};

/// Time between two looks at arms that should have arrived, and how many of them the settling time takes at least.
const POLL: Duration = Duration::from_millis(2);
const LOOKS: u32 = 5;
/// Longest time by which an arm that follows its profile is late: 150 ms at a position gain of 240.
const LATEST: Duration = Duration::from_millis(200);
/// What stands for so long does not swing: more than half a period of a swing of 6 Hz.
const SWING: Duration = Duration::from_millis(90);
/// An arm that is off its goal by up to this, degrees, or this many times what is near enough, is sent on by as much, and
/// so often: three counts of friction, eight of a load and some more.
const TRIMMABLE_DEG: f64 = 2.0;
const TRIMMABLE: f64 = 4.0;
const TRIMS: usize = 3;
/// Where an arm cannot be sent on, since its limits or the other arm are there, this many times what is near enough is.
const AT_THE_EDGE: f64 = 2.0;
/// How much of what a goal was moved by counts for the next one.
const KEPT: f64 = 0.6;
/// A change of its goal that moves an arm by less than this share was ignored.
const IGNORED: f64 = 0.25;
/// Over this time the mean of an arm that hunts shows whether it goes anywhere, and it may go to and fro by this many
/// times what is near enough.
const HUNT: Duration = Duration::from_millis(200);
const HUNTING: f64 = 2.0;
/// Over this time an arm that never came to rest shows whether it went anywhere: whole periods of a slow hunt in each half.
pub(super) const TREND: Duration = Duration::from_millis(800);
/// An arm that is near at the first look is looked at this much sooner the next time.
const SOONER: f64 = 0.7;
/// How much more than last time an arm may tremble without being waited for.
const AS_BEFORE: f64 = 1.3;

impl<R: Rig> Drive<R> {
    /// Takes the arms along a path and returns once both stand still near its end: over the settling time their
    /// measured angles lie within [`MotionSettings::still_rad`](crate::MotionSettings) and their mean within
    /// [`MotionSettings::near_rad`](crate::MotionSettings) of the goal. Poses on the way are reached as nearly, but
    /// nobody waits there.
    ///
    /// A goal that an arm misses by more is moved by the error, three times at most. An arm that hunts about its goal
    /// counts as standing where its mean does. Where the arms stood and by how much they trembled is returned.
    ///
    /// Before each leg, limits and separation are checked over all that it sweeps, from where the arms measurably
    /// are. Where the rig file asks for an approach from one side and the last leg comes from the other, the arm goes
    /// beyond by the overshoot first, unless the envelope forbids that.
    ///
    /// # Errors
    /// A leg that leaves the envelope (nothing moved), an arm that does not take its goal, does not arrive in time (with
    /// what it looks like), loses its torque or reports a hardware error; a device that is silent for too long. The arms
    /// are not stopped: see [`Drive::stop_all`].
    pub async fn travel(&mut self, path: &[Pose]) -> Result<Rest, DriveError<R::Error>> {
        let Some((&last, on_the_way)) = path.split_last() else {
            return self.look_at_rest().await;
        };
        for &pose in on_the_way {
            self.leg(pose, Duration::ZERO).await?;
        }
        let from = self.snapshot().await?;
        let beyond = self.beyond(from.pose(), last);
        if beyond != last && self.check(&from, beyond).is_ok() {
            self.leg(beyond, Duration::ZERO).await?;
        }
        self.leg(last, self.file.motion.settle).await
    }

    /// Where the arms stood over the last stretch of time; `None` where one moved, or nobody looked for so long.
    fn still(&self, looks: &Looks, window: Duration) -> Option<Rest> {
        let rest = looks.over(window)?;
        rest.moved(self.still_rad()).is_none().then_some(rest)
    }

    /// Where the arms are, by one look.
    async fn look_at_rest(&mut self) -> Result<Rest, DriveError<R::Error>> {
        let mut looks = Looks::default();
        looks.push(Duration::ZERO, self.snapshot().await?.pose());
        Ok(looks.all())
    }

    /// By how much arms at rest may move between looks, rad: what the rig file allows, what the encoder's counts make of
    /// that, and what they trembled by when they arrived.
    pub fn still_rad(&self) -> [f64; 2] {
        Arm::BOTH.map(|arm| {
            // A tremble of less than a count shows as one or two.
            let counts_rad = 2.0 * self.file.arm(arm).axis.resolution_rad();
            let allowed = self.file.motion.still_rad.max(1.001 * counts_rad);
            allowed.max(AS_BEFORE * self.tremble_rad[arm as usize])
        })
    }

    /// Where the arms go first so that they come to `to` from the side that the rig file asks for.
    fn beyond(&self, from: Pose, to: Pose) -> Pose {
        let motion = &self.file.motion;
        let side = match motion.approach {
            Approach::None => return to,
            Approach::Up => -1.0,
            Approach::Down => 1.0,
        };
        Arm::BOTH.into_iter().fold(to, |pose, arm| {
            let way = to.angle(arm) - from.angle(arm);
            // An arm that only corrects its own error has no wrong side to come from.
            if way * side <= motion.near_rad {
                return pose;
            }
            let limits = self.file.envelope.limits(arm);
            let rad =
                (to.angle(arm).rad() + side * motion.overshoot_rad).clamp(limits.min.rad(), limits.max.rad());
            pose.with(arm, ArmAngle::from_rad(rad))
        })
    }

    /// Checks a motion from where the arms are: the way against the tolerant envelope, its end against the strict one.
    pub(super) fn check(&self, from: &Snapshot, to: Pose) -> Result<(), DriveError<R::Error>> {
        let strict = &self.file.envelope;
        strict.check_pose(to).map_err(DriveError::Envelope)?;
        self.tolerant()
            .check_path(from.pose(), to)
            .map_err(DriveError::Envelope)
    }

    /// The envelope widened by the slack of each arm.
    pub(crate) fn tolerant(&self) -> Envelope {
        let strict = &self.file.envelope;
        let slack = self.file.slack_rad();
        let widen = |mut limits: arms::Limits| {
            limits.min = ArmAngle::from_rad(limits.min.rad() - slack);
            limits.max = ArmAngle::from_rad(limits.max.rad() + slack);
            limits
        };
        Envelope {
            light: widen(strict.light),
            sensor: widen(strict.sensor),
            separation_rad: (strict.separation_rad - 2.0 * slack).max(0.0),
            can_pass: strict.can_pass,
        }
    }

    /// Waits until both arms stand still, wherever that is, or for as long as a motion may overrun its profile: one that
    /// has just arrived may swing.
    ///
    /// # Errors
    /// A silent device; once engaged also a hardware error or lost torque.
    pub async fn stand(&mut self) -> Result<Rest, DriveError<R::Error>> {
        let watch = Watch::start(self.waited);
        let mut looks = Looks::default();
        loop {
            let elapsed = watch.elapsed(self.waited);
            looks.push(elapsed, self.snapshot().await?.pose());
            match self.still(&looks, SWING) {
                Some(rest) => return Ok(rest),
                None if elapsed > self.file.motion.timeout => return Ok(looks.all()),
                None => self.wait(POLL * LOOKS).await?,
            }
        }
    }

    /// Where the arms are, once they do not swing out of the envelope any more.
    async fn within(&mut self, to: Pose) -> Result<Snapshot, DriveError<R::Error>> {
        let mut from = self.snapshot().await?;
        if self.check(&from, to).is_err() {
            self.stand().await?;
            from = self.snapshot().await?;
        }
        self.check(&from, to)?;
        Ok(from)
    }

    async fn leg(&mut self, to: Pose, settle: Duration) -> Result<Rest, DriveError<R::Error>> {
        let from = self.within(to).await?;
        let goal = self.file.nearest(to);
        let mut start = from.pose();
        let mut aim = self.as_trimmed(&from, goal);
        let mut ignored = false;
        for trim in 0..=TRIMS {
            let watch = Watch::start(self.waited);
            let duration = self.duration(start, aim);
            self.start(aim).await?;
            self.wait(duration + self.late(start, aim)).await?;
            let rest = self.settle(goal, aim, settle, watch, duration).await?;
            let Some(arm) = self.away(rest.pose, goal) else {
                for arm in Arm::BOTH {
                    // Friction errs to the side from which the arm came, a load always to the same.
                    let trim_rad = &mut self.trim_rad[arm as usize];
                    *trim_rad += KEPT * (aim.angle(arm) - goal.angle(arm) - *trim_rad);
                }
                return Ok(rest);
            };
            if trim > 0 {
                let moved = rest.pose.angle(arm) - start.angle(arm);
                ignored = moved.abs() < IGNORED * (goal.angle(arm) - start.angle(arm)).abs();
            }
            let hindrance = if ignored {
                Hindrance::Stiction
            } else {
                Hindrance::Load
            };
            let trimmed = self.trimmed(aim, rest.pose, goal);
            let from = self.snapshot().await?;
            let room = self.check(&from, trimmed).is_ok();
            if !room && self.off(arm, rest.pose, goal) <= AT_THE_EDGE * self.file.motion.near_rad {
                return Ok(rest);
            }
            if trim == TRIMS || !room {
                return Err(self.not_arrived(arm, (goal, aim), rest.pose, watch, hindrance));
            }
            (start, aim) = (rest.pose, trimmed);
        }
        unreachable!("the last trim returns")
    }

    /// A goal moved by what the last one had to be moved by: a load such as gravity changes little from one to the next.
    fn as_trimmed(&self, from: &Snapshot, goal: Pose) -> Pose {
        let aim = Arm::BOTH.into_iter().fold(goal, |aim, arm| {
            let rad = goal.angle(arm).rad() + self.trim_rad[arm as usize];
            aim.with(arm, ArmAngle::from_rad(rad))
        });
        let aim = self.file.nearest(aim);
        if self.check(from, aim).is_ok() { aim } else { goal }
    }

    /// The goal of each arm that is not near its own, moved by what it is off.
    fn trimmed(&self, aim: Pose, measured: Pose, goal: Pose) -> Pose {
        let away = |arm: &Arm| self.off(*arm, measured, goal) > self.file.motion.near_rad;
        let trimmed = Arm::BOTH.into_iter().filter(away).fold(aim, |aim, arm| {
            let off = goal.angle(arm) - measured.angle(arm);
            aim.with(arm, ArmAngle::from_rad(aim.angle(arm).rad() + off))
        });
        self.file.nearest(trimmed)
    }

    /// Waits until the arms stand still: near the goal, or off it by what can be trimmed. With no settling time they need
    /// not stand near it.
    async fn settle(
        &mut self,
        goal: Pose,
        aim: Pose,
        settle: Duration,
        watch: Watch,
        duration: Duration,
    ) -> Result<Rest, DriveError<R::Error>> {
        let near_rad = self.file.motion.near_rad;
        let poll = (settle / LOOKS).max(POLL);
        let window = settle.max(poll * LOOKS);
        let mut looks = Looks::default();
        let mut late = None;
        loop {
            let pose = self.snapshot().await?.pose();
            let elapsed = watch.elapsed(self.waited);
            let over = elapsed.saturating_sub(duration);
            let away = self.away(pose, goal);
            if late.is_none() && away.is_none() {
                // Where the first look finds them near they may have been for a while.
                late = Some(if looks.is_empty() {
                    over.mul_f64(SOONER)
                } else {
                    over
                });
            }
            looks.push(elapsed, pose);
            if settle.is_zero() && away.is_none() {
                return Ok(looks.all());
            }
            // Without a settling time one look is enough, which was not near.
            let still = self.still(&looks, if settle.is_zero() { window } else { settle });
            if let Some(rest) = still.filter(|rest| self.away(rest.pose, goal).is_none()) {
                self.arrived(rest, late.unwrap_or(over), aim);
                return Ok(rest);
            }
            // What swings looks still where it turns back; it is not sent on.
            let stands = self.still(&looks, SWING);
            if let Some(rest) = stands
                && over > self.latest()
            {
                let off = Arm::BOTH.map(|arm| self.off(arm, rest.pose, goal));
                let trimmed = self.trimmed(aim, rest.pose, goal);
                let room = self.file.envelope.check_pose(trimmed).is_ok();
                let worst = off[0].max(off[1]);
                let allowed = if room {
                    self.trimmable_rad()
                } else {
                    AT_THE_EDGE * near_rad
                };
                if worst > near_rad && worst <= allowed {
                    return Ok(rest);
                }
            }
            let hunts = looks.over(HUNT).filter(|_| over > HUNT + LATEST);
            if let (Some(rest), Some(drift_rad)) = (hunts, looks.drift_rad(HUNT)) {
                let steady = drift_rad.into_iter().all(|drift| drift.abs() < near_rad / 2.0);
                let bounded = rest.moved([HUNTING * near_rad; 2]).is_none();
                if steady && bounded && self.away(rest.pose, goal).is_none() {
                    self.arrived(rest, Duration::ZERO, aim);
                    return Ok(rest);
                }
            }
            if over > settle + self.file.motion.timeout {
                let recent = looks.over(HUNT).unwrap_or_else(|| looks.all());
                let arm = self.away(recent.pose, goal).or(recent.moved(self.still_rad()));
                let arm = arm.unwrap_or(Arm::Light);
                let drift_rad = looks.drift_rad(TREND).or(looks.drift_rad(HUNT));
                let hindrance = self.hindrance(arm, recent, drift_rad, goal);
                return Err(self.not_arrived(arm, (goal, aim), recent.pose, watch, hindrance));
            }
            self.wait(poll).await?;
        }
    }

    /// What keeps an arm from its goal for so long, by what was seen of it last.
    fn hindrance(&self, arm: Arm, recent: Rest, drift_rad: Option<[f64; 2]>, goal: Pose) -> Hindrance {
        let still_rad = self.still_rad()[arm as usize];
        let drift_rad = drift_rad.map_or(0.0, |drift| drift[arm as usize].abs());
        let spread_rad = recent.spread_rad[arm as usize];
        if spread_rad > still_rad && drift_rad < spread_rad / 4.0 {
            Hindrance::Hunting
        } else if drift_rad > still_rad / 10.0 {
            Hindrance::Creep
        } else if self.off(arm, recent.pose, goal) > self.trimmable_rad() {
            Hindrance::Obstacle
        } else {
            Hindrance::Load
        }
    }

    /// Keeps in mind how late the arms came to rest and by how much they tremble there.
    fn arrived(&mut self, rest: Rest, late: Duration, aim: Pose) {
        let held = self.seen.borrow().map(|seen| seen.arms.map(|at| at.goal));
        for arm in Arm::BOTH {
            let i = arm as usize;
            // Only an arm that was sent here tells.
            if held.is_some_and(|held| (held[i] - aim.angle(arm)).abs() <= self.file.motion.near_rad) {
                self.late[i] = Some(late.min(LATEST));
                self.tremble_rad[i] = rest.spread_rad[i].min(HUNTING * self.file.motion.near_rad);
            }
        }
    }

    /// How late the arms that move will be.
    fn late(&self, from: Pose, to: Pose) -> Duration {
        let moves = |arm: &Arm| (to.angle(*arm) - from.angle(*arm)).abs() > self.file.motion.near_rad;
        let late = Arm::BOTH
            .into_iter()
            .filter(moves)
            .filter_map(|arm| self.late[arm as usize]);
        late.max().unwrap_or_default()
    }

    /// After which time past their profiles arms that are late have set off at the latest, as far as it is known.
    fn latest(&self) -> Duration {
        let [light, sensor] = self.late.map(|late| late.map_or(LATEST, |late| 2 * late));
        light.max(sensor).min(LATEST)
    }

    /// By how much an arm may be off its goal to be sent on, rad.
    fn trimmable_rad(&self) -> f64 {
        TRIMMABLE_DEG
            .to_radians()
            .max(TRIMMABLE * self.file.motion.near_rad)
    }

    /// Says that an arm is not where it should be, although it was sent to `aim` for that.
    fn not_arrived(
        &self,
        arm: Arm,
        (goal, aim): (Pose, Pose),
        measured: Pose,
        watch: Watch,
        hindrance: Hindrance,
    ) -> DriveError<R::Error> {
        let after = watch.elapsed(self.waited);
        let seen = *self.seen.borrow();
        if let Some(has) = seen.and_then(|seen| self.other_goal(arm, &seen, aim)) {
            return DriveError::GoalNotTaken {
                arm,
                goal: aim.angle(arm),
                has,
                tried: after,
            };
        }
        DriveError::NotArrived {
            arm,
            goal: goal.angle(arm),
            measured: measured.angle(arm),
            near_rad: self.file.motion.near_rad,
            after,
            hindrance,
        }
    }

    /// The goal that an arm has, where it is not the one that it was told.
    fn other_goal(&self, arm: Arm, seen: &Snapshot, told: Pose) -> Option<ArmAngle> {
        let has = seen.arms[arm as usize].goal;
        let half_a_count = self.file.arm(arm).axis.resolution_rad() / 2.0;
        ((has - told.angle(arm)).abs() > half_a_count).then_some(has)
    }

    /// How long both arms take by their profiles.
    fn duration(&self, from: Pose, to: Pose) -> Duration {
        let seconds = Arm::BOTH.map(|arm| {
            let way = to.angle(arm) - from.angle(arm);
            self.file.arm(arm).profile.duration_s(way)
        });
        Duration::from_secs_f64(seconds[0].max(seconds[1]))
    }

    /// The first arm that is not near its goal.
    fn away(&self, measured: Pose, goal: Pose) -> Option<Arm> {
        Arm::BOTH
            .into_iter()
            .find(|&arm| self.off(arm, measured, goal) > self.file.motion.near_rad)
    }

    /// By how much an arm is off its goal, rad.
    fn off(&self, arm: Arm, measured: Pose, goal: Pose) -> f64 {
        (measured.angle(arm) - goal.angle(arm)).abs()
    }

    /// Sets both arms off. The sync write is not acknowledged, so it is repeated until the goals read back.
    pub(super) async fn start(&mut self, goal: Pose) -> Result<(), DriveError<R::Error>> {
        let since = Instant::now();
        let mut repeated = 0;
        loop {
            self.retry("set the arms off", |rig| Box::pin(rig.start(goal)))
                .await?;
            let snapshot = self.snapshot().await?;
            let other = Arm::BOTH
                .into_iter()
                .find_map(|arm| Some((arm, self.other_goal(arm, &snapshot, goal)?)));
            let Some((arm, has)) = other else { return Ok(()) };
            if since.elapsed() >= self.file.bus.silence && repeated >= least(self.file.bus.silence) {
                return Err(DriveError::GoalNotTaken {
                    arm,
                    goal: goal.angle(arm),
                    has,
                    tried: since.elapsed(),
                });
            }
            self.retries += 1;
            repeated += 1;
            self.wait(POLL).await?;
        }
    }
}

/// Time since a start in the rig's terms: the host's clock, or what the rig was told to wait where its time is
/// simulated and the host's hardly passes.
#[derive(Clone, Copy)]
struct Watch {
    started: Instant,
    waited: Duration,
}

impl Watch {
    fn start(waited: Duration) -> Self {
        Self {
            started: Instant::now(),
            waited,
        }
    }

    fn elapsed(&self, waited: Duration) -> Duration {
        self.started.elapsed().max(waited - self.waited)
    }
}
