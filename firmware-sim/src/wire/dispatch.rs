use std::collections::BTreeMap;

use super::answer::{Level, Slot, ask};
use super::fast;
use super::instruction::{Instruction, Read, Write};
use super::packet::{BROADCAST, Packet};
use crate::{Device, Refusal};

/// Where ping finds model number and firmware version (registers 0 and 6 of every model).
const MODEL_NUMBER: (u16, u16) = (0, 2);
const FIRMWARE_VERSION: (u16, u16) = (6, 1);

/// Hands instructions to the devices they are for, and collects the answers in the order in which the host hears
/// them.
#[derive(Debug, Default)]
pub(crate) struct Dispatcher {
    /// What Reg Write left for Action, by id.
    registered: BTreeMap<u8, (u16, Vec<u8>)>,
}

impl Dispatcher {
    /// Carries out one packet on the devices that hear it.
    ///
    /// A device that the host waits for and that says nothing (unknown id, status return level) is
    /// [`Slot::Silence`]. Nobody answers what was sent to all, except a ping and reads that name their devices.
    pub(crate) fn dispatch(&mut self, packet: &Packet, devices: &mut [&mut dyn Device]) -> Vec<Slot> {
        let instruction = match Instruction::decode(packet) {
            None => return Vec::new(),
            Some(Err(_)) if packet.id == BROADCAST => return Vec::new(),
            Some(Err(refusal)) => return vec![ask(devices, packet.id, Level::All, 0, |_| Err(refusal))],
            Some(Ok(instruction)) => instruction,
        };
        match instruction {
            Instruction::Reads(reads) => reads.into_iter().map(|read| answer_read(devices, read)).collect(),
            Instruction::FastReads(reads) => fast::answer(devices, &reads),
            Instruction::Writes(writes) => {
                for write in writes {
                    // Nobody answers, so nobody says that it refused.
                    ask(devices, write.id, Level::All, 0, |device| {
                        device.write(write.address, write.bytes).map(|()| Vec::new())
                    });
                }
                Vec::new()
            }
            Instruction::Ping if packet.id == BROADCAST => ping_all(devices),
            Instruction::Ping => vec![answer_ping(devices, packet.id)],
            Instruction::Read(_) if packet.id == BROADCAST => Vec::new(),
            Instruction::Read(read) => vec![answer_read(devices, read)],
            other if packet.id == BROADCAST => {
                for device in devices {
                    device.heard();
                    // As above: a refusal of what was sent to all stays unsaid.
                    let _ = self.carry_out(&mut **device, &other);
                }
                Vec::new()
            }
            other => vec![ask(devices, packet.id, Level::All, 0, |device| {
                self.carry_out(device, &other).map(|()| Vec::new())
            })],
        }
    }

    /// What changes a device and brings no data back.
    fn carry_out(&mut self, device: &mut dyn Device, instruction: &Instruction<'_>) -> Result<(), Refusal> {
        let id = device.id();
        match instruction {
            Instruction::Write(Write { address, bytes, .. }) => device.write(*address, bytes),
            Instruction::RegWrite(Write { address, bytes, .. }) => {
                self.registered.insert(id, (*address, bytes.to_vec()));
                device.registered(true);
                Ok(())
            }
            Instruction::Action => {
                let (address, bytes) = self.registered.remove(&id).ok_or(Refusal::Instruction)?;
                device.registered(false);
                device.write(address, &bytes)
            }
            Instruction::FactoryReset(option) => device.factory_reset(*option),
            Instruction::Reboot => {
                self.registered.remove(&id);
                device.registered(false);
                device.reboot();
                Ok(())
            }
            Instruction::Clear(parameters) => device.clear(parameters),
            Instruction::Ping
            | Instruction::Read(_)
            | Instruction::Reads(_)
            | Instruction::FastReads(_)
            | Instruction::Writes(_) => Err(Refusal::Instruction),
        }
    }
}

fn answer_read(devices: &mut [&mut dyn Device], Read { id, address, length }: Read) -> Slot {
    ask(devices, id, Level::Read, length.into(), |device| {
        device.read(address, length)
    })
}

fn answer_ping(devices: &mut [&mut dyn Device], id: u8) -> Slot {
    ask(devices, id, Level::Ping, 3, |device| {
        let mut data = device.read(MODEL_NUMBER.0, MODEL_NUMBER.1)?;
        data.extend(device.read(FIRMWARE_VERSION.0, FIRMWARE_VERSION.1)?);
        Ok(data)
    })
}

/// All that listen, lowest id first. The host cannot know how many there are and listens until no more come.
fn ping_all(devices: &mut [&mut dyn Device]) -> Vec<Slot> {
    let mut ids: Vec<u8> = devices.iter().map(|device| device.id()).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut slots: Vec<Slot> = ids.into_iter().map(|id| answer_ping(devices, id)).collect();
    slots.push(Slot::Silence { bytes: 0 });
    slots
}

#[cfg(test)]
mod tests;
