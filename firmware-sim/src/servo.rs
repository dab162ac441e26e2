mod device;
mod motion;
mod path;
mod registers;
#[cfg(test)]
mod tests;
mod tremble;

use std::time::Duration;

use path::Path;
use registers as reg;
use rig::Axis;
use rig::dynamixel::Model;

use crate::fault::Disturbance;
use crate::node::Node;
use crate::table::Table;
use crate::{Device, Mechanics};

/// How a servo leaves the workshop: what the rig file and the `[sim]` table say of it.
#[derive(Clone, Debug)]
pub(crate) struct Fitting {
    pub(crate) model: &'static Model,
    pub(crate) id: u8,
    pub(crate) baud_code: u8,
    pub(crate) return_delay: Duration,
    /// Servo counts between which the arm may be.
    pub(crate) limits: [f64; 2],
    /// Servo count at which it stands when power comes on.
    pub(crate) start: f64,
    /// Play between the encoder and the arm, counts.
    pub(crate) backlash: f64,
    /// By how much the shaft follows its profile late, at the factory's position gain.
    pub(crate) lag: Duration,
    /// From servo counts to the arm's angle.
    pub(crate) axis: Axis,
    pub(crate) mechanics: Mechanics,
    pub(crate) seed: u64,
    pub(crate) boot: Duration,
    pub(crate) ambient_c: f64,
}

/// A servo: its control table and the motion behind it.
///
/// It moves in the position modes (3, 4, 5). The modes for wheels and torque can be set, so that a host can be seen
/// to refuse them, and hold the shaft still. Of the gains P and I have an effect.
///
/// Motion happens in shaft counts: where the shaft is, on a line that goes on over many turns. Position registers
/// show that line with direction, lost turns and homing offset.
#[derive(Debug)]
pub(crate) struct Servo {
    fitting: Fitting,
    node: Node,
    /// The profile as the servo computes it.
    profile: Path,
    /// Profile type in bits 4 and 5 of Moving Status.
    profile_type: u8,
    /// The shaft, which follows late, or is stuck.
    shaft: Path,
    /// What the register does not know of the shaft's turns, counts.
    lost_turns: f64,
    mechanics: Mechanics,
    /// Where in its tremble the shaft is at power-on, s.
    phase_s: f64,
    sags_until: Duration,
    /// What Control Table Backup stored.
    backup: Option<Table>,
    stalled_until: Option<Duration>,
}

impl Servo {
    pub(crate) fn new(fitting: Fitting) -> Self {
        let [low, high] = fitting.limits;
        let model = fitting.model;
        let (first, last) = model.positions().into_inner();
        let mut table = Table::of(Some(model.series), reg::registers(model));
        table.set(reg::RETURN_DELAY, fitting.return_delay.as_micros() as i64 / 2);
        table.set(reg::MIN_POSITION, low.floor().max(f64::from(first)) as i64);
        table.set(reg::MAX_POSITION, high.ceil().min(f64::from(last)) as i64);
        let mut servo = Self {
            profile: Path::resting(fitting.start, 0.0),
            shaft: Path::resting(fitting.start, fitting.backlash / 2.0),
            node: Node::new(table, fitting.id, fitting.baud_code),
            mechanics: fitting.mechanics,
            phase_s: f64::from(fitting.id) + (fitting.seed % 1000) as f64,
            fitting,
            profile_type: 0,
            lost_turns: 0.0,
            sags_until: Duration::ZERO,
            backup: None,
            stalled_until: None,
        };
        servo.start_up();
        servo
    }

    /// Servo count, not whole, at which the arm behind the play really is, whatever the encoder shows.
    pub(crate) fn arm(&self, t_s: f64) -> f64 {
        let (off, _) = self.off(t_s);
        let shown = self.shaft.at(t_s).0 + off;
        self.shaft.follower(t_s) + off - self.encoder_error(shown)
    }

