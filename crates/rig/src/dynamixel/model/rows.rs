use super::Model;
use super::series::X;

/// Modes of a servo with current registers: current, velocity, position, extended position, current-based position, PWM.
const ALL_MODES: &[u8] = &[0, 1, 3, 4, 5, 16];

/// What the 12 V models of the X series have in common.
const X_12V: Model = Model {
    name: "",
    number: 0,
    series: &X,
    counts_per_turn: 4096,
    supply_v: 12.0,
    voltage_limits: [95, 160],
    voltage_least: 95,
    temperature_limit_c: 80,
    current_limit: Some(2047),
    acceleration_limit: None,
    acceleration_max: 32_767,
    velocity_limit: 0,
    velocity_max: 1023,
    position_limits: [0, 4095],
    modes: ALL_MODES,
    shutdown: 52,
    gains: [1920, 100, 0, 0, 800],
    leds: 1,
    external_ports: 0,
};

/// What the 12 V models of the size 540 have in common.
const X540_12V: Model = Model {
    external_ports: 3,
    ..X_12V
};

/// Every model that a rig may have.
#[rustfmt::skip]
pub static MODELS: &[Model] = &[
    Model { name: "XM430-W350", number: 1020, current_limit: Some(1193), velocity_limit: 200, ..X_12V },
    Model { name: "XM430-W210", number: 1030, current_limit: Some(1193), velocity_limit: 330, ..X_12V },
    Model { name: "XM540-W270", number: 1120, velocity_limit: 128, ..X540_12V },
    Model { name: "XM540-W150", number: 1130, velocity_limit: 230, ..X540_12V },
    Model { name: "XH540-W270", number: 1100, velocity_limit: 167, ..X540_12V },
    Model { name: "XH540-W150", number: 1110, velocity_limit: 300, ..X540_12V },
];
