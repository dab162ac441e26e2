use std::time::Duration;

use arms::Arm;
use tokio::sync::watch;

use crate::{Detector, Phase, Rig, RigFile, Snapshot, Surroundings};

mod all;
mod error;
mod expose;
mod fly;
mod hindrance;
mod pulse;
mod rest;
mod retry;
mod travel;

pub use error::DriveError;
pub use hindrance::Hindrance;
use pulse::Pulse;
use rest::Looks;
pub use rest::Rest;

/// Longest wait between two looks at a rig that is engaged or lit: soon enough to stop the other arm when one fails.
const LOOK: Duration = Duration::from_millis(200);

/// Time between two looks at arms that are to come to rest.
const REST: Duration = Duration::from_millis(20);

/// A rig with what must never differ between rigs: limits, settling, approach, retries and timeouts.
///
/// Nothing moves or lights up until it is told to, and nothing is stopped on drop: whoever drives calls
/// [`Drive::stop_all`] or [`Drive::disengage_all`] on every way out.
#[derive(Debug)]
pub struct Drive<R: Rig> {
    rig: R,
    file: RigFile,
    retries: u32,
    /// All that the rig was told to wait, ever.
    waited: Duration,
    engaged: bool,
    lamp: bool,
    /// How late each arm came to rest behind its profile the last time, and by how much it trembled there, rad.
    late: [Option<Duration>; 2],
    tremble_rad: [f64; 2],
    /// By how much the goal of each arm had to be moved for it to come near the pose that was asked for, rad.
    trim_rad: [f64; 2],
    seen: watch::Sender<Option<Snapshot>>,
    pulse: Pulse,
}

impl<R: Rig> Drive<R> {
    /// Takes a rig and the file that describes it; does nothing yet.
    pub fn new(rig: R, file: RigFile) -> Self {
        Self {
            rig,
            file,
            retries: 0,
            waited: Duration::ZERO,
            engaged: false,
            lamp: false,
            late: [None; 2],
            trim_rad: [0.0; 2],
            tremble_rad: [0.0; 2],
            seen: watch::Sender::new(None),
            pulse: Pulse::default(),
        }
    }

    /// The rig file.
    pub fn file(&self) -> &RigFile {
        &self.file
    }

    /// The rig itself, past all checks.
    pub fn rig(&mut self) -> &mut R {
        &mut self.rig
    }

    /// Requests that were repeated so far; the difference over a reading is that reading's.
    pub fn retries(&self) -> u32 {
        self.retries
    }

    /// For how long the devices heard nothing, where that was longer than their watchdogs wait: this computer slept, or
    /// the program was stopped. What goes wrong afterwards is most likely the watchdogs' doing.
    pub fn stood_still(&self) -> Option<Duration> {
        self.pulse.gap()
    }

    /// Says that an execution begins: what [`Drive::stood_still`] tells is over.
    pub fn begin_anew(&mut self) {
        self.pulse.forget();
    }

    /// Says that a lit reading was sound, lamp and pose: after two of them nothing came of [`Drive::stood_still`].
    pub fn is_sound(&mut self) {
        self.pulse.sound();
    }

    /// Notes that the devices have heard from this program.
    fn beat(&mut self) {
        let watchdog = self.file.motion.watchdog;
        let armed = (self.engaged || self.lamp) && !watchdog.is_zero();
        self.pulse.beat(armed.then_some(watchdog));
    }

    /// Where the arms are and what the photometer does.
    ///
    /// # Errors
    /// A silent device; once engaged also a hardware error or lost torque.
    pub async fn snapshot(&mut self) -> Result<Snapshot, DriveError<R::Error>> {
        let snapshot = self
            .retry("read the rig's state", |rig| Box::pin(rig.snapshot()))
            .await?;
        self.note(snapshot)
    }

    /// Tells who watches, and looks whether engaged arms are sound.
    fn note(&mut self, snapshot: Snapshot) -> Result<Snapshot, DriveError<R::Error>> {
        self.seen.send_replace(Some(snapshot));
        if self.engaged {
            for arm in Arm::BOTH {
                let location = snapshot.arms[arm as usize];
                let (bits, measured) = (location.hardware_error, location.measured);
                if bits != 0 {
                    return Err(DriveError::Hardware { arm, bits, measured });
                }
                if !location.torque {
                    return Err(DriveError::TorqueLost { arm, measured });
                }
            }
        }
        Ok(snapshot)
    }

