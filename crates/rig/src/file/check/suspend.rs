use std::time::Duration;

use toml::Spanned;

use crate::dynamixel::Model;
use crate::file::raw::RawSuspend;
use crate::file::source::{Source, number};
use crate::{Band, RigError, Suspend};

/// `[suspend]`
pub(super) fn suspend(
    source: &Source<'_>,
    raw: &RawSuspend,
    models: [&Model; 2],
) -> Result<Suspend, RigError> {
    let every_s = source.within("suspend.every_s", &raw.every_s, 0.2..=60.0)?;
    let high = |key, value, unit| band(source, key, value, true, unit);
    let low = |key, value, unit| band(source, key, value, false, unit);
    Ok(Suspend {
        every: Duration::from_secs_f64(every_s),
        temperature_c: high("suspend.temperature_c", &raw.temperature_c, 1.0)?,
        supply_v: supply(source, &raw.supply_v, models)?,
        lamp_rel: high("suspend.lamp_percent", &raw.lamp_percent, 0.01)?,
        disk_bytes: low("suspend.disk_mb", &raw.disk_mb, 1e6)?,
        door: raw.door,
    })
}

/// Bounds of both servos' supply: those of their models, or the same for both.
fn supply(
    source: &Source<'_>,
    value: &Spanned<toml::Value>,
    models: [&Model; 2],
) -> Result<[Option<Band>; 2], RigError> {
    const KEY: &str = "suspend.supply_v";
    match value.get_ref() {
        toml::Value::String(word) if word == "model" => Ok(models.map(|model| {
            let [hold, release] = model.supply_bounds_v();
            Some(Band { hold, release })
        })),
        toml::Value::Array(bounds)
            if bounds.len() == 2 && bounds.iter().all(|bound| number(bound).is_some()) =>
        {
            let bounds = [0, 1].map(|i| number(&bounds[i]).unwrap_or(f64::NAN));
            let bounds = Spanned::new(value.span(), bounds);
            Ok([band(source, KEY, &bounds, false, 1.0)?; 2])
        }
        other => Err(source.refuse(
            KEY,
            value,
            other,
            "\"model\", or [hold, release] in V for both servos",
        )),
    }
}

/// Bounds in a unit; a first one of 0 is none at all.
fn band(
    source: &Source<'_>,
    key: &str,
    value: &Spanned<[f64; 2]>,
    high: bool,
    unit: f64,
) -> Result<Option<Band>, RigError> {
    let [hold, release] = *value.get_ref();
    let apart = match high {
        true => 0.0 <= release && release < hold,
        false => 0.0 < hold && hold < release,
    };
    if hold == 0.0 {
        return Ok(None);
    }
    if !(apart && hold.is_finite() && release.is_finite()) {
        let allowed = match high {
            true => "[hold, release] with hold above release, both 0 and more; hold 0: not watched",
            false => "[hold, release] with hold below release, both 0 and more; hold 0: not watched",
        };
        return Err(source.refuse(key, value, format!("[{hold}, {release}]"), allowed));
    }
    Ok(Some(Band {
        hold: hold * unit,
        release: release * unit,
    }))
}
