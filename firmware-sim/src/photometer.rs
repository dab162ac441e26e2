mod device;
mod registers;
#[cfg(test)]
mod tests;

use std::time::Duration;

use registers as reg;

use crate::Device;
use crate::fault::Disturbance;
use crate::lamp::Lamp;
use crate::node::Node;
use crate::photodiodes::Exposed;
use crate::room::Room;
use crate::table::Table;

/// Values of Status.
const INTEGRATING: i64 = 1;
const READY: i64 = 2;
const SATURATED: i64 = 3;

/// How the photometer leaves the workshop.
#[derive(Clone, Debug)]
pub(crate) struct Fitting {
    pub(crate) id: u8,
    pub(crate) baud_code: u8,
    pub(crate) boot: Duration,
    pub(crate) ambient_c: f64,
    /// By how much it becomes warmer than the room, °C.
    pub(crate) self_heating_c: f64,
}

/// A running integration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Integration {
    pub(crate) start: Duration,
    pub(crate) end: Duration,
    pub(crate) gain_step: u8,
    /// Integrations since the bench was built: the stream from which its noise is drawn.
    pub(crate) serial: u64,
}

/// The photometer node with its lamp.
#[derive(Debug)]
pub(crate) struct Photometer {
    fitting: Fitting,
    node: Node,
    lamp: Lamp,
    room: Room,
    /// When its clock read 0.
    booted: Duration,
    glare_until: Duration,
    door_until: Duration,
    integration: Option<Integration>,
    triggers: u64,
    delay: Option<Duration>,
    refuses_trigger: bool,
    loses_acknowledgement: bool,
}

impl Photometer {
    pub(crate) fn new(fitting: Fitting, lamp: Lamp, room: Room) -> Self {
        let table = Table::new(reg::REGISTERS.to_vec());
        Self {
            node: Node::new(table, fitting.id, fitting.baud_code),
            fitting,
            lamp,
            room,
            booted: Duration::ZERO,
            glare_until: Duration::ZERO,
            door_until: Duration::ZERO,
            integration: None,
            triggers: 0,
            delay: None,
            refuses_trigger: false,
            loses_acknowledgement: false,
        }
    }

    pub(crate) fn lamp(&self) -> &Lamp {
        &self.lamp
    }

    pub(crate) fn room(&self) -> &Room {
        &self.room
    }

    /// Ends all light from outside.
    pub(crate) fn darken(&mut self) {
        self.glare_until = self.node.now.min(self.glare_until);
        self.room.darken(self.node.now.as_secs_f64());
    }

    pub(crate) fn integration(&self) -> Option<Integration> {
        self.integration
    }

    /// °C at a moment: it warms up with a time constant of ten minutes.
    pub(crate) fn temperature_c(&self, t_s: f64) -> f64 {
        self.fitting.ambient_c - self.fitting.self_heating_c * (-t_s / 600.0).exp_m1()
    }

    pub(crate) fn set_wire_clock(&mut self, wire: bool) {
        self.node.table.set(reg::CLOCK, i64::from(wire));
    }

    pub(crate) fn take_delay(&mut self) -> Option<Duration> {
        self.delay.take()
    }

    pub(crate) fn take_lost_acknowledgement(&mut self) -> bool {
        std::mem::take(&mut self.loses_acknowledgement)
    }

    pub(crate) fn schedule(&mut self, at: Duration, what: Disturbance) {
        self.node.faults.push(at, what);
    }

    /// When something happens by itself next.
    pub(crate) fn next_event(&self) -> Option<Duration> {
        let [deaf, silent] = self.node.wakes();
        [deaf, silent, self.glare_until, self.door_until]
            .map(Some)
            .into_iter()
            .chain([
                self.watchdog(),
                self.node.faults.next(),
                self.integration.map(|running| running.end),
            ])
            .flatten()
            .filter(|&at| at > self.node.now)
            .min()
    }

    fn watchdog(&self) -> Option<Duration> {
        self.node.watchdog(self.lamp.on())
    }

