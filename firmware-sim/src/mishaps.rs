use std::collections::BTreeMap;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::{Disturbance, Fault, RoomLight, SimError};

/// Stream of random numbers for what happens by chance; readings use the streams 0, 1, …
const STREAM: u64 = u64::MAX - 1;
/// Most mishaps of one kind, per hour: one a second.
const RATE_MAX_PER_H: f64 = 3600.0;

/// Lights of a room by chance, f·cos in sr⁻¹, and their flicker: twice the frequency of the mains.
const ROOM_PER_SR: [f64; 5] = [1e-4, 1e-3, 1e-2, 0.1, 1.0];
const ROOM_FLICKER_HZ: [f64; 3] = [0.0, 100.0, 120.0];

/// What happens to devices by chance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mishap {
    /// Silence of less than 400 ms.
    Hiccup,
    /// Silence of 0.4 s to 8 s.
    Silence,
    /// A servo's overload, which takes its torque; a photometer's lamp failure.
    Overload,
    /// Overheating, which takes the torque or the lamp.
    Overheating,
    /// A voltage error: a servo goes on with its Alert bit set, a photometer's lamp goes out.
    Alert,
    /// A shaft is stuck, or an integration does not end, for 10 ms to 6 s.
    Stall,
    /// The photometer refuses a trigger.
    RefusedTrigger,
    /// The photometer carries a write out and does not acknowledge it.
    LostAcknowledgement,
    /// A restart: RAM, torque and turns are lost.
    Reboot,
    /// The bus watchdog trips although somebody spoke.
    WatchdogTrip,
    /// The supply sinks for 0.1 s to 5 s, not so far that a device complains.
    Sag,
    /// So much light gets in for 0.1 s to 3 s that every channel is full.
    Glare,
    /// The light of the room is switched on and stays on for an hour, steady or flickering with the mains: 0.0001 to
    /// 1 sr⁻¹ of f·cos.
    RoomLight,
}

impl Mishap {
    /// All kinds.
    pub const ALL: [Self; 13] = [
        Self::Hiccup,
        Self::Silence,
        Self::Overload,
        Self::Overheating,
        Self::Alert,
        Self::Stall,
        Self::RefusedTrigger,
        Self::LostAcknowledgement,
        Self::Reboot,
        Self::WatchdogTrip,
        Self::Sag,
        Self::Glare,
        Self::RoomLight,
    ];

    /// One of its kind, to happen to some device at a time.
    pub fn draw(self, at: Duration, random: &mut ChaCha8Rng) -> Fault {
        let mut ms = |range: std::ops::Range<u64>| Duration::from_millis(random.random_range(range));
        let what = match self {
            Self::Hiccup => Disturbance::Silence(ms(1..400)),
            Self::Silence => Disturbance::Silence(ms(400..8000)),
            Self::Overload => Disturbance::OVERLOAD,
            Self::Overheating => Disturbance::OVERHEATING,
            Self::Alert => Disturbance::ALERT,
            Self::Stall => Disturbance::Stall(ms(10..6000)),
            Self::RefusedTrigger => Disturbance::RefusedTrigger,
            Self::LostAcknowledgement => Disturbance::LostAcknowledgement,
            Self::Reboot => Disturbance::Reboot,
            Self::WatchdogTrip => Disturbance::WatchdogTrip,
            Self::Sag => Disturbance::Sag(ms(100..5000)),
            Self::Glare => Disturbance::Glare(ms(100..3000)),
            Self::RoomLight => Disturbance::RoomLight(RoomLight {
                per_sr: ROOM_PER_SR[random.random_range(0..ROOM_PER_SR.len())],
                flicker_hz: ROOM_FLICKER_HZ[random.random_range(0..ROOM_FLICKER_HZ.len())],
                duration: Duration::from_secs(3600),
            }),
        };
        let device = match self {
            Self::RefusedTrigger | Self::LostAcknowledgement | Self::Glare | Self::RoomLight => {
                rig::Device::Photometer
            }
            Self::Sag => [rig::Device::Light, rig::Device::Sensor][random.random_range(0..2)],
            _ => {
                [rig::Device::Light, rig::Device::Sensor, rig::Device::Photometer][random.random_range(0..3)]
            }
        };
        Fault { device, at, what }
    }
}

