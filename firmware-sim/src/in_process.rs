//! The simulated bench as a [`rig::Rig`] over tokio time, without a wire.
//!
//! Its clock is the bench's: [`Rig::wait`] lets exactly the time pass that was asked for, while tokio's timers round
//! up to 1 ms. Time that passes elsewhere (a pause of the caller, a busy host) reaches the bench with the next
//! request. Under `tokio::time::pause` a whole capture takes milliseconds and is the same for the same seed.

mod axis;
mod error;
mod photometer;
#[cfg(test)]
mod tests;
mod written;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use arms::{Arm, Pose};
use rig::dynamixel::register::{self, Register, servo};
use rig::{Detector, Device, Observation, Rig, RigFile, Snapshot, Surroundings};
use tokio::time::Instant;

pub use axis::InProcessAxis;
pub use error::InProcessError;
pub use photometer::InProcessPhotometer;
pub use written::Written;

use crate::{Bench, Fault, Refusal, SimError};

/// By how much tokio's clock may run ahead of the bench: its timers round up to whole milliseconds of its own, and one
/// is fired up to a millisecond after that.
const TIMER_GRAIN: Duration = Duration::from_millis(2);

/// The simulated rig; must be made and used within a tokio runtime with time.
#[derive(Debug)]
pub struct InProcessRig {
    bench: SharedBench,
    axes: [InProcessAxis; 2],
    photometer: InProcessPhotometer,
}

impl InProcessRig {
    /// The rig that a rig file and its `[sim]` table describe, with power coming on now.
    ///
    /// # Errors
    /// As [`Bench::new`].
    pub fn new(file: &RigFile) -> Result<Self, SimError> {
        Ok(Self::over(Bench::new(file)?, file))
    }

    /// The rig over a bench made from the same rig file.
    pub fn over(bench: Bench, file: &RigFile) -> Self {
        let bench = SharedBench {
            switched_on: Instant::now() - bench.now(),
            bench: Arc::new(Mutex::new(bench)),
            written: Arc::default(),
        };
        bench.rig(file)
    }

    /// The bench behind it, to be looked at and tampered with from elsewhere.
    pub fn bench(&self) -> SharedBench {
        self.bench.clone()
    }
}

impl Rig for InProcessRig {
    type Error = InProcessError;
    type Axis = InProcessAxis;
    type Photometer = InProcessPhotometer;

    fn axis(&mut self, arm: Arm) -> &mut InProcessAxis {
        &mut self.axes[arm as usize]
    }

    fn photometer(&mut self) -> &mut InProcessPhotometer {
        &mut self.photometer
    }

    async fn start(&mut self, goals: Pose) -> Result<(), InProcessError> {
        for arm in Arm::BOTH {
            let goal = self.axes[arm as usize].counts(goals.angle(arm));
            // As with a sync write nobody says whether it was taken.
            let _unacknowledged = self.bench.write(arm.into(), servo::GOAL_POSITION, goal);
        }
        Ok(())
    }

    async fn snapshot(&mut self) -> Result<Snapshot, InProcessError> {
        Ok(Snapshot {
            arms: [self.axes[0].look()?, self.axes[1].look()?],
            detector: self.photometer.status().await?,
        })
    }

    async fn observe(&mut self) -> Result<Observation, InProcessError> {
        Ok(Observation {
            snapshot: self.snapshot().await?,
            ticks: self.photometer.ticks().await?,
            counts: self.photometer.counts().await?,
        })
    }

    async fn surroundings(&mut self) -> Result<Surroundings, InProcessError> {
        let read = |device, register| self.bench.read(device, register).map(|value| value as f64);
        let servo = |register| {
            let [light, sensor] = [Device::Light, Device::Sensor].map(|device| read(device, register));
            Ok::<_, InProcessError>([light?, sensor?])
        };
        let [light_c, sensor_c] = servo(servo::PRESENT_TEMPERATURE)?;
        Ok(Surroundings {
            supply_v: servo(servo::PRESENT_INPUT_VOLTAGE)?.map(|tenths| tenths / 10.0),
            temperature_c: [
                light_c,
                sensor_c,
                read(Device::Photometer, register::photometer::TEMPERATURE)?,
            ],
            door_open: self.bench.read(Device::Photometer, register::photometer::DOOR)? == 1,
        })
    }

    async fn wait(&mut self, duration: Duration) -> Result<(), InProcessError> {
        let until = self.bench.lock().now() + duration;
        tokio::time::sleep_until(self.bench.switched_on + until).await;
        self.bench.advance_to(until);
        Ok(())
    }
}

/// A handle to the bench behind an in-process rig.
#[derive(Clone, Debug)]
pub struct SharedBench {
    bench: Arc<Mutex<Bench>>,
    switched_on: Instant,
    /// What devices were told, where somebody wants to know.
    written: Arc<Mutex<Option<Vec<Written>>>>,
}

