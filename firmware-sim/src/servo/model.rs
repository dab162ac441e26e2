/// What differs between the X-series models of a rig (e-manual pages of each).
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) name: &'static str,
    pub(crate) number: u16,
    /// Current Limit, initial value and maximum, 2.69 mA.
    pub(crate) current_limit: i64,
    /// Velocity Limit, initial value, 0.229 rpm.
    pub(crate) velocity_limit: i64,
    pub(crate) external_ports: bool,
}

/// The models that a rig file may name.
const MODELS: [Model; 6] = [
    model("XM430-W350", 1020, 1193, 200, false),
    model("XM430-W210", 1030, 1193, 330, false),
    model("XM540-W270", 1120, 2047, 128, true),
    model("XM540-W150", 1130, 2047, 230, true),
    model("XH540-W270", 1100, 2047, 167, true),
    model("XH540-W150", 1110, 2047, 300, true),
];

const fn model(
    name: &'static str,
    number: u16,
    current_limit: i64,
    velocity_limit: i64,
    external_ports: bool,
) -> Model {
    Model {
        name,
        number,
        current_limit,
        velocity_limit,
        external_ports,
    }
}

impl Model {
    /// The model of this name.
    pub(crate) fn named(name: &str) -> Option<&'static Self> {
        const { &MODELS }.iter().find(|model| model.name == name)
    }

    /// Names of all models.
    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        const { &MODELS }.iter().map(|model| model.name)
    }
}