    /// Moments within a stretch of time at which the motion changes its law.
    pub(crate) fn breaks(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = f64> {
        self.shaft.breaks(from_s, to_s)
    }

    /// Whether the shaft stands still for a stretch of time.
    pub(crate) fn rests(&self, from_s: f64, to_s: f64) -> bool {
        self.leads_nowhere(from_s, to_s) && !self.trembles(from_s)
    }

    /// Whether the shaft is led nowhere in a stretch of time, though it may tremble.
    pub(crate) fn leads_nowhere(&self, from_s: f64, to_s: f64) -> bool {
        self.shaft.rests(from_s, to_s)
    }

    /// Lets go of what the shaft did before a moment.
    pub(crate) fn forget(&mut self, before_s: f64) {
        self.shaft.forget(before_s);
        self.profile.forget(before_s);
    }

    pub(crate) fn schedule(&mut self, at: Duration, what: Disturbance) {
        self.node.faults.push(at, what);
    }

    /// When something happens by itself next: a motion or a boot ends, the watchdog trips, a fault sets in or ends.
    pub(crate) fn next_event(&self) -> Option<Duration> {
        let [deaf, silent] = self.node.wakes();
        let motion_s = self.profile.end_s().max(self.shaft.end_s());
        // Rounded up, so that the motion is over by then.
        let motion = Duration::from_nanos((motion_s * 1e9).ceil() as u64);
        [motion, deaf, silent, self.sags_until]
            .map(Some)
            .into_iter()
            .chain([self.watchdog(), self.stalled_until, self.node.faults.next()])
            .flatten()
            .filter(|&at| at > self.node.now)
            .min()
    }

    /// When the bus watchdog will trip.
    fn watchdog(&self) -> Option<Duration> {
        self.node.watchdog(self.torque())
    }

    /// Lets time pass, in the order of what happens.
    pub(crate) fn advance_to(&mut self, t: Duration) {
        while let Some(at) = [self.watchdog(), self.stalled_until, self.node.faults.next()]
            .into_iter()
            .flatten()
            .min()
            .filter(|&at| at <= t)
        {
            self.node.now = self.node.now.max(at);
            if self.watchdog() == Some(at) {
                self.trip();
            } else if self.stalled_until == Some(at) {
                self.release();
            } else if let Some(what) = self.node.faults.pop(at) {
                self.suffer(what);
            }
        }
        self.node.now = self.node.now.max(t);
    }

    fn suffer(&mut self, what: Disturbance) {
        match what {
            Disturbance::Silence(duration) => self.node.silence(duration),
            Disturbance::HardwareError(bits) => {
                self.node.fail(bits);
                if self.shut_down() {
                    self.node.table.set(reg::TORQUE_ENABLE, 0);
                    self.stand();
                }
            }
            Disturbance::Stall(duration) => {
                self.stalled_until = Some(self.node.now + duration);
                let now_s = self.node.now.as_secs_f64();
                self.shaft.jump(now_s, self.shaft.at(now_s).0);
            }
            Disturbance::Reboot => self.reboot(),
            Disturbance::WatchdogTrip => self.trip(),
            Disturbance::Sag(duration) => self.sags_until = self.node.now + duration,
            Disturbance::Id(id) => self.node.rename(id),
            Disturbance::Mechanics(keys) => self.set_mechanics(keys.over(self.mechanics)),
            Disturbance::Turn(deg) => self.turn(deg),
            // The photometer's.
            Disturbance::RefusedTrigger
            | Disturbance::LostAcknowledgement
            | Disturbance::Glare(_)
            | Disturbance::RoomLight(_)
            | Disturbance::Door(_) => {}
        }
    }

    /// It claims another firmware, until it restarts.
    pub(crate) fn set_firmware(&mut self, version: u8) {
        self.node.table.set(reg::FIRMWARE, version.into());
    }

    /// Friction, gears, load or encoder become others.
    pub(crate) fn set_mechanics(&mut self, mechanics: Mechanics) {
        self.mechanics = mechanics;
        if !self.torque() {
            self.stand();
        }
    }

    /// The bus watchdog: the arm stands, and goals are refused.
    fn trip(&mut self) {
        self.node.trip();
        self.stand();
    }

    /// Whether a hardware error that the Shutdown register names has taken the torque, until a reboot.
    fn shut_down(&self) -> bool {
        self.node.table.get(reg::HARDWARE_ERROR) & self.node.table.get(reg::SHUTDOWN) != 0
    }

    fn torque(&self) -> bool {
        self.node.table.get(reg::TORQUE_ENABLE) == 1
    }

    /// Counts of a turn.
    fn counts_per_turn(&self) -> f64 {
        f64::from(self.fitting.model.counts_per_turn)
    }

    /// From now on the register shows the single turn in which the shaft is.
    fn lose_turns(&mut self) {
        let shaft = self.direction() * self.shaft.at(self.node.now.as_secs_f64()).0;
        let first = f64::from(*self.fitting.model.positions().start());
        self.lost_turns = ((shaft - first) / self.counts_per_turn()).floor() * self.counts_per_turn();
    }

    /// Power comes on: turns are lost, torque is off, or on where Startup Configuration says so.
    fn start_up(&mut self) {
        self.lose_turns();
        self.node
            .table
            .set(reg::TORQUE_ENABLE, self.node.table.get(reg::STARTUP) & 1);
        self.node.hear();
        self.stand();
    }
}
