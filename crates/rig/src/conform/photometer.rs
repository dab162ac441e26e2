use super::Result;
use crate::doctor::Finding;
use crate::{Counts, Drive, Dynamixel, Exposure, Gain, PhotometerSettings};

/// Dark readings at each gain.
const READINGS: usize = 16;

/// Noise, of full scale, that leaves nothing to be measured.
const NOISE_MAX: f64 = 0.01;

/// Exposures that are compared, each twice as long as the one before. The shortest still collects some ten thousand
/// electrons, so that over all ladders its noise stays well below what is worth a correction.
const DOUBLINGS: u32 = 4;

/// Deviation from proportion to time that is worth a correction, and one that no correction mends.
const BENT: f64 = 0.01;
const BROKEN: f64 = 0.1;

/// Share of full scale that the longest exposure fills where there is light enough: what is bent shows there.
const FULL: f64 = 0.8;

/// Standard deviation of dark readings at each gain.
pub(super) async fn noise(drive: &mut Drive<Dynamixel>) -> Result<Vec<Finding>> {
    let settings = drive.file().photometer.clone();
    let integration_us = 1000.clamp(settings.integration_min_us, settings.integration_max_us);
    drive.lamp(false).await?;
    let mut findings = Vec::new();
    for (gain, check) in Gain::ALL.into_iter().zip(["dark ×1", "dark ×16", "dark ×256"]) {
        let mut red = Vec::with_capacity(READINGS);
        for _ in 0..READINGS {
            let counts = drive.expose(Exposure { integration_us, gain }).await?;
            red.push(f64::from(counts.rgb[0]));
        }
        let mean = red.iter().sum::<f64>() / READINGS as f64;
        let variance = red.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (READINGS - 1) as f64;
        let text = format!(
            "{mean:.1} ± {:.2} counts in {integration_us} µs, red",
            variance.sqrt()
        );
        let limit = NOISE_MAX * f64::from(settings.full_scale);
        findings.push(if variance.sqrt() > limit {
            Finding::fail(
                check,
                text,
                "more than a hundredth of full scale: light, hum, or a broken amplifier",
            )
        } else {
            Finding::ok(check, text)
        });
    }
    Ok(findings)
}

/// Share of full scale below which a photometer that is bent seems straight, and noise seems to be bent.
const DIM: f64 = 0.4;

/// Times that the exposures are gone through: the lamp wobbles by some thousandths, and takes seconds for it.
const LADDERS: u32 = 32;

/// Name of the check.
const LINEARITY: &str = "linearity";

/// Whether the counts of every channel grow in proportion to the integration time; the lamp is on.
pub(super) async fn linearity(drive: &mut Drive<Dynamixel>) -> Result<Finding> {
    let settings = drive.file().photometer.clone();
    drive.wait(settings.lamp_warm_up).await?;
    let longest = filling(drive, &settings).await?;
    let taken = ladders(drive, longest, settings.integration_min_us).await?;
    Ok(judge(&taken, longest.gain, settings.full_scale))
}

/// Means of exposures from `longest` down, shortest first; none is shorter than `shortest_us`.
async fn ladders(drive: &mut Drive<Dynamixel>, longest: Exposure, shortest_us: u32) -> Result<Vec<Mean>> {
    let mut taken: Vec<Mean> = (0..DOUBLINGS)
        .rev()
        .map(|halving| longest.integration_us >> halving)
        .filter(|&integration_us| integration_us >= shortest_us)
        .map(|integration_us| Mean {
            integration_us,
            counts: [0.0; 4],
        })
        .collect();
    for _ in 0..LADDERS {
        for mean in &mut taken {
            let exposure = Exposure {
                integration_us: mean.integration_us,
                ..longest
            };
            let counts = channels(&drive.expose(exposure).await?);
            for (sum, counts) in mean.counts.iter_mut().zip(counts) {
                *sum += counts / f64::from(LADDERS);
            }
        }
    }
    Ok(taken)
}