    /// Follows what every snapshot saw.
    pub fn watch(&self) -> watch::Receiver<Option<Snapshot>> {
        self.seen.subscribe()
    }

    /// Waits until both arms stand still and no integration runs: a program that was killed may have left either
    /// behind.
    ///
    /// # Errors
    /// A silent device; an arm that still moves after the time in which it could have crossed all its range. A
    /// photometer that never ends is left to its next trigger, which it refuses.
    pub async fn rest(&mut self) -> Result<(), DriveError<R::Error>> {
        let begun = self.waited;
        let mut looks = Looks::default();
        loop {
            let snapshot = self.snapshot().await?;
            let after = self.waited - begun;
            looks.push(after, snapshot.pose());
            // An arm that trembles or hunts turns as fast as one that goes somewhere.
            let drift_rad = looks.drift_rad(travel::TREND).unwrap_or([f64::INFINITY; 2]);
            let goes = |arm: Arm| drift_rad[arm as usize].abs() > self.file.arm(arm).axis.resolution_rad();
            let moving = Arm::BOTH
                .into_iter()
                .find(|&arm| snapshot.arms[arm as usize].moving && goes(arm));
            if let Some(arm) = moving {
                self.check_resting(arm, &snapshot, after)?;
            } else {
                let longest = Duration::from_micros(self.file.photometer.integration_max_us.into());
                let integrating = snapshot.detector.phase == Phase::Integrating;
                if !integrating || after > longest + self.file.motion.timeout {
                    return Ok(());
                }
            }
            self.wait(REST).await?;
        }
    }

    /// Whether an arm may still be on the way that somebody set it off on so long ago.
    fn check_resting(
        &self,
        arm: Arm,
        snapshot: &Snapshot,
        after: Duration,
    ) -> Result<(), DriveError<R::Error>> {
        let limits = self.file.envelope.limits(arm);
        let longest = self.file.arm(arm).profile.duration_s(limits.max - limits.min);
        if after <= Duration::from_secs_f64(longest) + self.file.motion.timeout {
            return Ok(());
        }
        let location = snapshot.arms[arm as usize];
        Err(DriveError::NotArrived {
            arm,
            goal: location.goal,
            measured: location.measured,
            near_rad: self.file.motion.near_rad,
            after,
            hindrance: Hindrance::Creep,
        })
    }

    /// Lets time pass. While arms are engaged or the lamp is on, it looks at the rig every now and then, which also
    /// keeps the watchdogs from tripping.
    ///
    /// # Errors
    /// What [`Drive::snapshot`] finds.
    pub async fn wait(&mut self, duration: Duration) -> Result<(), DriveError<R::Error>> {
        let watchdog = self.file.motion.watchdog;
        // Three looks per watchdog time: one may be late.
        let slice = match self.engaged || self.lamp {
            true if watchdog.is_zero() => LOOK,
            true => LOOK.min(watchdog / 3),
            false => Duration::MAX,
        };
        let mut left = duration;
        while !left.is_zero() {
            let now = left.min(slice);
            self.retry("let time pass", |rig| Box::pin(rig.wait(now))).await?;
            self.waited += now;
            left -= now;
            if !left.is_zero() {
                self.snapshot().await?;
            }
        }
        Ok(())
    }

    /// Switches the lamp; does not wait for it to warm up.
    ///
    /// # Errors
    /// A silent or failing photometer.
    pub async fn lamp(&mut self, on: bool) -> Result<(), DriveError<R::Error>> {
        self.retry("switch the lamp", |rig| Box::pin(rig.photometer().lamp(on)))
            .await?;
        self.lamp = on;
        Ok(())
    }

    /// Supply, temperatures, door.
    ///
    /// # Errors
    /// A silent device.
    pub async fn surroundings(&mut self) -> Result<Surroundings, DriveError<R::Error>> {
        self.retry("read the rig's surroundings", |rig| Box::pin(rig.surroundings()))
            .await
    }

    /// The photometer's clock now, ticks of 10 µs, 24 bits, wraps.
    ///
    /// # Errors
    /// A silent photometer.
    pub async fn ticks(&mut self) -> Result<u32, DriveError<R::Error>> {
        self.retry("read the photometer's clock", |rig| {
            Box::pin(rig.photometer().ticks())
        })
        .await
    }
}
