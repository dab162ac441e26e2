use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use arms::{Arm, ArmAngle, Pose};
use brdf::Brdf;
use glam::DVec3;
use pdv::Placement;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rig::{Axis, RigFile};

use crate::lamp::Lamp;
use crate::mishaps::Mishaps;
use crate::optics::Optics;
use crate::photodiodes::{Exposed, Light, Photodiodes};
use crate::photometer::{Integration, Photometer};
use crate::room::Room;
use crate::servo::Servo;
use crate::{Clock, Device, Fault, Mechanics, Mishap, Settings, SimError, baud, photometer, servo};

/// Stream of random numbers for what is drawn once; readings use the streams 0, 1, …
const ONCE: u64 = u64::MAX;
/// Stream of an instrument's first reading; the node never takes as many.
const INSTRUMENT: u64 = 1 << 48;
/// Longest stretch of a quadrature while an arm moves, s: 0.06° at 60°/s, well below an aperture.
const PANEL_S: f64 = 1e-3;
/// The same where arms only tremble, at 50 Hz at most.
const TREMBLING_PANEL_S: f64 = 5e-3;
/// Gauss–Legendre nodes and weights on −1 … 1, exact to degree 5.
const GAUSS: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

/// The simulated bench: two servos, the photometer with its lamp, and the optics over one specimen.
///
/// It knows only simulated time, which starts at 0 when power comes on. Everything that happens is an exact function
/// of when it was asked for: in how many steps time advances changes nothing.
#[derive(Debug)]
pub struct Bench {
    now: Duration,
    clock: Clock,
    axes: [Axis; 2],
    /// Where each arm really is when its encoder says 0, rad.
    zeros_rad: [f64; 2],
    servos: [Servo; 2],
    photometer: Photometer,
    photodiodes: Photodiodes,
    optics: Optics,
    mishaps: Mishaps,
    /// Since when an instrument beside the photometer integrates.
    measuring: Option<Duration>,
    /// Readings that it took.
    measured: u64,
}

impl Bench {
    /// The bench that a rig file and its `[sim]` table describe: devices set up as the file says, arms at the start
    /// pose, torque and lamp off.
    ///
    /// # Errors
    /// A `[sim]` table that is not allowed, an unknown specimen, a file that is no MERL table.
    pub fn new(rig: &RigFile) -> Result<Self, SimError> {
        let settings = Settings::new(rig)?;
        let specimen = brdf::specimen(&settings.specimen).map_err(|source| SimError::Specimen {
            name: settings.specimen.clone(),
            source,
        })?;
        Self::with_specimen(rig, specimen)
    }

    /// The same over a given specimen, whatever the `[sim]` table names.
    ///
    /// # Errors
    /// A `[sim]` table that is not allowed.
    pub fn with_specimen(rig: &RigFile, specimen: Arc<dyn Brdf>) -> Result<Self, SimError> {
        let settings = Settings::new(rig)?;
        let amounts = settings.imperfections;
        let baud_code = baud::code(rig.bus.baud).ok_or_else(|| SimError::Device {
            what: "baud rate",
            found: rig.bus.baud.to_string(),
            allowed: "9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000, 4500000".to_owned(),
        })?;
        let mut bench = Self {
            now: Duration::ZERO,
            clock: settings.clock,
            axes: Arm::BOTH.map(|arm| rig.arm(arm).axis),
            zeros_rad: [amounts.light_zero_deg, amounts.sensor_zero_deg].map(f64::to_radians),
            servos: [
                Servo::new(fitting(rig, &settings, Arm::Light, baud_code)),
                Servo::new(fitting(rig, &settings, Arm::Sensor, baud_code)),
            ],
            photometer: photometer(rig, &settings, baud_code),
            photodiodes: Photodiodes {
                calibration: rig.calibration,
                full_scale: rig.photometer.full_scale,
                imperfections: amounts,
                seed: settings.seed,
            },
            optics: Optics::new(
                specimen,
                rig.envelope,
                rig.calibration.filling,
                [amounts.source_aperture_deg, amounts.detector_aperture_deg].map(f64::to_radians),
            ),
            mishaps: Mishaps::new(settings.mishaps.clone(), settings.seed, Duration::ZERO)?,
            measuring: None,
            measured: 0,
        };
        bench.place(settings.place);
        bench.set_clock(settings.clock);
        for fault in settings.faults {
            bench.schedule(fault);
        }
        Ok(bench)
    }

    /// Puts the specimen on a wedge, or turns it, as somebody does who stands at the rig.
    pub fn place(&mut self, place: Placement) {
        self.optics.place(place);
    }

    /// Simulated time since power-on.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// How the bench keeps time behind the wire.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Changes how the bench keeps time behind the wire; the photometer's Clock register says so.
    pub fn set_clock(&mut self, clock: Clock) {
        self.clock = clock;
        self.photometer.set_wire_clock(clock == Clock::Wire);
    }

