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
use crate::drivers::{AnyDetector, Scpi};
use crate::{
    Detector as _, DetectorKind, DetectorStatus, Device, Location, Observation, Phase, Port, Rig, RigError,
    RigFile, Snapshot, Surroundings,
};

/// Longest time that the photometer's Delay register takes at once (docs/photometer.md).
const DELAY_MAX: Duration = Duration::from_secs(10);

/// A rig on a Dynamixel bus.
#[derive(Debug)]
pub struct Dynamixel {
    bus: Bus,
    servos: [Servo; 2],
    detector: AnyDetector,
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
        let photometer = || Photometer {
            node: node(Device::Photometer, file.photometer.id, None),
            watchdog: file.motion.watchdog,
        };
        let simulator = file.bus.port == Port::Sim;
        let detector = match file.detector.kind {
            DetectorKind::Node => AnyDetector::Node(photometer()),
            DetectorKind::Scpi => {
                // The simulated bus has a node in any case, which lets time pass.
                let node = (file.detector.has_node() || simulator).then(photometer);
                AnyDetector::Scpi(Box::new(Scpi::new(file, node, simulator)?))
            }
        };
        // A node that only switches a lamp on a real bus has the time of this computer.
        let elsewhere = !file.detector.on_bus() && !simulator;
        Ok(Self {
            servos: Arm::BOTH.map(servo),
            detector,
            simulated: elsewhere.then_some(false),
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

    /// The node on the bus, where there is one.
    fn node(&self) -> Option<&Node> {
        match &self.detector {
            AnyDetector::Node(photometer) => Some(&photometer.node),
            AnyDetector::Scpi(scpi) => scpi.node.as_ref().map(|photometer| &photometer.node),
        }
    }

    /// State of both servos, and a block of the photometer that begins with its status where it is on the bus, in one
    /// transaction.
    async fn bulk(
        &mut self,
        states: [Indirect; 2],
        photometer: Block,
    ) -> Result<([Location; 2], Option<Vec<u8>>), RigError> {
        let [light, sensor] = [&self.servos[0].node, &self.servos[1].node];
        let [light_state, sensor_state] = states.map(block::state_block);
        let mut parts = vec![(light, light_state), (sensor, sensor_state)];
        let counting = match &self.detector {
            AnyDetector::Node(node) => Some(&node.node),
            AnyDetector::Scpi(_) => None,
        };
        parts.extend(counting.map(|node| (node, photometer)));
        let mut parameters = Vec::new();
        for (node, block) in &parts {
            parameters.push(node.id);
            parameters.extend(node.place(block.address).to_le_bytes());
            parameters.extend((block.length as u16).to_le_bytes());
        }
        let request = Request {
            id: BROADCAST,
            instruction: instruction::BULK_READ,
            parameters,
            replies: parts
                .iter()
                .map(|(node, block)| (node.id, block.length))
                .collect(),
        };
        let mut replies = self.bus.transact(request).await.map_err(|failure| {
            let guilty = parts.iter().find(|(node, _)| node.id == failure.id);
            guilty.map_or(light, |(node, _)| node).error(failure)
        })?;
        // The servos' own hardware errors are in their state.
        if let (Some(node), Some(reply)) = (counting, replies.get(2))
            && reply.alert
        {
            let bits = node.hardware_error().await?;
            if bits != 0 {
                return Err(node.hardware(bits));
            }
        }
        let state = |arm: Arm| block::state(&replies[arm as usize].parameters);
        let mut arms = Arm::BOTH.map(|arm| self.servos[arm as usize].place(state(arm)));
        for arm in Arm::BOTH {
            // After a restart the map is lost and everything reads 0.
            if !state(arm).torque {
                let servo = &self.servos[arm as usize];
                arms[arm as usize] = servo.place(servo.state().await?);
            }
        }
        Ok((
            arms,
            (replies.len() > 2).then(|| replies.swap_remove(2).parameters),
        ))
    }

    /// Both servos, and a block of the photometer that begins with its status where it is on the bus, in as few
    /// transactions as possible.
    async fn look(&mut self, photometer: Block) -> Result<([Location; 2], Option<Vec<u8>>), RigError> {
        if let [Some(light), Some(sensor)] = self.servos.each_ref().map(|servo| servo.mapped) {
            return self.bulk([light, sensor], photometer).await;
        }
        let [light, sensor] = &mut self.servos;
        use crate::Actuator as _;
        let arms = [light.location().await?, sensor.location().await?];
        let bytes = match &self.detector {
            AnyDetector::Node(node) => Some(node.node.read(photometer).await?),
            AnyDetector::Scpi(_) => None,
        };
        Ok((arms, bytes))
    }

    /// What the detector does, from its block or from what is known of one elsewhere.
    fn status(&self, bytes: Option<&[u8]>) -> DetectorStatus {
        match (&self.detector, bytes) {
            (AnyDetector::Scpi(scpi), _) => scpi.known(),
            (AnyDetector::Node(_), Some(bytes)) => block::status(bytes),
            (AnyDetector::Node(_), None) => DetectorStatus {
                phase: Phase::Idle,
                sequence: 0,
            },
        }
    }

    async fn clock_is_simulated(&mut self) -> Result<bool, RigError> {
        if let Some(simulated) = self.simulated {
            return Ok(simulated);
        }
        let simulated = match self.node() {
            Some(node) => node.ask(Block::of(photometer::CLOCK)).await?.parameters[0] == 1,
            None => false,
        };
        self.simulated = Some(simulated);
        Ok(simulated)
    }
}

impl Rig for Dynamixel {
    type Error = RigError;
    type Axis = Servo;
    type Photometer = AnyDetector;

    fn axis(&mut self, arm: Arm) -> &mut Servo {
        &mut self.servos[arm as usize]
    }

    fn photometer(&mut self) -> &mut AnyDetector {
        &mut self.detector
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
        let (arms, bytes) = self.look(block::STATUS).await?;
        let detector = self.status(bytes.as_deref());
        Ok(Snapshot { arms, detector })
    }

    async fn observe(&mut self) -> Result<Observation, RigError> {
        let (arms, bytes) = self.look(block::READING).await?;
        // One elsewhere is asked after the arms, which are to be looked at in time.
        let (ticks, counts) = match (&mut self.detector, &bytes) {
            (AnyDetector::Scpi(scpi), _) => (scpi.now(), scpi.counts().await?),
            (AnyDetector::Node(_), Some(bytes)) => (block::ticks(bytes), block::reading(bytes)),
            (AnyDetector::Node(_), None) => (0, None),
        };
        let detector = self.status(bytes.as_deref());
        Ok(Observation {
            snapshot: Snapshot { arms, detector },
            ticks,
            counts,
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
        let cabinet = match self.node() {
            Some(node) => Some(node.ask(block::CABINET).await?.parameters),
            None => None,
        };
        // NaN holds no run: nothing is known of an instrument elsewhere.
        temperature_c[2] = cabinet.as_ref().map_or(f64::NAN, |cabinet| f64::from(cabinet[0]));
        Ok(Surroundings {
            supply_v,
            temperature_c,
            door_open: cabinet.is_some_and(|cabinet| cabinet[1] == 1),
        })
    }

    async fn wait(&mut self, duration: Duration) -> Result<(), RigError> {
        if let AnyDetector::Scpi(scpi) = &mut self.detector {
            scpi.pass(duration);
        }
        if !self.clock_is_simulated().await? {
            tokio::time::sleep(duration).await;
            return Ok(());
        }
        let Some(node) = self.node() else {
            return Ok(());
        };
        let mut left = duration;
        while !left.is_zero() {
            let now = left.min(DELAY_MAX);
            let microseconds = now.as_nanos().div_ceil(1000) as u32;
            node.write(photometer::DELAY, &microseconds.to_le_bytes()).await?;
            left -= now;
        }
        Ok(())
    }
}
