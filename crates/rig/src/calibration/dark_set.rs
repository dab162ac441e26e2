use super::lamp::Lamp;
use crate::{Counts, Exposure, Gain, RigFile};

/// Share of full scale from which on a dark reading says nothing: half of the room for light is gone.
const BRIGHT: f64 = 0.5;
/// By how many standard deviations of their noise readings of one exposure may differ, the highest from the lowest: of four,
/// one set in a million does by chance.
const SIGMAS: f64 = 8.0;
/// Share of itself by which the dark level may drift within the readings of one exposure: silicon that warms up by a degree
/// shows 9 to 15 % more.
const DRIFT: f64 = 0.15;
/// What a stronger gain may show more than the weakest one, beside its factor.
const GAIN_MARGIN: f64 = 1.3;
/// Share of its nominal output from which on the lamp is on although it was switched off.
const LAMP_ON: f64 = 0.01;

/// Why the dark readings of a set cannot be believed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DarkFault {
    /// So much light that there is no room left for that of the lamp, or more than the weaker gain saw.
    #[error(
        "the dark readings at gain ×{}, {:.1} ms are at {:.0} % of full scale, up to {:.2} % is possible: light gets in from outside. Close the door, darken the room",
        u16::from(.exposure.gain), ms(*.exposure), 100.0 * .share, 100.0 * .allowed
    )]
    Bright {
        /// Of the readings.
        exposure: Exposure,
        /// Brightest channel, share of full scale.
        share: f64,
        /// Largest share that is believed.
        allowed: f64,
    },
    /// Readings of one exposure differ.
    #[error(
        "the dark readings at gain ×{}, {:.1} ms differ by {} counts, their noise allows {:.0}: light gets in from outside and changes, or flickers. Close the door, darken the room; or [uncertainty] of the rig file promises less noise than the photometer has",
        u16::from(.exposure.gain), ms(*.exposure), .difference, .allowed
    )]
    Unsteady {
        /// Of the readings.
        exposure: Exposure,
        /// Between the highest and the lowest, of the channel with the most, counts.
        difference: u32,
        /// What is believed to be noise, counts.
        allowed: f64,
    },
    /// The monitor sees the lamp.
    #[error("the lamp gives {:.1} % of its nominal output although it was switched off: look at its driver", 100.0 * .level)]
    Lamp {
        /// Its output, relative to nominal.
        level: f64,
    },
}

fn ms(exposure: Exposure) -> f64 {
    exposure.duration().as_secs_f64() * 1e3
}

/// Checks whether the dark readings of one set can be believed: they agree with each other within their noise, leave room
/// for light, and a stronger gain shows no more than a weaker one explains.
///
/// A set whose light is steady is sound: the same light is in the readings with the lamp.
///
/// # Errors
/// The first thing that speaks against them.
pub fn check_dark_set(readings: &[Counts], file: &RigFile) -> Result<(), DarkFault> {
    for group in groups(readings) {
        lamp_is_off(&group, file)?;
        leaves_room(&group, readings, file)?;
        agrees(&group, file)?;
    }
    Ok(())
}

/// Readings of one exposure each.
fn groups(readings: &[Counts]) -> Vec<Vec<Counts>> {
    let mut groups: Vec<Vec<Counts>> = Vec::new();
    for reading in readings {
        match groups
            .iter_mut()
            .find(|group| group[0].exposure == reading.exposure)
        {
            Some(group) => group.push(*reading),
            None => groups.push(vec![*reading]),
        }
    }
    groups
}

fn lamp_is_off(group: &[Counts], file: &RigFile) -> Result<(), DarkFault> {
    if file.visits.lamp == Lamp::Visits {
        return Ok(());
    }
    let nominal = file.calibration.monitor * f64::from(group[0].exposure.integration_us);
    let mean = group.iter().map(|counts| f64::from(counts.monitor)).sum::<f64>() / group.len() as f64;
    let noise = file.uncertainty.variance(mean, 1.0).sqrt();
    match mean > LAMP_ON * nominal + SIGMAS * noise {
        true => Err(DarkFault::Lamp {
            level: mean / nominal,
        }),
        false => Ok(()),
    }
}

/// Whether there is room for light, at the weakest gain, and at the others no more than that explains.
fn leaves_room(group: &[Counts], all: &[Counts], file: &RigFile) -> Result<(), DarkFault> {
    let full = f64::from(file.photometer.full_scale);
    let exposure = group[0].exposure;
    let most = |group: &[Counts]| {
        group
            .iter()
            .flat_map(|counts| counts.rgb)
            .max()
            .unwrap_or_default()
    };
    let share = f64::from(most(group)) / full;
    let weakest: Vec<Counts> = all
        .iter()
        .filter(|counts| {
            counts.exposure.gain == Gain::X1 && counts.exposure.integration_us == exposure.integration_us
        })
        .copied()
        .collect();
    let allowed = match exposure.gain {
        Gain::X1 => BRIGHT,
        _ if weakest.is_empty() => 1.0,
        gain => {
            let at_weakest = f64::from(most(&weakest));
            let noise = |counts: f64, gain: f64| SIGMAS * file.uncertainty.variance(counts, gain).sqrt();
            let counts = GAIN_MARGIN * gain.factor() * (at_weakest + noise(at_weakest, 1.0));
            (counts + noise(counts, gain.factor())) / full
        }
    };
    match share > allowed {
        true => Err(DarkFault::Bright {
            exposure,
            share,
            allowed,
        }),
        false => Ok(()),
    }
}