    /// Lets time pass up to `t` since power-on; earlier than now: nothing happens.
    pub fn advance_to(&mut self, t: Duration) {
        while let Some(integration) = self.photometer.integration().filter(|running| running.end <= t) {
            self.pass(integration.end);
            // A fault may have come in the way.
            if self
                .photometer
                .integration()
                .is_some_and(|running| running.end <= self.now)
            {
                let exposed = self.expose(integration);
                self.photometer.complete(exposed);
            }
        }
        self.pass(t);
        let start = self.photometer.integration().map(|running| running.start);
        let needed_s = [start, self.measuring]
            .into_iter()
            .flatten()
            .fold(self.now, Duration::min)
            .as_secs_f64();
        self.photometer.forget(needed_s);
        for servo in &mut self.servos {
            servo.forget(needed_s);
        }
    }

    fn pass(&mut self, t: Duration) {
        while let Some(fault) = self.mishaps.pop(t) {
            self.put(fault);
        }
        self.now = self.now.max(t);
        self.photometer.advance_to(t);
        for servo in &mut self.servos {
            servo.advance_to(t);
        }
    }

    /// The devices on the bus: light servo, sensor servo, photometer.
    pub fn devices(&mut self) -> [&mut dyn Device; 3] {
        let [light, sensor] = &mut self.servos;
        [light, sensor, &mut self.photometer]
    }

    /// One of the devices.
    pub fn device(&mut self, device: rig::Device) -> &mut dyn Device {
        match device {
            rig::Device::Light => &mut self.servos[0],
            rig::Device::Sensor => &mut self.servos[1],
            rig::Device::Photometer => &mut self.photometer,
        }
    }

    /// What was written to the photometer's Delay register since the last call. In wire time the caller lets that
    /// time pass before it acknowledges the write.
    pub fn take_delay(&mut self) -> Option<Duration> {
        self.photometer.take_delay()
    }

    /// Whether the photometer's write that was just carried out must not be acknowledged; forgets it.
    pub fn take_lost_acknowledgement(&mut self) -> bool {
        self.photometer.take_lost_acknowledgement()
    }