/// The verdict on exposures, shortest first.
fn judge(taken: &[Mean], gain: Gain, full_scale: u32) -> Finding {
    let [Some(first), Some(last)] = [taken.first(), taken.last()] else {
        return Finding::warn(LINEARITY, "no exposure fits the range", "correct [photometer]");
    };
    let light = brightest(&last.counts);
    let share = light / f64::from(full_scale);
    if share < DIM {
        return Finding::warn(
            LINEARITY,
            format!(
                "not looked at: the longest exposure fills {:.1} % of the range",
                100.0 * share
            ),
            "a brighter specimen or lamp, or a larger photometer.integration_max_us",
        );
    }
    // A faint colour is noisier, and does not reach to where it would bend.
    let telling = |&channel: &usize| channel == MONITOR || last.counts[channel] >= light / 2.0;
    let worst = (0..=MONITOR)
        .filter(telling)
        .map(|channel| bend(taken, channel))
        .fold(0.0, f64::max);
    let text = format!(
        "over {} … {} µs at gain ×{}, at most {:.2} % off proportion",
        first.integration_us,
        last.integration_us,
        gain.factor(),
        100.0 * worst
    );
    if worst <= BENT {
        Finding::ok(LINEARITY, text)
    } else if worst <= BROKEN {
        Finding::warn(
            LINEARITY,
            text,
            "calibrate the linearity, or use less of the range (photometer.aim)",
        )
    } else {
        Finding::fail(
            LINEARITY,
            text,
            "the lamp flickers, the photometer saturates, or the integration times are not true",
        )
    }
}

/// The exposure that fills the range of the brightest colour: at the weakest gain at which the longest one does, at the
/// strongest where none does.
async fn filling(drive: &mut Drive<Dynamixel>, settings: &PhotometerSettings) -> Result<Exposure> {
    let full = FULL * f64::from(settings.full_scale);
    let mut exposure = Exposure {
        integration_us: settings.integration_max_us,
        gain: Gain::X1,
    };
    let mut counts = brightest(&channels(&drive.expose(exposure).await?));
    while counts > full && exposure.integration_us / 2 >= settings.integration_min_us {
        exposure.integration_us /= 2;
        counts = brightest(&channels(&drive.expose(exposure).await?));
    }
    if exposure.integration_us == settings.integration_max_us {
        let fills = |gain: &Gain| counts * gain.factor() >= full;
        exposure.gain = Gain::ALL.into_iter().find(fills).unwrap_or(Gain::X256);
    }
    let share = full / (counts * exposure.gain.factor()).max(1.0);
    // Above half of what was seen to fit, so not saturated.
    exposure.integration_us = (f64::from(exposure.integration_us) * share)
        .min(f64::from(settings.integration_max_us))
        .max(f64::from(settings.integration_min_us)) as u32;
    Ok(exposure)
}

/// What exposures of one length gave on average: red, green, blue, monitor.
struct Mean {
    integration_us: u32,
    counts: [f64; 4],
}

/// Place of the lamp monitor among the channels.
const MONITOR: usize = 3;

/// Counts of the brightest colour.
fn brightest(&[r, g, b, _]: &[f64; 4]) -> f64 {
    r.max(g).max(b)
}

/// Red, green, blue, monitor.
fn channels(counts: &Counts) -> [f64; 4] {
    let [r, g, b] = counts.rgb.map(f64::from);
    [r, g, b, f64::from(counts.monitor)]
}

/// Largest relative deviation of one channel's slope between two exposures from that over all of them. Slopes, so that
/// what is there without light and time does not matter.
fn bend(taken: &[Mean], channel: usize) -> f64 {
    let slope = |a: &Mean, b: &Mean| {
        let time = f64::from(b.integration_us) - f64::from(a.integration_us);
        (b.counts[channel] - a.counts[channel]) / time
    };
    let (Some(first), Some(last)) = (taken.first(), taken.last()) else {
        return 0.0;
    };
    let whole = slope(first, last);
    let deviations = taken
        .windows(2)
        .map(|pair| (slope(&pair[0], &pair[1]) / whole - 1.0).abs());
    deviations.fold(0.0, f64::max)
}