/// Whether readings of one exposure differ by no more than their noise about a slow drift, as that of a photometer which
/// warms up.
fn agrees(group: &[Counts], file: &RigFile) -> Result<(), DarkFault> {
    let exposure = group[0].exposure;
    for c in 0..3 {
        let counts: Vec<f64> = group.iter().map(|counts| f64::from(counts.rgb[c])).collect();
        let mean = counts.iter().sum::<f64>() / counts.len() as f64;
        let allowed = SIGMAS * file.uncertainty.variance(mean, exposure.gain.factor()).sqrt();
        let difference = range(&counts).min(beside_drift(&counts, DRIFT * mean));
        if difference > allowed {
            return Err(DarkFault::Unsteady {
                exposure,
                difference: difference.round() as u32,
                allowed,
            });
        }
    }
    Ok(())
}

fn range(values: &[f64]) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most - least
}

/// What is left of the range of values that follow each other at even intervals, beside the straight line through them
/// that rises or falls by at most so much over all of them. Of three values a line would hide what it is to show.
fn beside_drift(values: &[f64], most: f64) -> f64 {
    let n = values.len();
    if n < 4 {
        return f64::INFINITY;
    }
    let middle = (n - 1) as f64 / 2.0;
    let at = |i: usize| i as f64 - middle;
    let product: f64 = values.iter().enumerate().map(|(i, value)| at(i) * value).sum();
    let squares: f64 = (0..n).map(|i| at(i).powi(2)).sum();
    let steepest = most / (n - 1) as f64;
    let slope = (product / squares).clamp(-steepest, steepest);
    let left: Vec<f64> = values
        .iter()
        .enumerate()
        .map(|(i, value)| value - slope * at(i))
        .collect();
    range(&left)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONGEST_US: u32 = 100_000;

    /// A set as it is planned: each gain at the shortest and the longest integration, four times, in a dark of 64 counts
    /// and so many more per µs at ×1.
    fn set(per_us: f64) -> Vec<Counts> {
        let mut set = Vec::new();
        for gain in Gain::ALL {
            for integration_us in [100, LONGEST_US] {
                let light = gain.factor() * per_us * f64::from(integration_us);
                let reading = Counts {
                    rgb: [(64.0 + light).min(1_048_575.0) as u32; 3],
                    monitor: 2,
                    exposure: Exposure { integration_us, gain },
                    saturated: false,
                    sequence: 0,
                    ticks: 0,
                    temperature_c: 25,
                };
                set.extend([reading; 4]);
            }
        }
        set
    }

    fn check(set: &[Counts]) -> Result<(), DarkFault> {
        check_dark_set(set, &RigFile::default())
    }

    #[test]
    fn a_steady_light_is_believed_until_it_leaves_no_room() {
        for per_us in [0.0, 2e-5, 1e-3, 0.1, 4.0] {
            assert_eq!(check(&set(per_us)), Ok(()), "{per_us} counts per µs");
        }
        assert!(matches!(check(&set(6.0)), Err(DarkFault::Bright { .. })));
    }

    #[test]
    fn one_reading_or_one_whole_exposure_that_saw_more_is_not_believed() {
        for full in [1_048_575, 700_000, 40_000] {
            for at in 0..24 {
                let mut one = set(2e-5);
                one[at].rgb[1] = full;
                assert!(check(&one).is_err(), "reading {at} at {full}");
                let mut four = set(2e-5);
                let of = at / 4 * 4;
                four[of..of + 4]
                    .iter_mut()
                    .for_each(|counts| counts.rgb[1] = full);
                // The weakest gain alone cannot tell a dark that is there from one that is not.
                let told = check(&four).is_err();
                assert!(told || (of < 8 && full < 524_288), "readings from {of} at {full}");
            }
        }
    }

    #[test]
    fn a_drift_is_believed_and_a_step_an_outlier_or_a_ripple_of_its_size_is_not() {
        let with = |off: [f64; 4]| {
            let mut set = set(0.02);
            for (counts, off) in set[4..8].iter_mut().zip(off) {
                counts.rgb[0] = (f64::from(counts.rgb[0]) * (1.0 + off)) as u32;
            }
            check(&set)
        };
        for drift in [[0.0, 0.03, 0.06, 0.09], [0.09, 0.06, 0.03, 0.0]] {
            assert_eq!(with(drift), Ok(()), "{drift:?}");
        }
        for other in [
            [0.0, 0.0, 0.09, 0.09],
            [0.0, 0.0, 0.0, 0.09],
            [0.09, 0.0, 0.0, 0.0],
            [0.0, 0.09, 0.0, 0.09],
            [0.0, 0.1, 0.2, 0.3],
        ] {
            assert!(with(other).is_err(), "{other:?}");
        }
    }

    #[test]
    fn a_lamp_that_stays_on_is_told() {
        let mut on = set(2e-5);
        on.iter_mut()
            .for_each(|counts| counts.monitor = 5 * counts.exposure.integration_us / 20);
        assert!(matches!(check(&on), Err(DarkFault::Lamp { .. })));
        let visits = RigFile::parse("[calibration]\nlamp = \"visits\"", "test.toml".as_ref()).unwrap();
        assert_eq!(check_dark_set(&on, &visits), Ok(()), "that rig has no monitor");
    }

    #[test]
    fn the_fault_says_what_to_do() {
        let text = check(&set(6.0)).unwrap_err().to_string();
        assert!(
            text.contains("×1, 100.0 ms") && text.contains("darken the room"),
            "{text}"
        );
    }
}
