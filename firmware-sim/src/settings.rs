use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::time::Duration;

use arms::Pose;
use pdv::Placement;
use rig::RigFile;
use serde::Deserialize;

use crate::mishaps::Rates;
use crate::{Fault, Imperfections, Mechanics, MechanicsKeys, Mishap, SimError, UpTo, mechanics};

/// How a simulated bench behind the wire keeps time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// By what happens on the wire: bytes, return delays, reply deadlines and the Delay register.
    Wire,
    /// Real time.
    Real,
}

/// The `[sim]` table of a rig file, checked. Every key, its unit, default and range stand in config/rig.toml.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// What lies on the stage, in the words of [`brdf::specimen`].
    pub specimen: String,
    /// How it lies there.
    pub place: Placement,
    /// Seed of every random effect.
    pub seed: u64,
    /// How time passes behind the wire.
    pub clock: Clock,
    /// By how much the bench is not ideal.
    pub imperfections: Imperfections,
    /// How light and sensor servo depart from ideal ones.
    pub mechanics: [Mechanics; 2],
    /// How long a device is deaf after a reboot.
    pub boot: Duration,
    /// Where the arms stand when power comes on.
    pub start: Pose,
    /// Temperature of the room, °C.
    pub ambient_c: f64,
    /// What goes wrong with the devices at given times.
    pub faults: Vec<Fault>,
    /// How often they fail by chance, per hour.
    pub mishaps: BTreeMap<Mishap, f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Preset {
    Default,
    None,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    /// Faults on the wire, which the wire reads itself.
    #[serde(rename = "wire")]
    _wire: Option<serde::de::IgnoredAny>,
    #[serde(default)]
    fault: Vec<Fault>,
    #[serde(default)]
    mishaps: Rates,
    specimen: Option<String>,
    #[serde(default)]
    place: RawPlace,
    seed: Option<i64>,
    clock: Option<Clock>,
    imperfections: Option<Preset>,
    boot_ms: Option<f64>,
    start_light_deg: Option<f64>,
    start_sensor_deg: Option<f64>,
    ambient_c: Option<f64>,
    shot_noise_electrons: Option<f64>,
    read_noise_counts: Option<f64>,
    dark_counts_per_s: Option<f64>,
    dark_doubling_c: Option<f64>,
    dark_offset_counts: Option<f64>,
    self_heating_c: Option<f64>,
    stray_per_sr: Option<f64>,
    room_light_per_sr: Option<f64>,
    room_flicker_hz: Option<f64>,
    lamp_warm_up_ms: Option<f64>,
    lamp_drift: Option<f64>,
    lamp_flicker: Option<f64>,
    source_aperture_deg: Option<f64>,
    detector_aperture_deg: Option<f64>,
    light_backlash_deg: Option<f64>,
    sensor_backlash_deg: Option<f64>,
    following_lag_ms: Option<f64>,
    responsivity_error: Option<f64>,
    gain_error: Option<f64>,
    nonlinearity: Option<f64>,
    crosstalk: Option<f64>,
    lamp_trend_per_h: Option<f64>,
    light_zero_deg: Option<f64>,
    sensor_zero_deg: Option<f64>,
    static_error_counts: Option<UpTo<100>>,
    stiction_counts: Option<UpTo<100>>,
    creep: Option<mechanics::Creep>,
    hunting: Option<mechanics::Hunting>,
    jitter_counts: Option<UpTo<50>>,
    ring: Option<mechanics::Ring>,
    gravity_counts: Option<UpTo<500>>,
    sag_deg_per_s: Option<UpTo<90>>,
    encoder_error: Option<mechanics::EncoderError>,
    encoder_noise_deg: Option<UpTo<5>>,
    #[serde(default)]
    light: MechanicsKeys,
    #[serde(default)]
    sensor: MechanicsKeys,
}

/// How the specimen lies on the stage.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlace {
    azimuth_deg: Option<f64>,
    tilt_deg: Option<f64>,
    axis_deg: Option<f64>,
}

impl RawPlace {
    fn check(&self) -> Result<Placement, SimError> {
        Ok(Placement {
            azimuth: within("place.azimuth_deg", self.azimuth_deg, 0.0, -180.0..=180.0)?.to_radians(),
            tilt: within("place.tilt_deg", self.tilt_deg, 0.0, 0.0..=60.0)?.to_radians(),
            axis: within("place.axis_deg", self.axis_deg, 0.0, -180.0..=180.0)?.to_radians(),
        })
    }
}

