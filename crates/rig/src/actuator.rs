use std::future::Future;

use arms::{ArmAngle, Profile};
use serde::{Deserialize, Serialize};

use crate::Fault;

/// What a device says of itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Bus id.
    pub id: u8,
    /// Model name, such as "XM430-W350".
    pub model: String,
    /// Firmware version.
    pub firmware: u8,
}

/// Setpoint and readback of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Location {
    /// Where the axis was last told to go.
    pub goal: ArmAngle,
    /// Where it is, measured.
    pub measured: ArmAngle,
    /// The servo's own in-position bit.
    pub in_position: bool,
    /// Whether a motion is in progress.
    pub moving: bool,
    /// Whether the motor holds or moves the arm; off after a reboot or a hardware error.
    pub torque: bool,
    /// Hardware error bits (X-series register 70).
    pub hardware_error: u8,
}

/// One servo axis. Few verbs; limits, settling and retries stand above it.
pub trait Actuator: Send {
    /// What goes wrong.
    type Error: Fault;

    /// Reads who the device is and compares model, modes, limits, return delay and drive mode with the rig file;
    /// moves nothing and writes nothing.
    ///
    /// # Errors
    /// No reply, or each difference with how to mend it.
    fn identify(&mut self) -> impl Future<Output = Result<Identity, Self::Error>> + Send;

    /// Makes the axis ready to move: profile and bus watchdog set, torque on, goal at the present position, so that
    /// nothing moves. Also re-applies what a reboot of the servo lost.
    ///
    /// # Errors
    /// No reply, refusal, hardware error.
    fn engage(&mut self, profile: Profile) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Goes to a goal, or on to it, on another profile; an arm that moves is braked or sped up without a stop. The
    /// profile stays until the next one.
    ///
    /// # Errors
    /// No reply, refusal, hardware error.
    fn steer(
        &mut self,
        goal: ArmAngle,
        profile: Profile,
    ) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Setpoint and readback.
    ///
    /// # Errors
    /// No reply.
    fn location(&mut self) -> impl Future<Output = Result<Location, Self::Error>> + Send;

    /// Decelerates on the profile: the goal becomes present position ± v²/2a in the direction of motion. An arm that stands
    /// keeps its goal.
    ///
    /// # Errors
    /// No reply, refusal.
    fn stop(&mut self) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Emergency stop: profile off, then goal := present position, or torque off as the rig file says.
    ///
    /// # Errors
    /// No reply.
    fn halt(&mut self) -> impl Future<Output = Result<(), Self::Error>> + Send;

    /// Disarms the bus watchdog and leaves the arm holding where it is, or limp as the rig file says.
    ///
    /// # Errors
    /// No reply.
    fn disengage(&mut self) -> impl Future<Output = Result<(), Self::Error>> + Send;
}