/// The table `[sim.mishaps]`: how often each kind happens, per hour of the rig's time, 0 … 3600.
pub(crate) type Rates = BTreeMap<Mishap, f64>;

/// Mishaps to come: a Poisson process for each kind.
#[derive(Clone, Debug)]
pub(crate) struct Mishaps {
    rates: Rates,
    random: ChaCha8Rng,
    next: Option<(Duration, Mishap)>,
}

impl Mishaps {
    /// From now on, at these rates.
    ///
    /// # Errors
    /// A rate out of its range.
    pub(crate) fn new(rates: Rates, seed: u64, now: Duration) -> Result<Self, SimError> {
        if let Some(found) = rates
            .values()
            .find(|rate| !(0.0..=RATE_MAX_PER_H).contains(*rate))
        {
            return Err(SimError::Value {
                key: "mishaps",
                found: found.to_string(),
                allowed: format!("0 … {RATE_MAX_PER_H} per hour"),
            });
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        let mut mishaps = Self {
            rates,
            random,
            next: None,
        };
        mishaps.look_ahead(now);
        Ok(mishaps)
    }

    /// When the next one happens.
    pub(crate) fn next(&self) -> Option<Duration> {
        self.next.map(|(at, _)| at)
    }

    /// The next one, where it happens by `t`.
    pub(crate) fn pop(&mut self, t: Duration) -> Option<Fault> {
        let (at, kind) = self.next.filter(|&(at, _)| at <= t)?;
        let fault = kind.draw(at, &mut self.random);
        self.look_ahead(at);
        Some(fault)
    }

    fn look_ahead(&mut self, now: Duration) {
        let sum_per_s = self.rates.values().sum::<f64>() / 3600.0;
        let wait_s = -(1.0 - self.random.random::<f64>()).ln() / sum_per_s;
        let mut share = self.random.random::<f64>() * sum_per_s * 3600.0;
        let kind = self.rates.iter().find(|&(_, rate)| {
            share -= rate;
            share < 0.0
        });
        // Infinite without rates.
        let wait = Duration::try_from_secs_f64(wait_s).ok();
        self.next = wait
            .zip(kind)
            .and_then(|(wait, (kind, _))| Some((now.checked_add(wait)?, *kind)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mishaps of an hour.
    fn hour(rates: &[(Mishap, f64)], seed: u64) -> Vec<Fault> {
        let rates = rates.iter().copied().collect();
        let mut mishaps = Mishaps::new(rates, seed, Duration::ZERO).unwrap();
        std::iter::from_fn(|| mishaps.pop(Duration::from_secs(3600))).collect()
    }

    #[test]
    fn each_kind_has_its_rate_and_a_seed_gives_the_same_again() {
        let rates = [
            (Mishap::Reboot, 1000.0),
            (Mishap::Overload, 250.0),
            (Mishap::Sag, 0.0),
        ];
        let faults = hour(&rates, 3);
        assert_eq!(faults, hour(&rates, 3));
        assert_ne!(faults, hour(&rates, 4));
        let of = |what| faults.iter().filter(|fault| fault.what == what).count() as f64;
        // Within five standard deviations of Poisson numbers.
        for (what, rate) in [(Disturbance::Reboot, 1000.0), (Disturbance::OVERLOAD, 250.0)] {
            let found = of(what);
            assert!(
                (found - rate).abs() < 5.0 * f64::sqrt(rate),
                "{what:?}: {found}, not {rate}"
            );
        }
        assert_eq!(
            of(Disturbance::Reboot) + of(Disturbance::OVERLOAD),
            faults.len() as f64
        );
    }

    #[test]
    fn without_rates_nothing_happens() {
        assert_eq!(hour(&[], 1), []);
        assert_eq!(hour(&[(Mishap::Reboot, 0.0)], 1), []);
    }

    #[test]
    fn rates_out_of_range_are_refused() {
        for rate in [-1.0, 3601.0, f64::NAN] {
            let refused = Mishaps::new([(Mishap::Reboot, rate)].into(), 1, Duration::ZERO);
            assert!(refused.unwrap_err().to_string().contains("0 … 3600"), "{rate}");
        }
    }
}