impl Settings {
    /// Checks the `[sim]` table of a rig file.
    ///
    /// # Errors
    /// An unknown key, a wrong type, a value out of its range, a start that the envelope forbids.
    pub fn new(rig: &RigFile) -> Result<Self, SimError> {
        let raw: Raw = read(&rig.sim).map_err(|why| SimError::Form { why })?;
        let park = rig.motion.park;
        let start = Pose::from_deg(
            within(
                "start_light_deg",
                raw.start_light_deg,
                park.light.deg(),
                -90.0..=90.0,
            )?,
            within(
                "start_sensor_deg",
                raw.start_sensor_deg,
                park.sensor.deg(),
                -90.0..=90.0,
            )?,
        );
        rig.envelope
            .check_pose(start)
            .map_err(|source| SimError::Start { source })?;
        Ok(Self {
            seed: within("seed", raw.seed, 1, 0..=i64::MAX)?.unsigned_abs(),
            boot: ms("boot_ms", raw.boot_ms, Duration::from_millis(500), 10_000.0)?,
            ambient_c: within("ambient_c", raw.ambient_c, 23.0, 0.0..=60.0)?,
            imperfections: imperfections(&raw)?,
            mechanics: mechanics(&raw),
            clock: raw.clock.unwrap_or(Clock::Wire),
            place: raw.place.check()?,
            specimen: raw.specimen.unwrap_or_else(|| "gold-paint".to_owned()),
            start,
            faults: raw.fault,
            mishaps: raw.mishaps,
        })
    }
}

/// Reads a table that was taken out of its file into a type. The error names every key that the type does not know.
pub(crate) fn read<T: serde::de::DeserializeOwned>(table: &toml::Table) -> Result<T, String> {
    // Its lines are not those of the file, and are not told.
    config::parse(&table.to_string()).map_err(|flaws| flaws.to_string())
}

/// What holds for both arms, and what each arm's own table makes of it.
fn mechanics(raw: &Raw) -> [Mechanics; 2] {
    let base = match raw.imperfections {
        None | Some(Preset::Default) => Mechanics::DEFAULT,
        Some(Preset::None) => Mechanics::NONE,
    };
    let both = MechanicsKeys {
        static_error_counts: raw.static_error_counts,
        stiction_counts: raw.stiction_counts,
        creep: raw.creep,
        hunting: raw.hunting,
        jitter_counts: raw.jitter_counts,
        ring: raw.ring,
        gravity_counts: raw.gravity_counts,
        sag_deg_per_s: raw.sag_deg_per_s,
        encoder_error: raw.encoder_error,
        encoder_noise_deg: raw.encoder_noise_deg,
    };
    [raw.light, raw.sensor].map(|own| own.over(both.over(base)))
}

fn imperfections(raw: &Raw) -> Result<Imperfections, SimError> {
    let base = match raw.imperfections {
        None | Some(Preset::Default) => Imperfections::DEFAULT,
        Some(Preset::None) => Imperfections::NONE,
    };
    let amount = |key, value, base, max| within(key, value, base, 0.0..=max);
    let signed = |key, value, base, max: f64| within(key, value, base, -max..=max);
    /// The key of this name as the field of this name.
    macro_rules! read {
        ($how:ident $key:ident to $max:literal) => {
            $how(stringify!($key), raw.$key, base.$key, $max)?
        };
    }
    Ok(Imperfections {
        shot_noise_electrons: read!(amount shot_noise_electrons to 1e6),
        read_noise_counts: read!(amount read_noise_counts to 1e4),
        dark_counts_per_s: read!(amount dark_counts_per_s to 1e6),
        dark_doubling_c: read!(amount dark_doubling_c to 100.0),
        dark_offset_counts: read!(amount dark_offset_counts to 1e5),
        self_heating_c: read!(amount self_heating_c to 50.0),
        stray_per_sr: read!(amount stray_per_sr to 1.0),
        room_light_per_sr: read!(amount room_light_per_sr to 100.0),
        room_flicker_hz: read!(amount room_flicker_hz to 10_000.0),
        lamp_warm_up: ms(
            "lamp_warm_up_ms",
            raw.lamp_warm_up_ms,
            base.lamp_warm_up,
            60_000.0,
        )?,
        lamp_drift: read!(amount lamp_drift to 0.5),
        lamp_flicker: read!(amount lamp_flicker to 0.5),
        source_aperture_deg: read!(amount source_aperture_deg to 10.0),
        detector_aperture_deg: read!(amount detector_aperture_deg to 10.0),
        light_backlash_deg: read!(amount light_backlash_deg to 5.0),
        sensor_backlash_deg: read!(amount sensor_backlash_deg to 5.0),
        following_lag: ms(
            "following_lag_ms",
            raw.following_lag_ms,
            base.following_lag,
            500.0,
        )?,
        responsivity_error: read!(signed responsivity_error to 0.5),
        gain_error: read!(signed gain_error to 0.5),
        nonlinearity: read!(amount nonlinearity to 0.2),
        crosstalk: read!(amount crosstalk to 0.5),
        lamp_trend_per_h: read!(signed lamp_trend_per_h to 0.5),
        light_zero_deg: read!(signed light_zero_deg to 5.0),
        sensor_zero_deg: read!(signed sensor_zero_deg to 5.0),
    })
}

