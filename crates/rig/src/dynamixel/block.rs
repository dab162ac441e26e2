//! Stretches of the control tables that are read at once, and what their bytes mean.
//!
//! `dynamixel2` 0.9.1 removes byte stuffing wrongly where a reply contains FF FF FF FD. Every stretch read here is cut
//! such that its fields cannot spell that: position, goal and velocity are read alone or between small bytes, limits and
//! homing offset alone. The property tests below try them all.

use super::model::{Indirect, Series};
use super::register::{Register, common, photometer, servo};
use crate::{Counts, DetectorStatus, Exposure, Gain, Phase};

/// Consecutive bytes of a control table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) address: u16,
    pub(super) length: usize,
}

impl Block {
    /// A register alone.
    pub(super) const fn of(register: Register) -> Self {
        Self {
            address: register.address,
            length: register.size as usize,
        }
    }

    /// From one register to another, both included.
    pub(super) const fn span(first: Register, last: Register) -> Self {
        Self {
            address: first.address,
            length: (last.address + last.size - first.address) as usize,
        }
    }
}

/// Firmware version, id, baud rate, return delay.
pub(super) const SETUP: Block = Block::span(common::FIRMWARE_VERSION, common::RETURN_DELAY_TIME);
/// Drive mode and operating mode.
pub(super) const MODES: Block = Block::span(servo::DRIVE_MODE, servo::OPERATING_MODE);
/// Moving and moving status.
pub(super) const MOVING: Block = Block::span(servo::MOVING, servo::MOVING_STATUS);
/// Status and sequence number of the photometer.
pub(super) const STATUS: Block = Block::span(photometer::STATUS, photometer::READING_SEQUENCE);
/// A whole reading of the photometer, from its status to its clock.
pub(super) const READING: Block = Block::span(photometer::STATUS, photometer::PRESENT_TIME);

/// Temperature and door contact of the photometer.
pub(super) const CABINET: Block = Block::span(photometer::TEMPERATURE, photometer::DOOR);

/// Registers that the indirect data of a servo show, in this order: small bytes between the two positions.
const STATE_REGISTERS: [Register; 6] = [
    servo::GOAL_POSITION,
    servo::TORQUE_ENABLE,
    common::HARDWARE_ERROR_STATUS,
    servo::MOVING,
    servo::MOVING_STATUS,
    servo::PRESENT_POSITION,
];

/// Bytes of the state.
const STATE_LENGTH: usize = 12;

/// The state of a servo as its indirect data show it.
pub(super) const fn state_block(indirect: Indirect) -> Block {
    Block {
        address: indirect.data,
        length: STATE_LENGTH,
    }
}

/// The indirect addresses behind [`state_block`].
pub(super) const fn state_map_block(indirect: Indirect) -> Block {
    Block {
        address: indirect.addresses,
        length: 2 * STATE_LENGTH,
    }
}

/// What the indirect addresses must hold so that [`state_block`] shows the state: one address for each byte.
pub(super) fn state_map(series: &Series) -> Vec<u8> {
    STATE_REGISTERS
        .iter()
        .map(|&register| series.at(register))
        .flat_map(|register| register.address..register.address + register.size)
        .flat_map(u16::to_le_bytes)
        .collect()
}

/// What a servo is doing, in its own units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct State {
    pub(super) torque: bool,
    pub(super) hardware_error: u8,
    pub(super) moving: bool,
    pub(super) in_position: bool,
    /// Counts.
    pub(super) goal: i32,
    /// Counts.
    pub(super) position: i32,
}

/// The state in the bytes of [`state_block`].
pub(super) fn state(bytes: &[u8]) -> State {
    State {
        goal: i32_at(bytes, 0),
        torque: bytes[4] == 1,
        hardware_error: bytes[5],
        moving: bytes[6] == 1,
        in_position: bytes[7] & 1 == 1,
        position: i32_at(bytes, 8),
    }
}

/// The status in the bytes of [`STATUS`] or [`READING`].
pub(super) fn status(bytes: &[u8]) -> DetectorStatus {
    DetectorStatus {
        phase: match bytes[0] {
            0 => Phase::Idle,
            1 => Phase::Integrating,
            3 => Phase::Saturated,
            _ => Phase::Ready,
        },
        sequence: u32_of(bytes, STATUS, photometer::READING_SEQUENCE),
    }
}

/// The photometer's clock in the bytes of [`READING`].
pub(super) fn ticks(bytes: &[u8]) -> u32 {
    u32_of(bytes, READING, photometer::PRESENT_TIME)
}

/// The reading in the bytes of [`READING`]; `None` where there is none yet, or its gain step is unheard of.
pub(super) fn reading(bytes: &[u8]) -> Option<Counts> {
    let status = status(bytes);
    let at = |register| u32_of(bytes, READING, register);
    let offset = |register: Register| usize::from(register.address - READING.address);
    let gain = Gain::ALL.get(usize::from(bytes[offset(photometer::READING_GAIN_STEP)]))?;
    if matches!(status.phase, Phase::Idle | Phase::Integrating) {
        return None;
    }
    Some(Counts {
        rgb: [
            at(photometer::READING_RED),
            at(photometer::READING_GREEN),
            at(photometer::READING_BLUE),
        ],
        monitor: at(photometer::READING_MONITOR),
        exposure: Exposure {
            integration_us: at(photometer::READING_INTEGRATION_TIME),
            gain: *gain,
        },
        saturated: status.phase == Phase::Saturated,
        sequence: status.sequence,
        ticks: at(photometer::READING_TIME),
        temperature_c: bytes[offset(photometer::TEMPERATURE)],
    })
}