    /// Lets time pass. The bench completes an integration that ends meanwhile, before it asks for more.
    pub(crate) fn advance_to(&mut self, t: Duration) {
        while let Some(at) = [self.watchdog(), self.node.faults.next()]
            .into_iter()
            .flatten()
            .min()
            .filter(|&at| at <= t)
        {
            self.node.now = self.node.now.max(at);
            if self.watchdog() == Some(at) {
                self.trip();
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
                self.switch_lamp(false);
            }
            Disturbance::RefusedTrigger => self.refuses_trigger = true,
            Disturbance::LostAcknowledgement => self.loses_acknowledgement = true,
            Disturbance::Reboot => self.reboot(),
            Disturbance::WatchdogTrip => self.trip(),
            Disturbance::Stall(duration) => {
                if let Some(integration) = &mut self.integration {
                    integration.end += duration;
                }
            }
            Disturbance::Door(duration) => self.door_until = self.node.now + duration,
            Disturbance::Glare(duration) => self.glare_until = self.node.now + duration,
            Disturbance::RoomLight(light) => {
                let now_s = self.node.now.as_secs_f64();
                let to_s = now_s + light.duration.as_secs_f64();
                self.room.light(now_s, to_s, light.per_sr, light.flicker_hz);
            }
            Disturbance::Id(id) => self.node.rename(id),
            // A servo's.
            Disturbance::Sag(_) | Disturbance::Mechanics(_) | Disturbance::Turn(_) => {}
        }
    }

    /// The bus watchdog: the lamp is out, and stays out.
    fn trip(&mut self) {
        self.node.trip();
        self.switch_lamp(false);
    }

    /// Whether light from outside fills every channel.
    pub(crate) fn glares(&self) -> bool {
        self.node.now < self.glare_until
    }

    fn switch_lamp(&mut self, on: bool) {
        self.lamp.switch(self.node.now.as_secs_f64(), on);
        self.node.table.set(reg::LAMP_ENABLE, i64::from(on));
    }

    fn trigger(&mut self) {
        let integration = Duration::from_micros(self.node.table.get(reg::INTEGRATION_TIME) as u64);
        self.integration = Some(Integration {
            start: self.node.now,
            end: self.node.now + integration,
            gain_step: self.node.table.get(reg::GAIN_STEP) as u8,
            serial: self.triggers,
        });
        self.triggers += 1;
        let sequence = (self.node.table.get(reg::SEQUENCE) + 1) % reg::MODULUS as i64;
        self.node.table.set(reg::SEQUENCE, sequence);
        self.node.table.set(reg::STATUS, INTEGRATING);
    }

    /// Ends the running integration with what it collected.
    pub(crate) fn complete(&mut self, exposed: Exposed) {
        let Some(done) = self.integration.take() else {
            return;
        };
        let middle = done.start + (done.end - done.start) / 2;
        let values = [
            (reg::READING_GAIN, i64::from(done.gain_step)),
            (
                reg::READING_INTEGRATION,
                (done.end - done.start).as_micros() as i64,
            ),
            (reg::RED, i64::from(exposed.rgb[0])),
            (reg::GREEN, i64::from(exposed.rgb[1])),
            (reg::BLUE, i64::from(exposed.rgb[2])),
            (reg::MONITOR, i64::from(exposed.monitor)),
            (reg::DEVICE_TIME, self.ticks(middle)),
            (reg::STATUS, if exposed.saturated { SATURATED } else { READY }),
        ];
        for (register, value) in values {
            self.node.table.set(register, value);
        }
    }

    /// The node's clock at a moment, 10 µs, 24 bits.
    fn ticks(&self, t: Duration) -> i64 {
        let ticks = t.saturating_sub(self.booted).as_micros() as u64 / 10;
        (ticks % reg::MODULUS) as i64
    }

    /// Lets go of light that went out before a moment.
    pub(crate) fn forget(&mut self, before_s: f64) {
        self.lamp.forget(before_s);
        self.room.forget(before_s);
    }
}