impl SharedBench {
    /// A rig over this bench, as a program that is started anew opens the port of devices that live on.
    pub fn rig(&self, file: &RigFile) -> InProcessRig {
        let axis = |arm| InProcessAxis::new(self.clone(), file, arm);
        InProcessRig {
            axes: Arm::BOTH.map(axis),
            photometer: InProcessPhotometer::new(self.clone(), file),
            bench: self.clone(),
        }
    }

    /// Keeps every write that reaches a device from now on.
    pub fn keep_writes(&self) {
        self.log().get_or_insert_default();
    }

    /// The writes that were kept, oldest first.
    pub fn writes(&self) -> Vec<Written> {
        self.log().clone().unwrap_or_default()
    }

    /// How many writes were kept so far.
    pub fn write_count(&self) -> usize {
        self.log().as_ref().map_or(0, Vec::len)
    }

    fn log(&self) -> MutexGuard<'_, Option<Vec<Written>>> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Simulated time since power-on.
    pub fn now(&self) -> Duration {
        self.lock().now()
    }

    /// Where the arms really are, behind lag and backlash.
    pub fn pose(&self) -> Pose {
        self.lock().pose()
    }

    /// Has something go wrong at a given time.
    pub fn schedule(&self, fault: Fault) {
        self.lock().schedule(fault);
    }

    /// Restarts a device, as switching its power off and on does.
    pub fn reboot(&self, device: Device) {
        self.lock().device(device).reboot();
    }

    /// Somebody switches off the light of the room and closes the door: what shines from outside ends.
    pub fn darken(&self) {
        self.lock().darken();
    }

    /// Reads a register past the bus, as a debugger would: the device does not notice.
    ///
    /// # Errors
    /// The table has no such address.
    pub fn peek(&self, device: Device, register: Register) -> Result<i64, Refusal> {
        let bytes = self.lock().device(device).read(register.address, register.size)?;
        Ok(decode(&bytes))
    }

    /// Writes a register past the bus, as another program would: the device does not notice.
    ///
    /// # Errors
    /// The device refuses it.
    pub fn poke(&self, device: Device, register: Register, value: i64) -> Result<(), Refusal> {
        let bytes = &value.to_le_bytes()[..usize::from(register.size)];
        self.lock().device(device).write(register.address, bytes)
    }

    /// Lets a wait end when it was to end, and not when its timer fired.
    fn advance_to(&self, until: Duration) {
        self.alone().advance_to(until);
    }

    fn alone(&self) -> MutexGuard<'_, Bench> {
        self.bench.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The bench at the present moment.
    fn lock(&self) -> MutexGuard<'_, Bench> {
        let mut bench = self.alone();
        let elapsed = self.switched_on.elapsed();
        if elapsed > bench.now() + TIMER_GRAIN {
            bench.advance_to(elapsed);
        }
        bench
    }

    fn read(&self, device: Device, register: Register) -> Result<i64, InProcessError> {
        let mut bench = self.lock();
        hear(&mut bench);
        let asked = bench.device(device);
        let what = register.name;
        if !asked.listens() {
            return Err(InProcessError::NoReply { device, what });
        }
        match asked.read(asked.place(register.address), register.size) {
            Ok(bytes) => Ok(decode(&bytes)),
            Err(refusal) => Err(InProcessError::Refused {
                device,
                what,
                refusal,
            }),
        }
    }

    fn write(&self, device: Device, register: Register, value: i64) -> Result<(), InProcessError> {
        let bytes = &value.to_le_bytes()[..usize::from(register.size)];
        self.write_bytes(device, register, bytes)
    }

    /// Writes a stretch that begins with a register.
    fn write_bytes(&self, device: Device, first: Register, bytes: &[u8]) -> Result<(), InProcessError> {
        let mut bench = self.lock();
        let at = bench.now();
        hear(&mut bench);
        let asked = bench.device(device);
        let what = first.name;
        if !asked.listens() {
            return Err(InProcessError::NoReply { device, what });
        }
        if let Some(written) = self.log().as_mut() {
            written.push(Written::new(at, device, asked, first.address, bytes));
        }
        asked
            .write(asked.place(first.address), bytes)
            .map_err(|refusal| InProcessError::Refused {
                device,
                what,
                refusal,
            })?;
        match device == Device::Photometer && bench.take_lost_acknowledgement() {
            true => Err(InProcessError::NoReply { device, what }),
            false => Ok(()),
        }
    }
}

/// Every request is one that all devices hear, as on a bus.
fn hear(bench: &mut Bench) {
    for device in bench.devices() {
        if device.listens() {
            device.heard();
        }
    }
}

/// A register's value: 4 bytes are signed, fewer are not.
fn decode(bytes: &[u8]) -> i64 {
    match bytes.try_into() {
        Ok(four) => i64::from(i32::from_le_bytes(four)),
        Err(_) => bytes
            .iter()
            .rev()
            .fold(0, |value, &byte| value << 8 | i64::from(byte)),
    }
}

/// Units of a Bus Watchdog register.
fn watchdog_units(watchdog: Duration) -> i64 {
    (watchdog.as_millis() / 20) as i64
}