/// A value within a range, or its default; NaN is in none.
fn within<T: PartialOrd + Display>(
    key: &'static str,
    value: Option<T>,
    default: T,
    range: RangeInclusive<T>,
) -> Result<T, SimError> {
    let value = value.unwrap_or(default);
    if range.contains(&value) {
        return Ok(value);
    }
    Err(SimError::Value {
        key,
        found: value.to_string(),
        allowed: format!("{} … {}", range.start(), range.end()),
    })
}

fn ms(key: &'static str, value: Option<f64>, default: Duration, max: f64) -> Result<Duration, SimError> {
    within(key, value, default.as_secs_f64() * 1e3, 0.0..=max).map(|ms| Duration::from_secs_f64(ms / 1e3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Result<Settings, SimError> {
        let rig = RigFile::parse(text, "test.toml".as_ref()).unwrap();
        Settings::new(&rig)
    }

    fn error(sim: &str) -> String {
        settings(&format!("[sim]\n{sim}")).unwrap_err().to_string()
    }

    #[test]
    fn the_shipped_file_shows_the_defaults() {
        let is_key = |text: &str| text.bytes().all(|b| b.is_ascii_lowercase() || b == b'_');
        let shown: String = RigFile::BUILT_IN
            .lines()
            .map(|line| match line.strip_prefix("# ") {
                Some(text) if text.split_once(" = ").is_some_and(|(key, _)| is_key(key)) => {
                    format!("{text}\n")
                }
                _ => format!("{line}\n"),
            })
            .collect();
        let default = settings("").unwrap();
        assert_eq!(settings(&shown).unwrap(), default);
        // Every amount is shown: nothing is left of the other preset.
        let other = shown.replace("imperfections = \"default\"", "imperfections = \"none\"");
        assert_ne!(other, shown);
        assert_eq!(settings(&other).unwrap(), default);
        assert_eq!(default.imperfections, Imperfections::DEFAULT);
    }

    #[test]
    fn none_means_none_and_an_amount_overrides_it() {
        let none = settings("[sim]\nimperfections = \"none\"").unwrap();
        assert_eq!(none.imperfections, Imperfections::NONE);
        let some = settings("[sim]\nimperfections = \"none\"\nlamp_drift = 0.1").unwrap();
        let expected = Imperfections {
            lamp_drift: 0.1,
            ..Imperfections::NONE
        };
        assert_eq!(some.imperfections, expected);
    }

    #[test]
    fn an_arm_s_own_table_wins_over_what_holds_for_both() {
        let of = settings("[sim]\njitter_counts = 2\nstiction_counts = 3\n[sim.sensor]\njitter_counts = 0")
            .unwrap();
        let [light, sensor] = of.mechanics;
        assert_eq!([light.jitter_counts, sensor.jitter_counts], [2.0, 0.0]);
        assert_eq!([light.stiction_counts, sensor.stiction_counts], [3.0, 3.0]);
        for bad in [
            "jitter_counts = -1",
            "gravity_counts = nan",
            "[sim.light]\nhunting = { counts = 2, hz = 51 }",
        ] {
            assert!(error(bad).contains("not allowed"), "{bad}: {}", error(bad));
        }
    }

    #[test]
    fn errors_name_key_and_range() {
        assert_eq!(
            error("seed = -1"),
            "sim.seed is -1, allowed: 0 … 9223372036854775807"
        );
        assert_eq!(
            error("lamp_drift = nan"),
            "sim.lamp_drift is NaN, allowed: 0 … 0.5"
        );
        assert_eq!(
            error("place = { tilt_deg = 61.0 }"),
            "sim.place.tilt_deg is 61, allowed: 0 … 60"
        );
        assert!(error("place.lean_deg = 1.0").contains("`lean_deg`"));
        assert_eq!(
            error("boot_ms = 1e9"),
            "sim.boot_ms is 1000000000, allowed: 0 … 10000"
        );
        assert!(
            error("shot_nose = 1").contains("`shot_nose`"),
            "{}",
            error("shot_nose = 1")
        );
        assert!(
            error("seed = \"one\"").contains("seed"),
            "{}",
            error("seed = \"one\"")
        );
        assert!(
            error("clock = \"sun\"").contains("`wire`"),
            "{}",
            error("clock = \"sun\"")
        );
    }

    #[test]
    fn arms_do_not_start_where_they_may_not_be() {
        assert!(error("start_light_deg = 44.0").contains("sim.start_light_deg"));
    }
}
