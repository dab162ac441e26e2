use std::time::Duration;

use arms::Arm;
use rig::{Counts, DriveError, Exposure, Hindrance, Observation, Rig};
use sweep::Step;

use super::{Execution, Interrupt, TICKS_PER_S};
use crate::exposure::{Ranging, brief};
use crate::flight::Flight;
use crate::{Command, Event, Flag, along, blur};

/// Time between two observations of arms in flight, where the bus has nothing else to do: enough of them for where the arms
/// were to be known better than their encoders show it.
const SIGHT: Duration = Duration::from_millis(5);
/// Time between two looks at an integration that should have ended.
const POLL: Duration = Duration::from_millis(1);
/// Share of a value that motion within the integration may have added to it; beyond, the correction is not trusted and the
/// reading is taken again at rest.
const MOST_BLUR: f64 = 0.05;
/// Standard deviation of what is measured from where an arm is worked out to have been, in counts of the encoder, beyond
/// which it did not move as it was told. A tremble of ±2 counts is 1.0, hunting by as much 1.4.
const UNSTEADY_COUNTS: f64 = 2.0;
/// An arm that is so late is stuck.
const STUCK: Duration = Duration::from_millis(300);
/// Time between two integrations before any was measured: a few transactions.
const IDLE_S: f64 = 0.002;

