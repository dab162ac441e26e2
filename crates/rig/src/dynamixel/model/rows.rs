use super::Model;
use super::series::{MX, P, X, X330};

/// Modes of a servo with current registers: current, velocity, position, extended position, current-based position, PWM.
const ALL_MODES: &[u8] = &[0, 1, 3, 4, 5, 16];

/// Modes of a servo without: velocity, position, extended position, PWM.
const WITHOUT_CURRENT: &[u8] = &[1, 3, 4, 16];

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

/// XH430 for 12 V, and XD430, whose table is the same.
const XH430_W: Model = Model {
    current_limit: Some(648),
    gains: [1920, 100, 0, 0, 900],
    ..X_12V
};

/// What the 24 V models of the X series have in common; currents of the XH430-V in 1.34 mA.
const X_24V: Model = Model {
    supply_v: 24.0,
    voltage_limits: [110, 300],
    voltage_least: 110,
    ..X_12V
};

/// XW: watertight, without an LED.
const XW430: Model = Model {
    gains: [1920, 100, 0, 0, 900],
    ..XW540
};

const XW540: Model = Model { leds: 0, ..X_12V };

/// XL430, XC430 and the two-axis modules, of which each axis is a servo with an id of its own: no current registers.
const X430_LOAD: Model = Model {
    current_limit: None,
    modes: WITHOUT_CURRENT,
    voltage_limits: [60, 160],
    voltage_least: 60,
    ..X_12V
};

/// XL430 and 2XL430, for three cells.
const XL430: Model = Model {
    supply_v: 11.1,
    voltage_limits: [60, 140],
    temperature_limit_c: 72,
    ..X430_LOAD
};

/// XL330 and XC330-M, for 5 V; currents in mA.
const X330_5V: Model = Model {
    series: &X330,
    supply_v: 5.0,
    voltage_limits: [35, 70],
    voltage_least: 31,
    temperature_limit_c: 70,
    velocity_max: 2047,
    ..X_12V
};

/// XL330.
const XL330: Model = Model {
    current_limit: Some(1750),
    shutdown: 53,
    ..X330_5V
};

/// XC330-T, for three cells.
const XC330_T: Model = Model {
    supply_v: 11.1,
    voltage_limits: [55, 140],
    voltage_least: 55,
    current_limit: Some(910),
    gains: [1200, 40, 0, 0, 900],
    ..X330_5V
};

/// MX with Protocol 2.0; currents in 3.36 mA.
const MX_12V: Model = Model {
    series: &MX,
    acceleration_limit: Some(32_767),
    gains: [1920, 100, 0, 0, 850],
    ..X_12V
};

