/// What the devices feel of the world around the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Supply of light and sensor servo, V.
    pub supply_v: [f64; 2],
    /// Light servo, sensor servo and photometer, °C.
    pub temperature_c: [f64; 3],
    /// Whether the photometer's door contact is open; a node without one reads closed.
    pub door_open: bool,
}