impl<R: Rig> Execution<'_, R> {
    /// Flies the pass to which a step belongs, again where it was held. Its readings count once it has landed;
    /// those that are saturated, too faint, blurred, shadowed or missing are left to be taken at rest. So is the first of a
    /// run, before it: the arms stand there, and how bright it is nothing else tells.
    pub(super) async fn pass(&mut self, pass: usize) -> Result<(), Interrupt<R::Error>> {
        loop {
            let first = self.undone(pass).next().map(Step::pose);
            if let Some(first) = first {
                self.make_ready(first).await?;
            }
            let steps: Vec<Step> = self.undone(pass).cloned().collect();
            let landed = match steps.first().map(|step| step.lamp) {
                None => true,
                Some(true) if !self.ranging.knows_light() => {
                    self.step(&steps[0]).await?;
                    false
                }
                Some(true) => self.fly(&steps).await?,
                Some(false) => self.dark_on_the_way(&steps).await?,
            };
            if landed {
                return Ok(());
            }
        }
    }

    /// The steps of a pass that have no accepted reading.
    fn undone(&self, pass: usize) -> impl Iterator<Item = &Step> {
        let of = move |step: &&Step| step.pass == Some(pass) && !self.done[step.index];
        self.plan.steps.iter().filter(of)
    }

    /// Whether the operator wants the arms held.
    pub(super) fn held(&self) -> bool {
        matches!(*self.control.borrow(), Command::Pause | Command::Finish)
    }

    /// One flight; returns whether it landed. Where the operator wants it held, or `[suspend]` does, it brakes, and is to
    /// be flown again.
    async fn fly(&mut self, steps: &[Step]) -> Result<bool, Interrupt<R::Error>> {
        let mut flight = Flight::new(steps, self.file, IDLE_S);
        if flight.moving.is_empty() {
            return Ok(true);
        }
        // The lamp becomes steady while the arms go to where it is needed.
        let lit = match self.lamp {
            true => None,
            false => {
                self.drive.lamp(true).await?;
                self.lamp = true;
                Some(self.look().await?)
            }
        };
        // They may still be on the way there.
        self.drive.rest().await?;
        self.travel(&steps[0]).await?;
        if let Some(since) = lit {
            let passed = self.look().await?.saturating_sub(since);
            let left = self.file.photometer.lamp_warm_up;
            self.warm_up(left.saturating_sub(Duration::from_micros(10 * passed)))
                .await?;
        }
        self.standing = None;
        let landed = self.cruise(&mut flight).await?;
        if !landed {
            self.drive.brake().await?;
        }
        self.drive.rest().await?;
        for &arm in &flight.moving {
            let profile = self.file.arm(arm).profile;
            self.drive.steer(arm, profile).await?;
        }
        self.land(&flight, landed).await?;
        Ok(landed)
    }

    /// From the first step's pose to the last one's.
    async fn cruise(&mut self, flight: &mut Flight<'_>) -> Result<bool, Interrupt<R::Error>> {
        let mut ranging = self.ranging.clone();
        let (_, now_s) = self.sight(flight).await?;
        self.pace(flight, &ranging, now_s);
        self.steer(flight).await?;
        let (_, now_s) = self.sight(flight).await?;
        flight.goals = self.drive.ahead(flight.end).await?;
        self.drive.set_off(flight.goals).await?;
        flight.steered(now_s);
        let mut retries = self.drive.retries();
        while flight.next < flight.steps.len() {
            if self.held() {
                return Ok(false);
            }
            if self.unfit_now().await? {
                return Ok(false);
            }
            let (seen, now_s) = self.sight(flight).await?;
            let paced = self.pace(flight, &ranging, now_s);
            if self.lead(flight).await? {
                flight.steered(now_s);
            } else if paced {
                self.steer(flight).await?;
                flight.steered(now_s);
            }
            let step = &flight.steps[flight.next];
            let exposure = self.in_flight(&ranging, step, flight.longest_s(now_s));
            let half_s = exposure.duration().as_secs_f64() / 2.0;
            let ahead = Duration::from_secs_f64((flight.due_s() - half_s - now_s).max(0.0));
            self.check_flight(flight, &seen, now_s)?;
            if ahead > SIGHT {
                self.drive.wait(SIGHT).await?;
                continue;
            }
            self.drive.wait(ahead).await?;
            let (counts, after_s) = self
                .collect(flight, seen.snapshot.detector.sequence, exposure)
                .await?;
            self.heed_lamp(&counts)?;
            let idle = after_s - now_s - ahead.as_secs_f64() - 2.0 * half_s;
            flight.idled(idle);
            let mut reading = self.taken(step, counts, seen.snapshot.pose());
            // Where it was is not known before it has landed.
            reading.flags = vec![Flag::Blurred];
            reading.retries = self.drive.retries() - retries;
            retries = self.drive.retries();
            ranging.learn(&reading);
            self.aloft.push(reading);
            flight.next += 1;
            if flight.next < flight.steps.len() {
                flight.skip_missed(after_s, |step| self.needed_s(&ranging, step));
            }
        }
        // An arm that waited for the other has still to be let go to the end.
        while !flight.ends() {
            if self.held() || self.unfit_now().await? {
                return Ok(false);
            }
            let (seen, now_s) = self.sight(flight).await?;
            self.check_flight(flight, &seen, now_s)?;
            if self.lead(flight).await? {
                flight.steered(now_s);
            }
            self.drive.wait(SIGHT).await?;
        }
        Ok(true)
    }

    /// Gives the moving arms the profile that the flight chose.
    async fn steer(&mut self, flight: &Flight<'_>) -> Result<(), Interrupt<R::Error>> {
        for &arm in &flight.moving {
            self.drive.steer(arm, flight.profile_of(arm)).await?;
        }
        Ok(())
    }

    /// Lets the arms go as far as is safe from where they were seen last; returns whether they were told anything.
    async fn lead(&mut self, flight: &mut Flight<'_>) -> Result<bool, Interrupt<R::Error>> {
        if flight.ends() {
            return Ok(false);
        }
        let goals = self.drive.ahead(flight.end).await?;
        if !flight.lead_to(goals) {
            return Ok(false);
        }
        let arms: Vec<_> = flight
            .moving
            .iter()
            .map(|&arm| (arm, flight.profile_of(arm)))
            .collect();
        self.drive.send_on(goals, arms).await?;
        Ok(true)
    }

    /// Observes the rig and tells the flight; also returns when that was, s.
    async fn sight(&mut self, flight: &mut Flight<'_>) -> Result<(Observation, f64), Interrupt<R::Error>> {
        let seen = self.drive.observe().await?;
        let now_s = self.clock.unwrap(seen.ticks) as f64 / TICKS_PER_S;
        flight.saw(now_s, &seen);
        Ok((seen, now_s))
    }

    fn pace(&self, flight: &mut Flight<'_>, ranging: &Ranging<'_>, now_s: f64) -> bool {
        flight.pace(now_s, |step| self.needed_s(ranging, step))
    }

    /// Seconds of light that a step needs.
    fn needed_s(&self, ranging: &Ranging<'_>, step: &Step) -> f64 {
        let exposure = self.in_flight(ranging, step, f64::INFINITY);
        exposure.duration().as_secs_f64()
    }

    fn in_flight(&self, ranging: &Ranging<'_>, step: &Step, longest_s: f64) -> Exposure {
        match ranging.predict(step.sweep, step.pose()) {
            Some(rate) => brief(self.file, rate, longest_s),
            // As on a reading at rest, when nothing is known: the first reading ranges the next.
            None => ranging.first(step.sweep, step.pose()),
        }
    }

    /// Triggers and follows the arms until the reading is there; returns it and when it was.
    async fn collect(
        &mut self,
        flight: &mut Flight<'_>,
        before: u32,
        exposure: Exposure,
    ) -> Result<(Counts, f64), Interrupt<R::Error>> {
        let begun_s = self.clock.last() as f64 / TICKS_PER_S;
        let expected = self.drive.trigger(before, exposure).await?;
        let wrong = |found: String| DriveError::Reading {
            expected,
            exposure,
            found,
        };
        let mut left = exposure.duration();
        loop {
            self.drive
                .wait(left.clamp(POLL.min(exposure.duration()), SIGHT))
                .await?;
            let (seen, now_s) = self.sight(flight).await?;
            match seen.counts {
                Some(counts) if counts.sequence == expected && counts.exposure == exposure => {
                    return Ok((counts, now_s));
                }
                Some(counts) => {
                    let found = format!("reading {} came, with {:?}", counts.sequence, counts.exposure);
                    return Err(wrong(found).into());
                }
                None => {}
            }
            let passed = Duration::from_secs_f64((now_s - begun_s).max(0.0));
            if passed > exposure.duration() + self.file.motion.timeout {
                return Err(wrong("still integrating".to_owned()).into());
            }
            left = exposure.duration().saturating_sub(passed);
        }
    }

    /// An arm that is stuck never comes to its next cell.
    fn check_flight(
        &self,
        flight: &Flight<'_>,
        seen: &Observation,
        now_s: f64,
    ) -> Result<(), Interrupt<R::Error>> {
        let stuck = flight.moving.iter().find(|&&arm| {
            let off = seen.snapshot.pose().angle(arm).rad() - flight.expected(arm, now_s);
            let speed = self.file.arm(arm).profile.velocity_rad_s;
            off.abs() > self.file.motion.near_rad + speed * STUCK.as_secs_f64()
        });
        let Some(&arm) = stuck else { return Ok(()) };
        Err(Interrupt::Fault(DriveError::NotArrived {
            arm,
            goal: arms::ArmAngle::from_rad(flight.expected(arm, now_s)),
            measured: seen.snapshot.pose().angle(arm),
            near_rad: self.file.motion.near_rad,
            after: STUCK,
            hindrance: Hindrance::Obstacle,
        }))
    }

    /// Whether an arm did not move as it was told.
    fn unsteady(&self, deviation_rad: [f64; 2]) -> bool {
        Arm::BOTH.into_iter().any(|arm| {
            let count_rad = self.file.arm(arm).axis.resolution_rad();
            deviation_rad[arm as usize] > UNSTEADY_COUNTS * count_rad
        })
    }

    /// Works out where each reading was taken and records it: as one that counts where the flight landed and it is neither
    /// saturated, nor too faint, nor blurred, and clear of the arms' shadow over the whole of its integration.
    async fn land(&mut self, flight: &Flight<'_>, landed: bool) -> Result<(), Interrupt<R::Error>> {
        let mut readings = std::mem::take(&mut self.aloft);
        for reading in &mut readings {
            let t_s = reading.device_ticks as f64 / TICKS_PER_S;
            let exposure_s = reading.counts.exposure.duration().as_secs_f64();
            let (measured, deviation_rad) = flight.pose(t_s);
            reading.spread_rad = Some(deviation_rad.map(|rad| 2.0 * rad));
            reading.measured = measured;
            reading.flags.clear();
            reading.swept_rad = Some(flight.speeds(t_s).map(|speed| speed * exposure_s));
            if self.unsteady(deviation_rad) {
                reading.flags.push(Flag::Blurred);
            }
            if self.file.shadowed(measured, flight.reach(t_s, exposure_s)) {
                reading.flags.push(Flag::Shadowed);
            }
        }
        let points: Vec<(f64, f64)> = along(readings.iter().map(|reading| reading.measured))
            .into_iter()
            .zip(&readings)
            .map(|(along, reading)| (along, self.ranging.rate(&reading.counts)))
            .collect();
        for (at, mut reading) in readings.into_iter().enumerate() {
            let [light, sensor] = reading.swept_rad.unwrap_or_default();
            let added = blur(&points, at, light.hypot(sensor));
            let unsteady = reading.flags.contains(&Flag::Blurred);
            let shadowed = reading.flags.contains(&Flag::Shadowed);
            let blurred = unsteady || added.abs() > MOST_BLUR * points[at].1.abs();
            reading.flags = self.flags(&reading);
            for (is, flag) in [(blurred, Flag::Blurred), (shadowed, Flag::Shadowed)] {
                if is && !reading.flags.contains(&flag) {
                    reading.flags.push(flag);
                }
            }
            let faint = self.ranging.too_faint(&reading.counts);
            reading.accepted = landed && !blurred && !shadowed && !reading.counts.saturated && !faint;
            let step = self.plan.steps[reading.step].clone();
            self.emit(Event::Step {
                step: step.index,
                of: self.plan.steps.len(),
                sweep: step.sweep,
                goal: step.pose(),
            });
            self.record(reading, &step).await?;
        }
        Ok(())
    }
}
