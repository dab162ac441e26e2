//! The servos that a rig may have, as data: the driver, the check of the rig file, the doctor and the simulator read
//! this one table. One more model is one more row.
//!
//! Sources, model by model: the control tables of the ROBOTIS e-manual (emanual.robotis.com, a page for each model) for
//! initial values, ranges and units, and the `.model` files of ROBOTIS' dynamixel_hardware_interface 1.5.1
//! (`param/dxl_model`) for model numbers, addresses and which registers exist. Where a page of the e-manual differs from
//! the `.model` files (XD430: it prints the numbers of the XH430), the latter hold. Initial values differ between
//! firmwares: they are what a simulated servo starts with, and the driver reads those of a real one.

use std::ops::RangeInclusive;

use super::register::Register;
use crate::ServoUnits;

mod rows;
mod series;

pub use rows::MODELS;
pub use series::{Indirect, Series};

/// One model of servo.
#[derive(Debug, PartialEq)]
pub struct Model {
    /// Its name without the bus, such as "XM430-W350": the -T and -R on the box say whether it is wired as TTL or RS-485.
    pub name: &'static str,
    /// Its model number.
    pub number: u16,
    /// Where its registers are, and what is common to its series.
    pub series: &'static Series,
    /// Encoder counts per turn.
    pub counts_per_turn: u32,
    /// Recommended supply, V.
    pub supply_v: f64,
    /// Min and Max Voltage Limit, initial values, 0.1 V: the supply that it takes.
    pub voltage_limits: [u16; 2],
    /// Smallest value that its voltage limits may have, 0.1 V.
    pub voltage_least: u16,
    /// Temperature Limit, initial value, °C.
    pub temperature_limit_c: u8,
    /// Current Limit, initial value and maximum; none where it has no current registers.
    pub current_limit: Option<u16>,
    /// Acceleration Limit, initial value; none where it has no such register.
    pub acceleration_limit: Option<u32>,
    /// Largest value of an acceleration register.
    pub acceleration_max: u32,
    /// Velocity Limit, initial value.
    pub velocity_limit: u32,
    /// Largest value of a velocity register.
    pub velocity_max: u32,
    /// Min and Max Position Limit, initial values, counts.
    pub position_limits: [i32; 2],
    /// Operating modes that it has.
    pub modes: &'static [u8],
    /// Shutdown, initial value.
    pub shutdown: u8,
    /// Gains, initial values: velocity I and P; position D, I and P.
    pub gains: [u16; 5],
    /// LEDs, a register each.
    pub leds: u16,
    /// Ports for other devices, with two registers each.
    pub external_ports: u16,
}

impl Model {
    /// The model of a name, with or without the bus that it is wired for: "XM430-W350", "XM430-W350-T", "MX-28AR".
    pub fn named(name: &str) -> Option<&'static Self> {
        MODELS.iter().find(|model| {
            let bus = name.strip_prefix(model.name);
            bus.is_some_and(|bus| bus.is_empty() || model.series.buses.contains(&bus))
        })
    }

    /// The model of a model number.
    pub fn numbered(number: u16) -> Option<&'static Self> {
        MODELS.iter().find(|model| model.number == number)
    }

    /// Positions within the single turn of position mode, counts.
    pub fn positions(&self) -> RangeInclusive<i32> {
        let counts = self.counts_per_turn.cast_signed();
        match self.series.centred {
            true => -counts / 2..=counts / 2,
            false => 0..=counts - 1,
        }
    }

    /// Homing offsets beyond this are ignored in position mode, counts: a quarter of a turn (e-manual, "Homing Offset").
    pub fn homing_offset_max(&self) -> i32 {
        self.counts_per_turn.cast_signed() / 4
    }

    /// Supply between which it works, V.
    pub fn voltage_v(&self) -> RangeInclusive<f64> {
        let [min, max] = self.voltage_limits.map(|limit| f64::from(limit) / 10.0);
        min..=max
    }

    /// Supply below which a run is held by default, and from which on it goes on, V: 7/8 and 11/12 of the recommended
    /// one, which leaves a 12 V servo 1 V above what it complains of.
    pub fn supply_bounds_v(&self) -> [f64; 2] {
        [7.0 / 8.0, 11.0 / 12.0].map(|share| (self.supply_v * share * 10.0).round() / 10.0)
    }

    /// Where it has a register of the X series.
    pub fn at(&self, register: Register) -> Register {
        self.series.at(register)
    }

    /// What its counts and its velocity and acceleration registers mean.
    pub fn units(&self) -> ServoUnits {
        ServoUnits::new(
            self.counts_per_turn,
            self.series.velocity_unit_rpm,
            self.series.acceleration_unit_rpm2,
            self.velocity_max,
            self.acceleration_max,
        )
    }
}

#[cfg(test)]
mod tests;
