use std::future::Future;
use std::time::Duration;

use arms::{Arm, Pose};

use crate::{Actuator, Counts, Detector, DetectorStatus, Fault, Location, Surroundings};

/// The whole rig at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// Light and sensor arm.
    pub arms: [Location; 2],
    /// The photometer.
    pub detector: DetectorStatus,
}

impl Snapshot {
    /// Where both arms are, measured.
    pub fn pose(&self) -> Pose {
        Pose {
            light: self.arms[0].measured,
            sensor: self.arms[1].measured,
        }
    }
}

/// The whole rig at one moment of the photometer's clock, with its latest reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Arms and photometer.
    pub snapshot: Snapshot,
    /// The photometer's clock at that moment, in ticks of 10 µs, 24 bits, wraps.
    pub ticks: u32,
    /// The latest reading; `None` before the first trigger and while one is being taken.
    pub counts: Option<Counts>,
}

/// Two arms and a photometer.
pub trait Rig: Send {
    /// What goes wrong.
    type Error: Fault;
    /// One axis.
    type Axis: Actuator<Error = Self::Error>;
    /// The photometer.
    type Photometer: Detector<Error = Self::Error>;

    /// One of the axes.
    fn axis(&mut self, arm: Arm) -> &mut Self::Axis;

    /// The photometer.
    fn photometer(&mut self) -> &mut Self::Photometer;

    /// Sets both arms off together towards a pose (one sync write, which no device acknowledges). That it arrived
    /// shows in the goals of the next snapshot.
    ///
    /// # Errors
    /// Port gone.
    fn start(&mut self, goals: Pose) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Both positions, their state and the photometer's status, in as few transactions as the bus allows.
    ///
    /// # Errors
    /// No reply from one of them.
    fn snapshot(&mut self) -> impl Future<Output = Result<Snapshot, Self::Error>> + Send;

    /// As [`Rig::snapshot`], with the photometer's clock and its latest reading, all in the same transaction: what a
    /// capture in flight puts together by time.
    ///
    /// # Errors
    /// No reply from one of them.
    fn observe(&mut self) -> impl Future<Output = Result<Observation, Self::Error>> + Send;

    /// Supply, temperatures, door.
    ///
    /// # Errors
    /// No reply from one of them.
    fn surroundings(&mut self) -> impl Future<Output = Result<Surroundings, Self::Error>> + Send;

    /// Lets time pass: sleeps on a real bus, tells a simulated one in wire time to advance its clock.
    ///
    /// # Errors
    /// Port gone.
    fn wait(&mut self, duration: Duration) -> impl Future<Output = Result<(), Self::Error>> + Send;
}