/// A register within the bytes of a block.
pub(super) fn u32_of(bytes: &[u8], block: Block, register: Register) -> u32 {
    u32_at(bytes, usize::from(register.address - block.address))
}

/// Little-endian bytes at an offset, as a number. The line has checked the length.
pub(super) fn u32_at(bytes: &[u8], offset: usize) -> u32 {
    u32::from_le_bytes([
        bytes[offset],
        bytes[offset + 1],
        bytes[offset + 2],
        bytes[offset + 3],
    ])
}

/// As [`u32_at`], signed.
pub(super) fn i32_at(bytes: &[u8], offset: usize) -> i32 {
    u32_at(bytes, offset).cast_signed()
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;
    use crate::dynamixel::MODELS;

    /// Positions of a servo in its multi-turn range (e-manual, "Present Position(132)"), which hold those of every model
    /// within a turn.
    const POSITIONS: std::ops::RangeInclusive<i32> = -1_048_575..=1_048_575;

    fn stuffs(bytes: &[u8]) -> bool {
        bytes.windows(4).any(|window| window == [0xFF, 0xFF, 0xFF, 0xFD])
    }

    fn joined(parts: &[&[u8]]) -> Vec<u8> {
        parts.concat()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2048))]

        #[test]
        fn prop_state_of_a_servo_never_stuffs(
            torque in 0u8..2, error in 0u8..64, moving in 0u8..2, status in 0u8..64,
            goal in POSITIONS, position in POSITIONS,
        ) {
            let bytes = joined(&[&goal.to_le_bytes(), &[torque, error, moving, status], &position.to_le_bytes()]);
            prop_assert_eq!(bytes.len(), STATE_LENGTH);
            prop_assert!(!stuffs(&bytes), "{:02X?}", bytes);
            let state = state(&bytes);
            prop_assert_eq!((state.goal, state.position), (goal, position));
        }

        #[test]
        fn prop_registers_read_alone_never_stuff(value in POSITIONS) {
            prop_assert!(!stuffs(&value.to_le_bytes()));
        }

        #[test]
        fn prop_setup_of_a_servo_never_stuffs(
            firmware in 0u8..255, id in 0u8..253, baud in 0u8..8, delay in 0u8..255,
            drive in 0u8..16, mode in 0u8..17,
        ) {
            prop_assert!(!stuffs(&[firmware, id, baud, delay]));
            prop_assert!(!stuffs(&[drive, mode]));
        }

        /// Bytes that docs/photometer.md leaves unnamed read 0; every number has 24 bits.
        #[test]
        fn prop_reading_of_the_photometer_never_stuffs(
            status in 0u8..4, gain in 0u8..3, numbers in vec(0u32..1 << 24, 8), temperature: u8,
        ) {
            let mut bytes = joined(&[&[status, gain, 0, 0]]);
            bytes.extend(numbers[..7].iter().flat_map(|n| n.to_le_bytes()));
            bytes.extend([temperature, 0, 0, 0]);
            bytes.extend(numbers[7].to_le_bytes());
            prop_assert_eq!(bytes.len(), READING.length);
            prop_assert!(!stuffs(&bytes), "{:02X?}", bytes);
            prop_assert!(!stuffs(&bytes[..STATUS.length]));
            if let Some(counts) = reading(&bytes) {
                prop_assert_eq!(counts.sequence, numbers[0]);
                prop_assert_eq!(counts.rgb, [numbers[2], numbers[3], numbers[4]]);
                prop_assert_eq!(counts.ticks, numbers[6]);
                prop_assert_eq!(ticks(&bytes), numbers[7]);
                prop_assert_eq!(counts.temperature_c, temperature);
            }
        }
    }

    /// The position at every value, not only at random ones.
    #[test]
    fn no_position_stuffs_behind_any_goal_that_ends_in_ones() {
        for goal in [0i32, 253, 255, 4095, -1, -513, -131_073] {
            for position in POSITIONS {
                let [g, p] = [goal.to_le_bytes(), position.to_le_bytes()];
                let bytes = [g[0], g[1], g[2], g[3], 0, 0, 0, 0, p[0], p[1], p[2], p[3]];
                assert!(!stuffs(&bytes), "goal {goal}, position {position}");
            }
        }
    }

    #[test]
    fn the_neighbours_that_are_avoided_do_stuff() {
        let neighbours = joined(&[&(-1i32).to_le_bytes(), &(-3i32).to_le_bytes()]);
        assert!(
            stuffs(&neighbours),
            "velocity and position, goal and position, two limits"
        );
    }

    #[test]
    fn the_map_names_each_byte_of_the_state() {
        for model in MODELS {
            let map = state_map(model.series);
            let area = model.series.indirect[0];
            assert_eq!(map.len(), state_map_block(area).length);
            assert!(usize::from(area.cells) >= STATE_LENGTH, "{}", model.name);
            assert!(!stuffs(&map));
            let addresses: Vec<u16> = map.chunks(2).map(|c| u16::from_le_bytes([c[0], c[1]])).collect();
            let x = [116, 117, 118, 119, 64, 70, 122, 123, 132, 133, 134, 135];
            assert_eq!(addresses, x.map(|address| model.series.place(address)));
        }
    }

    #[test]
    fn no_reading_before_the_first_trigger_and_while_integrating() {
        let mut bytes = vec![0; READING.length];
        assert_eq!(reading(&bytes), None);
        bytes[0] = 1;
        assert_eq!(reading(&bytes), None);
        bytes[0] = 3;
        assert!(reading(&bytes).unwrap().saturated);
    }
}
