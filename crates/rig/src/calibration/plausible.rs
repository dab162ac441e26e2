//! Whether the values of a certificate can be those of a rig, and how they differ from what was known before.

use std::fmt::Display;
use std::ops::RangeInclusive;

use arms::Pose;

use super::certificate::{Certificate, Colour, Conditions, Patch, Trap, White, Zero, ZeroUncertainty};
use crate::{Gain, RigError, RigFile};

/// By what factor a measured responsivity may differ from the rig file's: beyond it the exposures of a calibration,
/// which are planned by the rig file's, would have been far too dark or at full scale.
const RESPONSIVITY_FACTOR: f64 = 10.0;
/// By what share a gain step may differ from its nominal factor; those of real amplifiers are good to a few percent.
const GAIN_SHARE: f64 = 0.25;
/// Largest share of the counts that may be lost at full scale: beyond 1/4 the shown counts fall again as light grows.
const NONLINEARITY: f64 = 0.25;
/// Largest stray light, as a share of the rig file's responsivity (f·cos in sr⁻¹): a third of what a white reference
/// gives.
const STRAY_PER_SR: f64 = 0.1;
/// Largest offset of an arm's zero that a mirror can show: half of the 2.2° that the light goes to both sides of the
/// mirror direction.
const ZERO_DEG: f64 = 1.1;
/// Largest uncertainty of that offset, degrees.
const U_ZERO_DEG: f64 = 0.5;
/// Relative standard uncertainties: smaller ones nobody has, larger ones are none.
const RELATIVE_U: RangeInclusive<f64> = 1e-6..=0.5;
/// By how much a responsivity may differ from that of the certificate before, and from the rig file's where there is
/// none before, until somebody should look. A lamp and photodiodes that are followed by a monitor are steadier.
const LOOK_RESPONSIVITY: [f64; 2] = [0.05, 0.2];
/// The same for gains, relative, and for the share that is lost at full scale.
const LOOK_GAIN: [f64; 2] = [0.02, 0.05];
const LOOK_NONLINEARITY: [f64; 2] = [0.02, 0.05];
/// The same for the offset of the arms' zeros: so many of its standard uncertainties.
const LOOK_ZERO: f64 = 5.0;

/// Where a value stands in a certificate, and how it is refused.
struct Key<'a>(&'a str);

impl Key<'_> {
    fn refuse<T>(&self, part: impl Display, found: impl Display, allowed: String) -> Result<T, RigError> {
        Err(RigError::Certificate {
            key: format!("{}{part}", self.0),
            found: found.to_string(),
            allowed,
        })
    }

    /// A value within a range; NaN is in none.
    fn within(
        &self,
        part: impl Display,
        value: f64,
        range: RangeInclusive<f64>,
        what: &str,
    ) -> Result<(), RigError> {
        if range.contains(&value) {
            return Ok(());
        }
        let allowed = format!("{:?} … {:?} {what}", range.start(), range.end());
        self.refuse(part, format!("{value:?}"), allowed.trim_end().to_owned())
    }
}

impl Certificate {
    /// Checks that every value is one that a rig of this rig file can have, and that they agree with each other.
    ///
    /// # Errors
    /// [`RigError::Certificate`] for the first value that is not allowed, with its key and what is.
    pub fn check(&self, file: &RigFile) -> Result<(), RigError> {
        for (part, conditions) in self.parts() {
            conditions.check(part)?;
        }
        if let Some(white) = &self.white {
            white.check(file)?;
        }
        if let Some(trap) = &self.trap {
            trap.check(file)?;
        }
        if let Some(zero) = &self.zero {
            zero.check()?;
        }
        for (i, patch) in self.patches.iter().enumerate() {
            patch.check(i)?;
        }
        self.colour
            .as_ref()
            .map_or(Ok(()), |colour| colour.check(&self.patches))
    }

