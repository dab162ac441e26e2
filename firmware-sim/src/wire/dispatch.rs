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
    registered: BTreeMap<u8, Registered>,
}

/// A write that waits.
#[derive(Debug)]
struct Registered {
    address: u16,
    bytes: Vec<u8>,
    /// It was asked for under the id of the device's group.
    of_group: bool,
}

impl Dispatcher {
    /// Carries out one packet on the devices that hear it.
    ///
    /// A device that the host waits for and that says nothing (unknown id, status return level) is
    /// [`Slot::Silence`]. Nobody answers what was sent to all, except a ping and reads that name their devices.
    pub(crate) fn dispatch(&mut self, packet: &Packet, devices: &mut [&mut dyn Device]) -> Vec<Slot> {
        let Some(decoded) = Instruction::decode(packet) else {
            return Vec::new();
        };
        // Whatever it asks for, and of whom: all that is communication to a bus watchdog (e-manual, "Bus Watchdog").
        for device in devices.iter_mut() {
            device.heard();
        }
        let instruction = match decoded {
            Err(_) if packet.id == BROADCAST => return Vec::new(),
            Err(refusal) => return vec![ask(devices, packet.id, Level::All, 0, |_| Err(refusal))],
            Ok(instruction) => instruction,
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
                    for device in group(devices, write.id) {
                        let _ = device.write_to_group(write.address, write.bytes);
                    }
                }
                Vec::new()
            }
            Instruction::Ping if packet.id == BROADCAST => ping_all(devices),
            Instruction::Ping => vec![answer_ping(devices, packet.id)],
            Instruction::Read(_) if packet.id == BROADCAST => Vec::new(),
            Instruction::Read(read) => vec![answer_read(devices, read)],
            other if packet.id == BROADCAST => {
                for device in devices {
                    // As above: a refusal of what was sent to all stays unsaid.
                    let _ = self.carry_out(&mut **device, &other);
                }
                Vec::new()
            }
            other => {
                let answer = ask(devices, packet.id, Level::All, 0, |device| {
                    self.carry_out(device, &other).map(|()| Vec::new())
                });
                for device in group(devices, packet.id) {
                    // Nobody answers under the id of a group.
                    let _ = self.carry_out_in_group(device, &other);
                }
                vec![answer]
            }
        }
    }

    /// What changes a device and brings no data back.
    fn carry_out(&mut self, device: &mut dyn Device, instruction: &Instruction<'_>) -> Result<(), Refusal> {
        let id = device.id();
        match instruction {
            Instruction::Write(Write { address, bytes, .. }) => device.write(*address, bytes),
            Instruction::RegWrite(Write { address, bytes, .. }) => {
                self.register(device, *address, bytes, false);
                Ok(())
            }
            Instruction::Action => {
                let write = self.registered.remove(&id).ok_or(Refusal::Instruction)?;
                device.registered(false);
                match write.of_group {
                    true => device.write_to_group(write.address, &write.bytes),
                    false => device.write(write.address, &write.bytes),
                }
            }
            Instruction::FactoryReset(option) => device.factory_reset(*option),
            Instruction::Reboot => {
                self.registered.remove(&id);
                device.registered(false);
                device.reboot();
                Ok(())
            }
            Instruction::Clear(parameters) => device.clear(parameters),
            Instruction::BackUp(parameters) => device.back_up(parameters),
            Instruction::Ping
            | Instruction::Read(_)
            | Instruction::Reads(_)
            | Instruction::FastReads(_)
            | Instruction::Writes(_) => Err(Refusal::Instruction),
        }
    }

    /// What a device does for the id of its group: writes, now or at Action. The manual names no other instruction.
    fn carry_out_in_group(
        &mut self,
        device: &mut dyn Device,
        instruction: &Instruction<'_>,
    ) -> Result<(), Refusal> {
        match instruction {
            Instruction::Write(Write { address, bytes, .. }) => device.write_to_group(*address, bytes),
            Instruction::RegWrite(Write { address, bytes, .. }) => {
                self.register(device, *address, bytes, true);
                Ok(())
            }
            Instruction::Action => self.carry_out(device, instruction),
            _ => Ok(()),
        }
    }

    fn register(&mut self, device: &mut dyn Device, address: u16, bytes: &[u8], of_group: bool) {
        let write = Registered {
            address,
            bytes: bytes.to_vec(),
            of_group,
        };
        self.registered.insert(device.id(), write);
        device.registered(true);
    }
}

/// The devices of a group; not one whose own id it is, which has the higher priority (e-manual, "Secondary ID(12)").
fn group<'a>(devices: &'a mut [&mut dyn Device], id: u8) -> impl Iterator<Item = &'a mut (dyn Device + 'a)> {
    devices
        .iter_mut()
        .filter(move |device| device.id() != id && device.secondary_id() == Some(id))
        .map(|device| &mut **device as &mut (dyn Device + 'a))
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
