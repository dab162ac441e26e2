use super::block::{Block, i32_at};
use super::bus::Bus;
use super::line::{Cause, Failure, PING, PING_REPLY, Reply, Request};
use super::model::Series;
use super::register::{Register, common};
use crate::{Device, RigError};

/// Instructions of Protocol 2.0 that are used (e-manual, "Instruction Packet").
pub(super) mod instruction {
    pub(crate) const READ: u8 = 0x02;
    pub(crate) const WRITE: u8 = 0x03;
    pub(crate) const REBOOT: u8 = 0x08;
    pub(crate) const SYNC_WRITE: u8 = 0x83;
    pub(crate) const BULK_READ: u8 = 0x92;
    pub(crate) const BULK_WRITE: u8 = 0x93;
}

/// Id that addresses all devices.
pub(super) const BROADCAST: u8 = 254;

/// How often a ping is answered and a read is not before that is no chance: at one lost reply in two, once in 65,536.
const ALTERNATIONS: u32 = 8;

/// One device on the bus.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) bus: Bus,
    pub(super) device: Device,
    pub(super) id: u8,
    /// Its control table; none of a device that has its registers where the X series has those of the same name.
    pub(super) series: Option<&'static Series>,
}

impl Node {
    /// Where this device has what the X series has at an address.
    pub(super) fn place(&self, address: u16) -> u16 {
        self.series.map_or(address, |series| series.place(address))
    }

    /// Reads bytes; a hardware error that the device announces is an error.
    pub(super) async fn read(&self, block: Block) -> Result<Vec<u8>, RigError> {
        let reply = self.healthy(self.ask(block).await).await?;
        Ok(reply.parameters)
    }

    /// Reads a register of one byte.
    pub(super) async fn read_u8(&self, register: Register) -> Result<u8, RigError> {
        Ok(self.read(Block::of(register)).await?[0])
    }

    /// Writes bytes; a hardware error that the device announces is an error.
    pub(super) async fn write(&self, register: Register, bytes: &[u8]) -> Result<(), RigError> {
        let reply = self.tell(register, bytes).await;
        self.healthy(reply).await.map(|_| ())
    }

    /// Writes the bytes of a block; a hardware error that the device announces is an error.
    pub(super) async fn write_block(&self, block: Block, bytes: &[u8]) -> Result<(), RigError> {
        let reply = self.tell_at(block.address, bytes).await;
        self.healthy(reply).await.map(|_| ())
    }

    /// Reads bytes of a device that may be ill: what stops a rig goes on regardless.
    pub(super) async fn ask(&self, block: Block) -> Result<Reply, RigError> {
        let mut parameters = self.place(block.address).to_le_bytes().to_vec();
        parameters.extend((block.length as u16).to_le_bytes());
        self.request(instruction::READ, parameters, block.length).await
    }

    /// Reads a signed register of a device that may be ill.
    pub(super) async fn ask_i32(&self, register: Register) -> Result<i32, RigError> {
        let reply = self.ask(Block::of(register)).await?;
        Ok(i32_at(&reply.parameters, 0))
    }

    /// Writes to a device that may be ill.
    pub(super) async fn tell(&self, register: Register, bytes: &[u8]) -> Result<Reply, RigError> {
        self.tell_at(register.address, bytes).await
    }

    async fn tell_at(&self, address: u16, bytes: &[u8]) -> Result<Reply, RigError> {
        let mut parameters = self.place(address).to_le_bytes().to_vec();
        parameters.extend(bytes);
        self.request(instruction::WRITE, parameters, 0).await
    }

    /// Restarts the device, also one that is ill.
    pub(super) async fn reboot(&self) -> Result<(), RigError> {
        self.request(instruction::REBOOT, Vec::new(), 0).await.map(drop)
    }

    async fn request(&self, instruction: u8, parameters: Vec<u8>, count: usize) -> Result<Reply, RigError> {
        let request = Request {
            id: self.id,
            instruction,
            parameters,
            replies: vec![(self.id, count)],
        };
        let mut replies = self
            .bus
            .transact(request)
            .await
            .map_err(|failure| self.error(failure))?;
        Ok(replies
            .pop()
            .expect("a transaction yields as many replies as asked for"))
    }

    /// Passes a result on unless the device announced a hardware error with it, or refused because of one. The
    /// announced request itself was carried out; only which error it is has to be asked for.
    async fn healthy(&self, result: Result<Reply, RigError>) -> Result<Reply, RigError> {
        let ill = match &result {
            Ok(reply) => reply.alert,
            Err(error) => matches!(error, RigError::Refused { .. }),
        };
        if ill {
            let bits = self.hardware_error().await?;
            if bits != 0 {
                return Err(self.hardware(bits));
            }
        }
        result
    }

    /// Makes the silence of a device that answers pings, and no reads, one that says what to do: at Status Return Level 0
    /// it answers nothing else. Another error, and a device that is silent altogether, is passed on.
    pub(super) async fn explain(&self, error: RigError) -> RigError {
        if !matches!(error, RigError::NoReply { .. }) {
            return error;
        }
        // Replies that are lost by chance are not all reads.
        for _ in 0..ALTERNATIONS {
            let pinged = self.request(PING, Vec::new(), PING_REPLY).await;
            if pinged.is_err() || self.ask(Block::of(common::MODEL_NUMBER)).await.is_ok() {
                return error;
            }
        }
        RigError::Mismatch {
            device: self.device,
            id: self.id,
            differences: vec![format!(
                "it answers pings and no reads, so its status return level is 0: write 2 to address {}",
                self.place(common::STATUS_RETURN_LEVEL.address)
            )],
        }
    }

    /// Bits of the Hardware Error Status.
    pub(super) async fn hardware_error(&self) -> Result<u8, RigError> {
        let reply = self.ask(Block::of(common::HARDWARE_ERROR_STATUS)).await?;
        Ok(reply.parameters[0])
    }

    /// The error for a hardware error.
    pub(super) fn hardware(&self, bits: u8) -> RigError {
        RigError::Hardware {
            device: self.device,
            id: self.id,
            bits,
        }
    }

    /// The error for a failed transaction with this device.
    pub(super) fn error(&self, failure: Failure) -> RigError {
        let (device, id) = (self.device, failure.id);
        match failure.cause {
            Cause::Silence => RigError::NoReply { device, id },
            Cause::Damage(why) => RigError::BadReply { device, id, why },
            // The request was damaged on its way: worth another try, as a damaged reply is.
            Cause::Refusal(CRC_ERROR) => RigError::BadReply {
                device,
                id,
                why: "the device received a damaged request".to_owned(),
            },
            Cause::Refusal(number) => RigError::Refused { device, id, number },
            Cause::Gone(source) => RigError::PortGone { source },
        }
    }
}

/// Error number of a status packet: the CRC of the instruction did not match (e-manual, Protocol 2.0, "Error").
const CRC_ERROR: u8 = 3;