/// What the P series has in common; currents in mA.
const P_24V: Model = Model {
    series: &P,
    supply_v: 24.0,
    voltage_limits: [150, 350],
    voltage_least: 150,
    modes: &[0, 1, 3, 4, 16],
    shutdown: 58,
    leds: 3,
    external_ports: 4,
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
    Model { name: "XH430-W350", number: 1000, velocity_limit: 130, ..XH430_W },
    Model { name: "XH430-W210", number: 1010, velocity_limit: 210, ..XH430_W },
    Model { name: "XH430-V350", number: 1040, current_limit: Some(689), velocity_limit: 135, ..X_24V },
    Model { name: "XH430-V210", number: 1050, current_limit: Some(689), velocity_limit: 380, ..X_24V },
    Model { name: "XH540-V270", number: 1140, velocity_limit: 128, external_ports: 3, ..X_24V },
    Model { name: "XH540-V150", number: 1150, velocity_limit: 230, external_ports: 3, ..X_24V },
    Model { name: "XD430-T350", number: 1001, velocity_limit: 130, ..XH430_W },
    Model { name: "XD430-T210", number: 1011, velocity_limit: 210, ..XH430_W },
    Model { name: "XD540-T270", number: 1101, velocity_limit: 167, ..X540_12V },
    Model { name: "XD540-T150", number: 1111, velocity_limit: 300, ..X540_12V },
    Model { name: "XW430-T333", number: 1270, velocity_limit: 139, ..XW430 },
    Model { name: "XW430-T200", number: 1280, velocity_limit: 235, ..XW430 },
    Model { name: "XW540-T260", number: 1170, velocity_limit: 167, ..XW540 },
    Model { name: "XW540-T140", number: 1180, velocity_limit: 304, ..XW540 },
    Model { name: "XW540-H260", number: 1310, current_limit: Some(1188), velocity_limit: 145, leds: 0, ..X_24V },
    Model { name: "XL430-W250", number: 1060, velocity_limit: 415, gains: [1000, 100, 4000, 0, 640], ..XL430 },
    Model { name: "2XL430-W250", number: 1090, velocity_limit: 250, gains: [1800, 100, 2000, 0, 640], ..XL430 },
    Model { name: "XC430-W150", number: 1070, velocity_limit: 460, gains: [1920, 100, 0, 0, 460], ..X430_LOAD },
    Model { name: "XC430-W240", number: 1080, velocity_limit: 306, gains: [1920, 100, 0, 0, 700], ..X430_LOAD },
    Model { name: "2XC430-W250", number: 1160, velocity_limit: 275, gains: [1920, 100, 0, 0, 700], ..X430_LOAD },
    Model { name: "XL330-M077", number: 1190, velocity_limit: 1620, gains: [400, 40, 0, 400, 400], ..XL330 },
    Model { name: "XL330-M288", number: 1200, velocity_limit: 445, gains: [1600, 180, 0, 0, 400], ..XL330 },
    Model { name: "XC330-M181", number: 1230, velocity_limit: 545, current_limit: Some(2352), gains: [1400, 100, 500, 0, 1200], ..X330_5V },
    Model { name: "XC330-M288", number: 1240, velocity_limit: 350, current_limit: Some(2352), gains: [1600, 50, 500, 0, 1100], ..X330_5V },
    Model { name: "XC330-T181", number: 1210, velocity_limit: 510, ..XC330_T },
    Model { name: "XC330-T288", number: 1220, velocity_limit: 320, ..XC330_T },
    Model { name: "MX-28", number: 30, velocity_limit: 230, current_limit: None, modes: WITHOUT_CURRENT, ..MX_12V },
    Model { name: "MX-64", number: 311, velocity_limit: 435, current_limit: Some(1941), ..MX_12V },
    Model { name: "MX-106", number: 321, velocity_limit: 360, ..MX_12V },
    Model { name: "PH54-200-S500", number: 2020, counts_per_turn: 1_003_846, position_limits: [-501_433, 501_433], current_limit: Some(22_740), acceleration_limit: Some(9982), acceleration_max: 3_992_644, velocity_limit: 2900, velocity_max: 2900, gains: [2209, 6153, 0, 0, 314], shutdown: 52, ..P_24V },
    Model { name: "PH54-100-S500", number: 2010, counts_per_turn: 1_003_846, position_limits: [-501_433, 501_433], current_limit: Some(15_900), acceleration_limit: Some(4_255_632), acceleration_max: 4_255_632, velocity_limit: 2920, velocity_max: 2920, gains: [1290, 3593, 0, 0, 502], ..P_24V },
    Model { name: "PH42-020-S300", number: 2000, counts_per_turn: 607_500, position_limits: [-303_454, 303_454], current_limit: Some(4500), acceleration_limit: Some(10_765), acceleration_max: 4_306_173, velocity_limit: 2920, velocity_max: 2920, gains: [502, 1332, 0, 0, 879], ..P_24V },
    Model { name: "PM54-060-S250", number: 2120, counts_per_turn: 502_834, position_limits: [-251_173, 251_173], current_limit: Some(7980), acceleration_limit: Some(11_145), acceleration_max: 4_457_932, velocity_limit: 2830, velocity_max: 2830, gains: [813, 2265, 0, 0, 502], ..P_24V },
    Model { name: "PM54-040-S250", number: 2110, counts_per_turn: 502_834, position_limits: [-251_173, 251_173], current_limit: Some(4470), acceleration_limit: Some(11_037), acceleration_max: 4_414_976, velocity_limit: 2840, velocity_max: 2840, gains: [408, 1137, 0, 0, 502], ..P_24V },
    Model { name: "PM42-010-S260", number: 2100, counts_per_turn: 526_374, position_limits: [-262_931, 262_931], current_limit: Some(1461), acceleration_limit: Some(4_346_756), acceleration_max: 4_346_756, velocity_limit: 2600, velocity_max: 2600, gains: [6740, 2145, 0, 0, 1061], ..P_24V },
];
