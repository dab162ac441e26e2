use std::time::Duration;

use super::block::{self, Block, u32_at};
use super::node::Node;
use super::register::{PHOTOMETER_MODEL, common, photometer};
use crate::{Counts, Detector, DetectorStatus, Exposure, Identity, RigError};

/// The photometer node.
#[derive(Debug)]
pub struct Photometer {
    pub(super) node: Node,
    pub(super) watchdog: Duration,
}

impl Detector for Photometer {
    type Error = RigError;

    async fn identify(&mut self) -> Result<Identity, RigError> {
        let bits = match self.node.hardware_error().await {
            Ok(bits) => bits,
            Err(error) => return Err(self.node.explain(error).await),
        };
        if bits != 0 {
            return Err(self.node.hardware(bits));
        }
        let model = self.node.read(Block::of(common::MODEL_NUMBER)).await?;
        let model = u16::from_le_bytes([model[0], model[1]]);
        let setup = self.node.read(block::SETUP).await?;
        let mut differences = Vec::new();
        if model != PHOTOMETER_MODEL {
            differences.push(format!(
                "its model number is {model}, a photometer node's is {PHOTOMETER_MODEL}: correct `id` or the wiring"
            ));
        } else if self.node.read_u8(common::STATUS_RETURN_LEVEL).await? != 2 {
            differences.push("writes are not acknowledged: write 2 to address 68".to_owned());
        }
        if !differences.is_empty() {
            return Err(RigError::Mismatch {
                device: self.node.device,
                id: self.node.id,
                differences,
            });
        }
        Ok(Identity {
            id: self.node.id,
            model: "photometer".to_owned(),
            firmware: setup[0],
        })
    }

    async fn lamp(&mut self, on: bool) -> Result<(), RigError> {
        if !on {
            // Off first, whatever else fails, and also where the node announces an error.
            self.node.tell(photometer::LAMP_ENABLE, &[0]).await?;
            self.node.tell(common::BUS_WATCHDOG, &[0]).await?;
            return Ok(());
        }
        // Clears a watchdog that has tripped, which would keep the lamp off.
        self.node.write(common::BUS_WATCHDOG, &[0]).await?;
        let watchdog = (self.watchdog.as_millis() / 20) as u8;
        self.node.write(common::BUS_WATCHDOG, &[watchdog]).await?;
        self.node.write(photometer::LAMP_ENABLE, &[1]).await
    }

    async fn trigger(&mut self, exposure: Exposure) -> Result<(), RigError> {
        // Integration time, gain step and trigger are neighbours.
        let mut bytes = exposure.integration_us.to_le_bytes().to_vec();
        bytes.extend([exposure.gain as u8, 1]);
        self.node.write(photometer::INTEGRATION_TIME, &bytes).await
    }

    async fn status(&mut self) -> Result<DetectorStatus, RigError> {
        Ok(block::status(&self.node.read(block::STATUS).await?))
    }

    async fn counts(&mut self) -> Result<Option<Counts>, RigError> {
        Ok(block::reading(&self.node.read(block::READING).await?))
    }

    async fn ticks(&mut self) -> Result<u32, RigError> {
        let bytes = self.node.read(Block::of(photometer::PRESENT_TIME)).await?;
        Ok(u32_at(&bytes, 0))
    }
}
