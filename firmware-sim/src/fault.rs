use std::collections::VecDeque;
use std::time::Duration;

/// Something that goes wrong with a device at a given moment of simulated time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Which device.
    pub device: rig::Device,
    /// When, since power-on; what lies in the past happens at once.
    pub at: Duration,
    /// What.
    pub what: Disturbance,
}

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Disturbance {
    /// The device neither hears nor answers for so long; what it was doing goes on.
    Silence(Duration),
    /// Bits of Hardware Error Status, such as [`OVERLOAD`](Self::OVERLOAD), appear and stay until a reboot. Where the
    /// servo's Shutdown register names one of them torque goes off; any of them puts the photometer's lamp out.
    HardwareError(u8),
    /// The shaft of a servo is stuck for so long, while its profile goes on.
    Stall(Duration),
    /// The photometer refuses the next trigger (Result Fail).
    RefusedTrigger,
    /// The photometer's next write is carried out and not acknowledged.
    LostAcknowledgement,
    /// The device's supply sags for a moment: it restarts, and its RAM is lost.
    Reboot,
}

impl Disturbance {
    /// Overload, which shuts a servo down.
    pub const OVERLOAD: Self = Self::HardwareError(1 << 5);
    /// Overheating, which shuts a servo down.
    pub const OVERHEATING: Self = Self::HardwareError(1 << 2);
    /// Supply voltage: a servo goes on with its Alert bit set.
    pub const ALERT: Self = Self::HardwareError(1);
}

/// Disturbances to come, earliest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Schedule(VecDeque<(Duration, Disturbance)>);

impl Schedule {
    pub(crate) fn push(&mut self, at: Duration, what: Disturbance) {
        let place = self.0.partition_point(|&(earlier, _)| earlier <= at);
        self.0.insert(place, (at, what));
    }

    pub(crate) fn next(&self) -> Option<Duration> {
        self.0.front().map(|&(at, _)| at)
    }

    /// The first one, where it is due at `now`.
    pub(crate) fn pop(&mut self, now: Duration) -> Option<Disturbance> {
        self.0.pop_front_if(|(at, _)| *at <= now).map(|(_, what)| what)
    }
}