    /// When something happens by itself next: a motion, an integration or a boot ends, a watchdog trips, a fault sets
    /// in or ends. `None`: nothing will, however long one waits.
    pub fn next_event(&self) -> Option<Duration> {
        let [light, sensor] = &self.servos;
        [
            light.next_event(),
            sensor.next_event(),
            self.photometer.next_event(),
            self.mishaps.next(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Has something go wrong at a given time.
    pub fn schedule(&mut self, fault: Fault) {
        self.put(fault);
        // What is due already happens now.
        self.advance_to(self.now);
    }

    /// Gives light and sensor servo other friction, gears, load or encoders from now on.
    pub fn set_mechanics(&mut self, mechanics: [Mechanics; 2]) {
        for (servo, mechanics) in self.servos.iter_mut().zip(mechanics) {
            servo.set_mechanics(mechanics);
        }
    }

    /// Has the servo of an arm claim another firmware until it restarts, as one that was never updated.
    pub fn set_firmware(&mut self, arm: Arm, version: u8) {
        self.servos[arm as usize].set_firmware(version);
    }

    /// Changes how often mishaps happen from now on, per hour; those that are not named do not happen any more.
    ///
    /// # Errors
    /// A rate out of its range, 0 … 3600 per hour.
    pub fn set_mishaps(&mut self, rates: BTreeMap<Mishap, f64>) -> Result<(), SimError> {
        self.mishaps = Mishaps::new(rates, self.photodiodes.seed, self.now)?;
        Ok(())
    }

    /// Somebody switches off the light of the room and closes the door: what shines from outside ends.
    pub fn darken(&mut self) {
        self.photometer.darken();
    }

    fn put(&mut self, fault: Fault) {
        match fault.device {
            rig::Device::Light => self.servos[0].schedule(fault.at, fault.what),
            rig::Device::Sensor => self.servos[1].schedule(fault.at, fault.what),
            rig::Device::Photometer => self.photometer.schedule(fault.at, fault.what),
        }
    }

    /// Where the arms really are, behind lag and backlash.
    pub fn pose(&self) -> Pose {
        self.pose_at(self.now.as_secs_f64())
    }

    fn pose_at(&self, t_s: f64) -> Pose {
        let angle = |i: usize| {
            let shown = self.axes[i].angle(self.servos[i].arm(t_s));
            ArmAngle::from_rad(shown.rad() + self.zeros_rad[i])
        };
        Pose {
            light: angle(0),
            sensor: angle(1),
        }
    }

    /// An instrument that looks at the same light begins to integrate now.
    pub fn begin_measuring(&mut self) {
        self.measuring = Some(self.now);
    }

    /// What it has integrated since, until a time that has passed: counts of the green photodiode at gain ×1, not whole
    /// ones, and without the node's converter and its offset. `None` where it did not begin.
    pub fn end_measuring(&mut self, duration: Duration) -> Option<f64> {
        let from = self.measuring.take()?;
        let (from_s, to_s) = (from.as_secs_f64(), (from + duration).min(self.now).as_secs_f64());
        if to_s <= from_s {
            return Some(0.0);
        }
        let light = self.light(from_s, to_s, 1.0);
        self.measured += 1;
        Some(self.photodiodes.photocurrent(light, INSTRUMENT + self.measured))
    }

    fn expose(&self, integration: Integration) -> Exposed {
        let (from_s, to_s) = (integration.start.as_secs_f64(), integration.end.as_secs_f64());
        let gain = rig::Gain::ALL[usize::from(integration.gain_step)].factor();
        let light = self.light(from_s, to_s, gain);
        let mut exposed = self.photodiodes.expose(light, integration.serial);
        if self.photometer.glares() {
            exposed.rgb = [self.photodiodes.full_scale; 3];
            exposed.saturated = true;
        }
        exposed
    }

    fn light(&self, from_s: f64, to_s: f64, gain: f64) -> Light {
        Light {
            signal: self.collect(from_s, to_s),
            lamp_s: self.photometer.lamp().integral(from_s, to_s),
            room_s: self.photometer.room().integral(from_s, to_s),
            duration_s: to_s - from_s,
            gain,
            temperature_c: self.photometer.temperature_c((from_s + to_s) / 2.0),
        }
    }

    /// ∫ lamp · f · cos dt, s/sr: exact while the arms rest, by quadrature between the breaks of their motion
    /// otherwise.
    fn collect(&self, from_s: f64, to_s: f64) -> DVec3 {
        let [light, sensor] = &self.servos;
        let lamp = self.photometer.lamp();
        let mut knots: Vec<f64> = [from_s, to_s]
            .into_iter()
            .chain(light.breaks(from_s, to_s))
            .chain(sensor.breaks(from_s, to_s))
            .chain(lamp.breaks(from_s, to_s))
            .collect();
        knots.sort_by(f64::total_cmp);
        let stretches = knots.windows(2).map(|ends| (ends[0], ends[1]));
        stretches
            .map(|(from, to)| {
                if light.rests(from, to) && sensor.rests(from, to) {
                    return self.optics.signal(self.pose_at(from)) * lamp.integral(from, to);
                }
                let led = [light, sensor]
                    .into_iter()
                    .any(|servo| !servo.leads_nowhere(from, to));
                let panels = ((to - from) / if led { PANEL_S } else { TREMBLING_PANEL_S }).ceil();
                let half = (to - from) / panels / 2.0;
                let middles = (0..panels as usize).map(|panel| from + half * (2 * panel + 1) as f64);
                let nodes =
                    middles.flat_map(|middle| GAUSS.map(|(x, weight)| (middle + half * x, weight * half)));
                nodes
                    .map(|(t, weight)| self.optics.signal(self.pose_at(t)) * (lamp.level(t) * weight))
                    .sum()
            })
            .sum()
    }
}

fn photometer(rig: &RigFile, settings: &Settings, baud_code: u8) -> Photometer {
    let amounts = settings.imperfections;
    let mut once = ChaCha8Rng::seed_from_u64(settings.seed);
    once.set_stream(ONCE);
    let warm_up_s = amounts.lamp_warm_up.as_secs_f64();
    let fitting = photometer::Fitting {
        id: rig.photometer.id,
        baud_code,
        boot: settings.boot,
        ambient_c: settings.ambient_c,
        self_heating_c: amounts.self_heating_c,
    };
    let lamp = Lamp::new(warm_up_s, amounts.lamp_drift, amounts.lamp_flicker, &mut once)
        .with_trend(amounts.lamp_trend_per_h);
    let mut room = Room::default();
    room.light(
        0.0,
        f64::INFINITY,
        amounts.room_light_per_sr,
        amounts.room_flicker_hz,
    );
    Photometer::new(fitting, lamp, room)
}

fn fitting(rig: &RigFile, settings: &Settings, arm: Arm, baud_code: u8) -> servo::Fitting {
    let file = rig.arm(arm);
    let limits = rig.envelope.limits(arm);
    let ends = [limits.min, limits.max].map(|angle| file.axis.counts(angle));
    let backlash_deg = match arm {
        Arm::Light => settings.imperfections.light_backlash_deg,
        Arm::Sensor => settings.imperfections.sensor_backlash_deg,
    };
    servo::Fitting {
        model: file.model,
        id: file.id,
        baud_code,
        return_delay: file.return_delay,
        limits: [ends[0].min(ends[1]), ends[0].max(ends[1])],
        start: file.axis.counts(settings.start.angle(arm)).round(),
        backlash: backlash_deg.to_radians() / file.axis.resolution_rad(),
        lag: settings.imperfections.following_lag,
        axis: file.axis,
        mechanics: settings.mechanics[arm as usize],
        seed: settings.seed ^ (arm as u64) << 32,
        boot: settings.boot,
        ambient_c: settings.ambient_c,
    }
}
