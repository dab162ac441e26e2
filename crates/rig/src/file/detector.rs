use std::time::Duration;

use super::raw::{RawDetector, RawPhotometer};
use super::source::Source;
use super::{PhotometerSettings, Port, RigFile, Visits};
use crate::drivers::scpi::{PROFILES, Profile};
use crate::{Lamp, RigError};

/// Longest time that a connection takes.
pub(crate) const CONNECTION: Duration = Duration::from_secs(2);

/// `[detector]`: what counts the light, where, and how it is spoken to.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorSettings {
    /// Of what kind it is.
    pub kind: DetectorKind,
    /// Where it is: "tcp:HOST:PORT", or a device file.
    pub address: String,
    /// Baud rate of a serial port.
    pub baud: u32,
    /// How it is spoken to.
    pub profile: Profile,
    /// Reading that is full scale in the shortest integration at gain ×1, in the instrument's unit.
    pub full_reading: f64,
    /// Frequency of the mains, Hz, in whose periods it integrates.
    pub line_hz: f64,
    /// For how long an answer may be late.
    pub timeout: Duration,
    /// What is thrown away after a change of range.
    pub settle: Duration,
    /// Who switches the lamp.
    pub lamp: LampControl,
    /// Command that is sent after the profile's own set-up; empty: none.
    pub setup: String,
    /// Command before a reading whose range or time differs from the last one's, with {range}, {nplc}, {averages}.
    pub configure: String,
    /// Question for a reading.
    pub read: String,
    /// Command that switches the lamp on.
    pub lamp_on: String,
    /// Command that switches it off.
    pub lamp_off: String,
}

/// Kinds of detectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetectorKind {
    /// The photometer node on the servos' bus.
    Node,
    /// An instrument that speaks SCPI.
    Scpi,
}

/// Who switches the lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LampControl {
    /// The photometer node on the servos' bus.
    Node,
    /// The instrument, by two commands of the rig file.
    Scpi,
    /// Nobody: it is always on.
    Always,
}

impl DetectorSettings {
    /// The command for a range, in the instrument's unit, and an integration time.
    pub(crate) fn configure(&self, range: f64, integration: Duration) -> String {
        let seconds = integration.as_secs_f64();
        let averages = match self.profile.average_ms {
            0.0 => 1.0,
            each => (seconds * 1e3 / each).round().max(1.0),
        };
        self.configure
            .replace("{range}", &format!("{range:.4E}"))
            .replace("{nplc}", &format!("{:.4}", seconds * self.line_hz))
            .replace("{averages}", &format!("{averages:.0}"))
    }

    /// The longest that a reading may take beside its integration until it has failed: two connections, two settings of
    /// the range, and two readings whose answers do not come.
    pub(crate) fn longest(&self, integration: Duration) -> Duration {
        2 * (CONNECTION + self.settle + 2 * integration + 8 * self.timeout)
    }

    /// Whether it has its place on the servos' bus.
    pub fn on_bus(&self) -> bool {
        self.kind == DetectorKind::Node
    }

    /// Whether a device on the servos' bus has the id of the photometer: the detector, or what switches the lamp.
    pub fn has_node(&self) -> bool {
        self.on_bus() || self.lamp == LampControl::Node
    }

    /// What it can do, for plans and people.
    pub fn abilities(&self) -> Abilities {
        let node = self.on_bus();
        Abilities {
            channels: if node {
                &["red", "green", "blue"]
            } else {
                &["grey"]
            },
            monitor: node,
            clock: node,
            in_flight: node,
            lamp: if node { LampControl::Node } else { self.lamp },
        }
    }
}

/// What a detector can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Names of its channels; one alone is written to red, green and blue.
    pub channels: &'static [&'static str],
    /// Whether it measures the lamp with each reading.
    pub monitor: bool,
    /// Whether it says itself when a reading was taken.
    pub clock: bool,
    /// Whether it can be read while the arms move.
    pub in_flight: bool,
    /// Who switches its lamp.
    pub lamp: LampControl,
}

impl Abilities {
    /// What it cannot do that a plan would else count with, and what is done instead; a sentence each.
    pub fn limits(&self) -> Vec<String> {
        let mut limits = Vec::new();
        if self.channels.len() == 1 {
            limits.push("one channel: the BRDF is grey, the same in red, green and blue".to_owned());
        }
        if !self.monitor {
            limits.push("no lamp monitor: visits to the reference pose follow the lamp".to_owned());
        }
        if !self.in_flight {
            limits.push("not read in flight: the arms stop for each reading".to_owned());
        }
        if self.lamp == LampControl::Always {
            limits.push(
                "nothing switches the lamp: it stays on whatever happens, and the instrument's zero is taken for the dark, \
                 so keep light of the room away"
                    .to_owned(),
            );
        }
        limits
    }
}

