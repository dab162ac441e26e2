use std::time::Duration;

use rig::dynamixel::register::{PHOTOMETER_MODEL, Register, common, photometer};
use rig::{Counts, Detector, DetectorStatus, Device, Exposure, Gain, Identity, Phase, RigFile};

use super::{InProcessError, SharedBench};

const DEVICE: Device = Device::Photometer;

/// The photometer of the simulated rig.
#[derive(Debug)]
pub struct InProcessPhotometer {
    bench: SharedBench,
    id: u8,
    watchdog: Duration,
}

impl InProcessPhotometer {
    pub(super) fn new(bench: SharedBench, file: &RigFile) -> Self {
        Self {
            bench,
            id: file.photometer.id,
            watchdog: file.motion.watchdog,
        }
    }

    fn read(&self, register: Register) -> Result<i64, InProcessError> {
        self.bench.read(DEVICE, register)
    }

    fn write(&self, register: Register, value: i64) -> Result<(), InProcessError> {
        self.bench.write(DEVICE, register, value)
    }

    fn count(&self, register: Register) -> Result<u32, InProcessError> {
        self.read(register).map(|counts| counts as u32)
    }

    fn hardware_error(&self) -> Result<(), InProcessError> {
        match self.read(common::HARDWARE_ERROR_STATUS)? as u8 {
            0 => Ok(()),
            bits => Err(InProcessError::Hardware { device: DEVICE, bits }),
        }
    }

    fn phase(&self) -> Result<Phase, InProcessError> {
        Ok(match self.read(photometer::STATUS)? {
            0 => Phase::Idle,
            1 => Phase::Integrating,
            2 => Phase::Ready,
            _ => Phase::Saturated,
        })
    }
}

impl Detector for InProcessPhotometer {
    type Error = InProcessError;

    async fn identify(&mut self) -> Result<Identity, InProcessError> {
        let number = self.read(common::MODEL_NUMBER)?;
        if number != i64::from(PHOTOMETER_MODEL) {
            return Err(InProcessError::Mismatch {
                device: DEVICE,
                differences: vec![format!("model number is {number}, must be {PHOTOMETER_MODEL}")],
            });
        }
        self.hardware_error()?;
        Ok(Identity {
            id: self.id,
            model: "photometer".to_owned(),
            firmware: self.read(common::FIRMWARE_VERSION)? as u8,
        })
    }

    async fn lamp(&mut self, on: bool) -> Result<(), InProcessError> {
        // Also clears a watchdog that has tripped.
        self.write(common::BUS_WATCHDOG, 0)?;
        self.write(photometer::LAMP_ENABLE, i64::from(on))?;
        if !on {
            return Ok(());
        }
        self.hardware_error()?;
        self.write(common::BUS_WATCHDOG, super::watchdog_units(self.watchdog))
    }

    async fn trigger(&mut self, exposure: Exposure) -> Result<(), InProcessError> {
        let mut bytes = exposure.integration_us.to_le_bytes().to_vec();
        bytes.extend([exposure.gain as u8, 1]);
        self.bench
            .write_bytes(DEVICE, photometer::INTEGRATION_TIME, &bytes)
    }

    async fn status(&mut self) -> Result<DetectorStatus, InProcessError> {
        Ok(DetectorStatus {
            phase: self.phase()?,
            sequence: self.count(photometer::READING_SEQUENCE)?,
        })
    }

    async fn counts(&mut self) -> Result<Option<Counts>, InProcessError> {
        let phase = self.phase()?;
        if matches!(phase, Phase::Idle | Phase::Integrating) {
            return Ok(None);
        }
        let step = self.read(photometer::READING_GAIN_STEP)? as usize;
        Ok(Some(Counts {
            rgb: [
                self.count(photometer::READING_RED)?,
                self.count(photometer::READING_GREEN)?,
                self.count(photometer::READING_BLUE)?,
            ],
            monitor: self.count(photometer::READING_MONITOR)?,
            exposure: Exposure {
                integration_us: self.count(photometer::READING_INTEGRATION_TIME)?,
                gain: Gain::ALL[step],
            },
            saturated: phase == Phase::Saturated,
            sequence: self.count(photometer::READING_SEQUENCE)?,
            ticks: self.count(photometer::READING_TIME)?,
            temperature_c: self.read(photometer::TEMPERATURE)? as u8,
        }))
    }

    async fn ticks(&mut self) -> Result<u32, InProcessError> {
        self.count(photometer::PRESENT_TIME)
    }
}