    /// By how much it differs from what was known before, in full sentences, where that is more than a sound rig
    /// changes by: from the certificate before, or from the rig file where there is none. A value that is wrong and
    /// agrees with itself shows in nothing else.
    pub fn differences(&self, before: Option<&Self>, file: &RigFile) -> Vec<String> {
        let mut found = Vec::new();
        if let Some(white) = &self.white {
            match before.and_then(|before| before.white.as_ref()) {
                Some(known) => white.differences(known, "the certificate before", 0, &mut found),
                None => white.differences(&White::nominal(file), "the rig file", 1, &mut found),
            }
        }
        if let Some(zero) = &self.zero {
            let (offset, u, whose) = match before.and_then(|before| before.zero.as_ref()) {
                Some(known) => (known.offset_rad, known.u_rad, "the certificate before"),
                None => (
                    0.0,
                    ZeroUncertainty::of_each_arm(file.uncertainty.zero_rad).half_sum_rad,
                    "the rig file",
                ),
            };
            let off = (zero.offset_rad - offset).abs();
            let step = file.arms[0].axis.resolution_rad();
            if off > LOOK_ZERO * u.hypot(zero.u_rad) + step {
                found.push(format!(
                    "The zeros of the arms are {:.3}° off those of {whose}: an arm may have slipped on its servo.",
                    off.to_degrees()
                ));
            }
        }
        found
    }
}

impl Conditions {
    fn check(&self, part: &str) -> Result<(), RigError> {
        let key = format!("{}.conditions.", key_of(part));
        let key = Key(&key);
        key.within("temperature_c", self.temperature_c, -40.0..=100.0, "°C")
    }
}

/// What a certificate file calls a part that `gonioctl calibrate` calls `part`.
fn key_of(part: &str) -> &str {
    match part {
        "mirror" => "zero",
        part => part,
    }
}

impl White {
    fn check(&self, file: &RigFile) -> Result<(), RigError> {
        let key = Key("white.");
        for c in 0..3 {
            let nominal = file.calibration.responsivity[c];
            let range = nominal / RESPONSIVITY_FACTOR..=nominal * RESPONSIVITY_FACTOR;
            key.within(
                format_args!("responsivity[{c}]"),
                self.responsivity[c],
                range,
                "counts per µs, a tenth to ten times calibration.responsivity of the rig file",
            )?;
            key.within(
                format_args!("u_responsivity[{c}]"),
                self.u_responsivity[c],
                RELATIVE_U,
                "(relative)",
            )?;
        }
        for (i, gain) in Gain::ALL.into_iter().enumerate() {
            let nominal = gain.factor();
            let share = if i == 0 { 0.0 } else { GAIN_SHARE };
            key.within(
                format_args!("gains[{i}]"),
                self.gains[i],
                nominal * (1.0 - share)..=nominal * (1.0 + share),
                "",
            )?;
            let u = if i == 0 { 0.0..=0.0 } else { RELATIVE_U };
            key.within(format_args!("u_gains[{i}]"), self.u_gains[i], u, "(relative)")?;
        }
        key.within(
            "nonlinearity",
            self.nonlinearity,
            -NONLINEARITY..=NONLINEARITY,
            "(share of full scale)",
        )?;
        key.within(
            "u_nonlinearity",
            self.u_nonlinearity,
            1e-9..=NONLINEARITY,
            "(share of full scale)",
        )
    }

    /// Adds how this differs from what was known before; `limit` says which limits hold.
    fn differences(&self, known: &Self, whose: &str, limit: usize, found: &mut Vec<String>) {
        let far =
            |ratio: f64, share: f64| ratio.is_nan() || !(1.0 / (1.0 + share)..=1.0 + share).contains(&ratio);
        for (c, channel) in ["red", "green", "blue"].into_iter().enumerate() {
            let ratio = self.responsivity[c] / known.responsivity[c];
            if far(ratio, LOOK_RESPONSIVITY[limit]) {
                found.push(format!(
                    "The responsivity for {channel} is {ratio:.3} times that of {whose}: absolute values change by as much. \
                     Look at the white reference, the lamp and the optics, and calibrate again with `gonioctl calibrate white`."
                ));
            }
        }
        for (i, step) in ["×1", "×16", "×256"].into_iter().enumerate() {
            let ratio = self.gains[i] / known.gains[i];
            if far(ratio, LOOK_GAIN[limit]) {
                found.push(format!(
                    "The gain step {step} is {ratio:.3} times that of {whose}."
                ));
            }
        }
        let off = self.nonlinearity - known.nonlinearity;
        if off.abs() > LOOK_NONLINEARITY[limit] {
            found.push(format!(
                "The share of the counts that is lost at full scale differs by {:.1} % of full scale from that of {whose}.",
                100.0 * off
            ));
        }
    }
}