/// `[detector]`, checked, with what it asks of other tables.
pub(super) fn detector(
    source: &Source<'_>,
    raw: &RawDetector,
    photometer: (&RawPhotometer, &PhotometerSettings),
    visits: &Visits,
    port: &Port,
) -> Result<DetectorSettings, RigError> {
    let text = |key: &str, value: &toml::Spanned<String>| {
        source.line(&format!("detector.{key}"), value, value.get_ref())
    };
    let kinds = [("node", DetectorKind::Node), ("scpi", DetectorKind::Scpi)];
    let kind = source.one_of("detector.kind", &raw.kind, &kinds)?;
    let profiles = PROFILES.map(|profile| (profile.name, profile));
    let profile = source.one_of("detector.profile", &raw.profile, &profiles)?;
    let lamps = [
        ("node", LampControl::Node),
        ("scpi", LampControl::Scpi),
        ("always", LampControl::Always),
    ];
    let or = |own: String, of_profile: &str| match own.is_empty() {
        true => of_profile.to_owned(),
        false => own,
    };
    let settings = DetectorSettings {
        kind,
        address: text("address", &raw.address)?,
        baud: source.within("detector.baud", &raw.baud, 300..=4_000_000)? as u32,
        profile,
        full_reading: source.within("detector.full_reading", &raw.full_reading, 1e-15..=1e6)?,
        line_hz: source.within("detector.line_hz", &raw.line_hz, 40.0..=70.0)?,
        timeout: super::check::millis(source, "detector.timeout_ms", &raw.timeout_ms, 10.0..=60_000.0)?,
        settle: super::check::millis(source, "detector.settle_ms", &raw.settle_ms, 0.0..=60_000.0)?,
        lamp: source.one_of("detector.lamp", &raw.lamp, &lamps)?,
        setup: text("setup", &raw.setup)?,
        configure: or(text("configure", &raw.configure)?, profile.configure),
        read: or(text("read", &raw.read)?, profile.read),
        lamp_on: text("lamp_on", &raw.lamp_on)?,
        lamp_off: text("lamp_off", &raw.lamp_off)?,
    };
    if kind == DetectorKind::Node {
        return Ok(settings);
    }
    if settings.address.is_empty() {
        let allowed = "\"tcp:HOST:PORT\", such as \"tcp:192.168.0.20:5025\", a serial port, or /dev/usbtmc0";
        return Err(source.refuse("detector.address", &raw.address, "empty", allowed));
    }
    let simulated = settings.address == RigFile::SIMULATED;
    if simulated && *port != Port::Sim {
        let allowed = "an address; \"sim\" is for bus.port = \"sim\"";
        return Err(source.refuse("detector.address", &raw.address, "\"sim\"", allowed));
    }
    if visits.lamp == Lamp::Monitor {
        let allowed = "calibration.lamp = \"visits\" with it: it has no lamp monitor";
        return Err(source.refuse("detector.kind", &raw.kind, "\"scpi\"", allowed));
    }
    for (key, value, text) in [
        ("lamp_on", &raw.lamp_on, &settings.lamp_on),
        ("lamp_off", &raw.lamp_off, &settings.lamp_off),
    ] {
        if settings.lamp == LampControl::Scpi && text.is_empty() {
            let allowed = "the command that does it, where lamp = \"scpi\"";
            return Err(source.refuse(&format!("detector.{key}"), value, "empty", allowed));
        }
    }
    let (raw, checked) = photometer;
    let [least, most] = profile.nplc.map(|nplc| nplc / settings.line_hz * 1e6);
    for (key, value, us) in [
        (
            "photometer.integration_min_us",
            &raw.integration_min_us,
            checked.integration_min_us,
        ),
        (
            "photometer.integration_max_us",
            &raw.integration_max_us,
            checked.integration_max_us,
        ),
    ] {
        if !(least..=most).contains(&f64::from(us)) {
            let allowed = format!(
                "{least:.0} … {most:.0}, what the profile \"{}\" can do",
                profile.name
            );
            return Err(source.refuse(key, value, us, allowed));
        }
    }
    Ok(settings)
}
