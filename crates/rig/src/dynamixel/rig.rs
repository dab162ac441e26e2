use std::path::Path;
use std::time::Duration;

use arms::{Arm, Pose};

use super::block::{self, Block};
use super::bus::Bus;
use super::line::Request;
use super::model::Indirect;
use super::node::{BROADCAST, Node, instruction};
use super::photometer::Photometer;
use super::register::{photometer, servo};
use super::servo::Servo;
use crate::{Device, Observation, Rig, RigError, RigFile, Snapshot, Surroundings};

/// Longest time that the photometer's Delay register takes at once (docs/photometer.md).
const DELAY_MAX: Duration = Duration::from_secs(10);

/// A rig on a Dynamixel bus.
#[derive(Debug)]
pub struct Dynamixel {
    bus: Bus,
    servos: [Servo; 2],
    photometer: Photometer,
    /// Whether the photometer's clock is a simulated one, once known.
    simulated: Option<bool>,
}

impl Dynamixel {
    /// Opens and locks a serial port for the devices of a rig file; sends nothing, moves nothing. The file's own
    /// port is not looked at, since it may be the built-in simulator.
    ///
    /// # Errors
    /// The port is missing, locked by another program, not permitted or no serial port.
    pub fn open(port: &Path, file: &RigFile) -> Result<Self, RigError> {
        let bus = Bus::open(port, &file.bus)?;
        let node = |device, id, series| Node {
            bus: bus.clone(),
            device,
            id,
            series,
        };
        let servo = |arm: Arm| {
            let settings = file.arm(arm).clone();
            Servo {
                node: node(arm.into(), settings.id, Some(settings.model.series)),
                settings,
                limits: file.envelope.limits(arm),
                watchdog: file.motion.watchdog,
                latency: file.bus.latency,
                estop: file.motion.estop,
                mapped: None,
                firmware: None,
                engaged: false,
            }
        };
        Ok(Self {
            servos: Arm::BOTH.map(servo),
            photometer: Photometer {
                node: node(Device::Photometer, file.photometer.id, None),
                watchdog: file.motion.watchdog,
            },
            simulated: None,
            bus,
        })
    }

    /// Points both servos' indirect data at their state, as a run does before it moves, so that from now on all devices
    /// are read in one transaction. Moves nothing.
    ///
    /// # Errors
    /// A servo that is silent or ill.
    pub(crate) async fn map_all(&mut self) -> Result<(), RigError> {
        for servo in &mut self.servos {
            servo.map().await?;
        }
        Ok(())
    }

    /// State of both servos, and a block of the photometer that begins with its status, in one transaction.
    async fn bulk(
        &mut self,
        states: [Indirect; 2],
        photometer: Block,
    ) -> Result<(Snapshot, Vec<u8>), RigError> {
        let [light, sensor] = [&self.servos[0].node, &self.servos[1].node];
        let [light_state, sensor_state] = states.map(block::state_block);
        let parts = [
            (light, light_state),
            (sensor, sensor_state),
            (&self.photometer.node, photometer),
        ];
        let mut parameters = Vec::new();
        for (node, block) in parts {
            parameters.push(node.id);
            parameters.extend(node.place(block.address).to_le_bytes());
            parameters.extend((block.length as u16).to_le_bytes());
        }
        let request = Request {
            id: BROADCAST,
            instruction: instruction::BULK_READ,
            parameters,
            replies: parts.map(|(node, block)| (node.id, block.length)).to_vec(),
        };
        let mut replies = self.bus.transact(request).await.map_err(|failure| {
            let guilty = parts.iter().find(|(node, _)| node.id == failure.id);
            guilty.map_or(light, |(node, _)| node).error(failure)
        })?;
        // The servos' own hardware errors are in their state.
        if replies[2].alert {
            let bits = self.photometer.node.hardware_error().await?;
            if bits != 0 {
                return Err(self.photometer.node.hardware(bits));
            }
        }
        let state = |arm: Arm| block::state(&replies[arm as usize].parameters);
        let mut snapshot = Snapshot {
            arms: Arm::BOTH.map(|arm| self.servos[arm as usize].place(state(arm))),
            detector: block::status(&replies[2].parameters),
        };
        for arm in Arm::BOTH {
            // After a restart the map is lost and everything reads 0.
            if !state(arm).torque {
                let servo = &self.servos[arm as usize];
                snapshot.arms[arm as usize] = servo.place(servo.state().await?);
            }
        }
        Ok((snapshot, replies.swap_remove(2).parameters))
    }

