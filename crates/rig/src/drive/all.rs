use arms::Arm;

use super::retry::Patience;
use super::{Drive, DriveError};
use crate::{Actuator, Detector, Device, FaultKind, Identity, Rig};

/// What is done to every device, whatever happens to the others.
#[derive(Clone, Copy)]
enum Verb {
    Stop,
    Halt,
    Disengage,
}

impl<R: Rig> Drive<R> {
    /// Reads who answers and whether it is as the rig file says: light servo, sensor servo, photometer. Moves and
    /// switches nothing.
    ///
    /// # Errors
    /// The first device that is silent, ill or different.
    pub async fn identify_all(&mut self) -> Result<[Identity; 3], DriveError<R::Error>> {
        let light = self.identify(Device::Light).await?;
        let sensor = self.identify(Device::Sensor).await?;
        let photometer = self.identify(Device::Photometer).await?;
        Ok([light, sensor, photometer])
    }

    /// Reads who one device is and whether it is as the rig file says. Moves and switches nothing.
    ///
    /// # Errors
    /// It is silent, ill or different.
    pub async fn identify(&mut self, device: Device) -> Result<Identity, DriveError<R::Error>> {
        match device {
            Device::Light => {
                self.retry("identify the light servo", |rig| {
                    Box::pin(rig.axis(Arm::Light).identify())
                })
                .await
            }
            Device::Sensor => {
                self.retry("identify the sensor servo", |rig| {
                    Box::pin(rig.axis(Arm::Sensor).identify())
                })
                .await
            }
            Device::Photometer => {
                self.retry("identify the photometer", |rig| {
                    Box::pin(rig.photometer().identify())
                })
                .await
            }
        }
    }

    /// Makes both arms ready to move, without moving them.
    ///
    /// # Errors
    /// A servo that is silent or ill.
    pub async fn engage_all(&mut self) -> Result<(), DriveError<R::Error>> {
        for arm in Arm::BOTH {
            let profile = self.file.arm(arm).profile;
            self.retry("engage an arm", |rig| Box::pin(rig.axis(arm).engage(profile)))
                .await?;
        }
        self.engaged = true;
        Ok(())
    }

    /// Lamp off, and both arms decelerate on their profiles and hold. Every device is told, whatever happens to the
    /// others; what failed is returned.
    pub async fn stop_all(&mut self) -> Vec<DriveError<R::Error>> {
        self.all(Verb::Stop).await
    }

    /// Emergency stop: both arms hold or go limp at once as the rig file says, lamp off. Every device is told,
    /// whatever happens to the others; what failed is returned. The arms must be engaged again before they move.
    pub async fn halt_all(&mut self) -> Vec<DriveError<R::Error>> {
        self.all(Verb::Halt).await
    }

    /// Lamp off, watchdogs disarmed, the arms left as the rig file says. Every device is told, whatever happens to
    /// the others; what failed is returned.
    pub async fn disengage_all(&mut self) -> Vec<DriveError<R::Error>> {
        self.all(Verb::Disengage).await
    }

    /// Stops the arms, on their profiles or `at_once`, lamp off, and lets go of them. Every device is told, whatever
    /// happens to the others; what failed is returned.
    pub async fn make_safe(&mut self, at_once: bool) -> Vec<DriveError<R::Error>> {
        let mut failed = match at_once {
            true => self.halt_all().await,
            false => self.stop_all().await,
        };
        failed.extend(self.disengage_all().await);
        failed
    }

    /// Goes round the devices rather than waiting for a silent one: the others must not move on meanwhile.
    async fn all(&mut self, verb: Verb) -> Vec<DriveError<R::Error>> {
        let silence = self.file.bus.silence;
        let mut pending: Vec<_> = [Device::Light, Device::Sensor, Device::Photometer]
            .map(|device| (device, Patience::new(silence)))
            .into();
        let mut failed = Vec::new();
        while !pending.is_empty() {
            let mut still = Vec::new();
            for (device, mut patience) in pending {
                let Err(error) = self.tell(verb, device).await else {
                    continue;
                };
                match patience.spend(what(verb, device), error).await {
                    Ok(()) => {
                        self.retries += 1;
                        still.push((device, patience));
                    }
                    Err(error) => failed.push(error),
                }
            }
            pending = still;
            if failed.iter().any(|error| error.kind() == FaultKind::Disconnected) {
                break;
            }
        }
        self.lamp = false;
        self.engaged &= matches!(verb, Verb::Stop);
        failed
    }

    async fn tell(&mut self, verb: Verb, device: Device) -> Result<(), R::Error> {
        let arm = match device {
            Device::Light => Arm::Light,
            Device::Sensor => Arm::Sensor,
            Device::Photometer => return self.rig.photometer().lamp(false).await,
        };
        let axis = self.rig.axis(arm);
        match verb {
            Verb::Stop => axis.stop().await,
            Verb::Halt => axis.halt().await,
            Verb::Disengage => axis.disengage().await,
        }
    }
}

fn what(verb: Verb, device: Device) -> &'static str {
    match (device, verb) {
        (Device::Photometer, _) => "switch the lamp off",
        (Device::Light, Verb::Stop) => "stop the light arm",
        (Device::Sensor, Verb::Stop) => "stop the sensor arm",
        (Device::Light, Verb::Halt) => "halt the light arm",
        (Device::Sensor, Verb::Halt) => "halt the sensor arm",
        (Device::Light, Verb::Disengage) => "disengage the light arm",
        (Device::Sensor, Verb::Disengage) => "disengage the sensor arm",
    }
}