impl Trap {
    fn check(&self, file: &RigFile) -> Result<(), RigError> {
        let key = Key("trap.");
        let most = file.calibration.responsivity.map(|r| r * STRAY_PER_SR);
        if self.points.is_empty() {
            return key.refuse("points", "empty", "at least one pose".to_owned());
        }
        for (i, (pose, rates)) in self.points.iter().enumerate() {
            let Pose { light, sensor } = *pose;
            for (name, angle) in [("light", light), ("sensor", sensor)] {
                let part = format!("points[{i}][0].{name}");
                let right = std::f64::consts::FRAC_PI_2;
                key.within(part, angle.rad(), -right..=right, "rad")?;
            }
            for (c, rate) in rates.iter().enumerate() {
                let part = format!("points[{i}][1][{c}]");
                key.within(part, *rate, -most[c]..=most[c], "counts per µs, for stray light")?;
            }
        }
        for (c, u) in self.u.into_iter().enumerate() {
            let least = file.calibration.responsivity[c] * 1e-12;
            key.within(format_args!("u[{c}]"), u, least..=most[c], "counts per µs")?;
        }
        Ok(())
    }
}

impl Zero {
    fn check(&self) -> Result<(), RigError> {
        let key = Key("zero.");
        let [most, most_u] = [ZERO_DEG, U_ZERO_DEG].map(f64::to_radians);
        key.within(
            "offset_rad",
            self.offset_rad,
            -most..=most,
            "rad, what a scan of a mirror can show",
        )?;
        key.within("u_rad", self.u_rad, 1e-7..=most_u, "rad")
    }
}

impl Patch {
    fn check(&self, i: usize) -> Result<(), RigError> {
        let name = format!("patches[{i}].");
        let key = Key(&name);
        for c in 0..3 {
            key.within(
                format_args!("rgb[{c}]"),
                self.rgb[c],
                -0.5..=2.0,
                "(reflectance factor)",
            )?;
            key.within(
                format_args!("sensor[{c}]"),
                self.sensor[c],
                -0.5..=20.0,
                "(reflectance factor)",
            )?;
        }
        Ok(())
    }
}

impl Colour {
    /// Root mean square of what the matrix leaves over of some patches, relative to white; `None` without patches.
    pub(super) fn left_over(&self, patches: &[Patch]) -> Option<f64> {
        let white = patches.iter().flat_map(|patch| patch.rgb).reduce(f64::max)?;
        let off = |patch: &Patch, i: usize| {
            let seen = self.matrix[i].iter().zip(patch.sensor).map(|(m, x)| m * x);
            (seen.sum::<f64>() - patch.rgb[i]).powi(2)
        };
        let squares: f64 = patches
            .iter()
            .map(|patch| (0..3).map(|i| off(patch, i)).sum::<f64>())
            .sum();
        Some((squares / (3 * patches.len()) as f64).sqrt() / white)
    }

    /// The matrix must be one that takes white to about white, and leave over what it says of the patches.
    fn check(&self, patches: &[Patch]) -> Result<(), RigError> {
        let key = Key("colour.");
        for (i, row) in self.matrix.iter().enumerate() {
            for (c, value) in row.iter().enumerate() {
                key.within(format_args!("matrix[{i}][{c}]"), *value, -20.0..=20.0, "")?;
            }
            let sum: f64 = row.iter().sum();
            key.within(format_args!("matrix[{i}], its sum,"), sum, 0.1..=10.0, "")?;
        }
        key.within("residual", self.residual, 0.0..=0.5, "(relative to white)")?;
        if let Some(u) = self.u {
            key.within("u", u, 0.0..=1.0, "(relative to the brightest channel)")?;
        }
        let Some(residual) = self.left_over(patches) else {
            return key.refuse(
                "matrix",
                "there",
                "a matrix only beside the patches that it is made of".to_owned(),
            );
        };
        let off = (residual - self.residual).abs();
        match off <= 1e-3 + 0.1 * self.residual {
            true => Ok(()),
            false => key.refuse(
                "residual",
                format!("{:?}", self.residual),
                format!("{residual:.4}, what the matrix leaves over of the patches"),
            ),
        }
    }
}