    /// Both servos and a block of the photometer that begins with its status, in as few transactions as possible.
    async fn look(&mut self, photometer: Block) -> Result<(Snapshot, Vec<u8>), RigError> {
        if let [Some(light), Some(sensor)] = self.servos.each_ref().map(|servo| servo.mapped) {
            return self.bulk([light, sensor], photometer).await;
        }
        let [light, sensor] = &mut self.servos;
        use crate::Actuator as _;
        let arms = [light.location().await?, sensor.location().await?];
        let bytes = self.photometer.node.read(photometer).await?;
        let detector = block::status(&bytes);
        Ok((Snapshot { arms, detector }, bytes))
    }

    async fn clock_is_simulated(&mut self) -> Result<bool, RigError> {
        if let Some(simulated) = self.simulated {
            return Ok(simulated);
        }
        let clock = self.photometer.node.ask(Block::of(photometer::CLOCK)).await?;
        let simulated = clock.parameters[0] == 1;
        self.simulated = Some(simulated);
        Ok(simulated)
    }
}

impl Rig for Dynamixel {
    type Error = RigError;
    type Axis = Servo;
    type Photometer = Photometer;

    fn axis(&mut self, arm: Arm) -> &mut Servo {
        &mut self.servos[arm as usize]
    }

    fn photometer(&mut self) -> &mut Photometer {
        &mut self.photometer
    }

    async fn start(&mut self, goals: Pose) -> Result<(), RigError> {
        // An arm that is not engaged has no profile: it would jump.
        if let Some(servo) = self.servos.iter().find(|servo| !servo.engaged) {
            return Err(RigError::NotEngaged {
                device: servo.node.device,
            });
        }
        let goal = servo::GOAL_POSITION;
        let [light, sensor] = self.servos.each_ref().map(|servo| servo.node.place(goal.address));
        // One packet also where the two have their goals at different addresses.
        let together = light == sensor;
        let mut parameters = Vec::new();
        if together {
            parameters.extend(light.to_le_bytes());
            parameters.extend(goal.size.to_le_bytes());
        }
        for (arm, address) in Arm::BOTH.into_iter().zip([light, sensor]) {
            let servo = &self.servos[arm as usize];
            let counts = servo.settings.axis.counts(goals.angle(arm)).round() as i32;
            parameters.push(servo.node.id);
            if !together {
                parameters.extend(address.to_le_bytes());
                parameters.extend(goal.size.to_le_bytes());
            }
            parameters.extend(counts.to_le_bytes());
        }
        let request = Request {
            id: BROADCAST,
            instruction: match together {
                true => instruction::SYNC_WRITE,
                false => instruction::BULK_WRITE,
            },
            parameters,
            replies: Vec::new(),
        };
        let sent = self.bus.transact(request).await;
        sent.map_err(|failure| self.servos[0].node.error(failure))?;
        Ok(())
    }

    async fn snapshot(&mut self) -> Result<Snapshot, RigError> {
        Ok(self.look(block::STATUS).await?.0)
    }

    async fn observe(&mut self) -> Result<Observation, RigError> {
        let (snapshot, bytes) = self.look(block::READING).await?;
        Ok(Observation {
            snapshot,
            ticks: block::ticks(&bytes),
            counts: block::reading(&bytes),
        })
    }

    async fn surroundings(&mut self) -> Result<Surroundings, RigError> {
        let (mut supply_v, mut temperature_c) = ([0.0; 2], [0.0; 3]);
        for (i, servo) in self.servos.iter().enumerate() {
            // Together they would have the length by which the answer to a ping is known.
            let supply = servo
                .node
                .ask(Block::of(servo::PRESENT_INPUT_VOLTAGE))
                .await?
                .parameters;
            supply_v[i] = f64::from(u16::from_le_bytes([supply[0], supply[1]])) / 10.0;
            let temperature = servo
                .node
                .ask(Block::of(servo::PRESENT_TEMPERATURE))
                .await?
                .parameters;
            temperature_c[i] = f64::from(temperature[0]);
        }
        let cabinet = self.photometer.node.ask(block::CABINET).await?.parameters;
        temperature_c[2] = f64::from(cabinet[0]);
        Ok(Surroundings {
            supply_v,
            temperature_c,
            door_open: cabinet[1] == 1,
        })
    }

    async fn wait(&mut self, duration: Duration) -> Result<(), RigError> {
        if !self.clock_is_simulated().await? {
            tokio::time::sleep(duration).await;
            return Ok(());
        }
        let mut left = duration;
        while !left.is_zero() {
            let now = left.min(DELAY_MAX);
            let microseconds = now.as_nanos().div_ceil(1000) as u32;
            self.photometer
                .node
                .write(photometer::DELAY, &microseconds.to_le_bytes())
                .await?;
            left -= now;
        }
        Ok(())
    }
}
