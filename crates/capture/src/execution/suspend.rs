use rig::{Band, Lamp, Rig, Suspend};

use super::{Execution, Interrupt, TICKS_PER_S, now};
use crate::{Event, Record, State};

impl<R: Rig> Execution<'_, R> {
    /// Holds while something is not as `[suspend]` wants it; looks no oftener than that says.
    pub(super) async fn suspend(&mut self) -> Result<(), Interrupt<R::Error>> {
        let every = self.file.suspend.every;
        if !self.judgement_is_due() {
            return Ok(());
        }
        let Some(mut why) = self.unfit(false).await? else {
            return Ok(());
        };
        self.tell_suspended(why.clone()).await?;
        loop {
            self.let_pass(every).await?;
            match self.unfit(true).await? {
                None => break,
                Some(still) if still == why => {}
                Some(other) => {
                    why = other;
                    self.tell_suspended(why.clone()).await?;
                }
            }
        }
        self.append(&Record::Released {
            device_ticks: self.mark,
            at: now(),
        })
        .await?;
        self.stale = true;
        self.state(match self.touched {
            true => State::Running,
            false => State::Identifying,
        });
        Ok(())
    }

    /// Whether arms in flight are to be held, where it is time for a look. [`Self::suspend`] then looks again, and says why.
    pub(super) async fn unfit_now(&mut self) -> Result<bool, Interrupt<R::Error>> {
        if !self.judgement_is_due() {
            return Ok(false);
        }
        let unfit = self.unfit(false).await?.is_some();
        if unfit {
            self.judged = None;
        }
        Ok(unfit)
    }

    /// By the photometer's clock: a simulated one runs ahead of ours.
    fn judgement_is_due(&self) -> bool {
        let ticks = (self.file.suspend.every.as_secs_f64() * TICKS_PER_S) as u64;
        self.judged
            .is_none_or(|judged| self.clock.last() >= judged + ticks)
    }

    async fn tell_suspended(&mut self, why: String) -> Result<(), Interrupt<R::Error>> {
        self.append(&Record::Suspended {
            why: why.clone(),
            device_ticks: self.mark,
            at: now(),
        })
        .await?;
        self.state(State::Suspended);
        self.emit(Event::Suspended { why });
        Ok(())
    }

    /// What keeps the run from going on, in words.
    async fn unfit(&mut self, holding: bool) -> Result<Option<String>, Interrupt<R::Error>> {
        self.judged = Some(self.clock.last());
        let Suspend {
            temperature_c,
            supply_v,
            lamp_rel,
            disk_bytes,
            door,
            ..
        } = self.file.suspend;
        let found = self.drive.surroundings().await?;
        if door && found.door_open {
            return Ok(Some("the door is open".to_owned()));
        }
        let devices = ["light servo", "sensor servo", "photometer"];
        for (device, value) in devices.iter().zip(found.temperature_c) {
            if holds(temperature_c, value, holding) {
                return Ok(Some(format!("the {device} has {value} °C")));
            }
        }
        for ((device, value), bounds) in devices.iter().zip(found.supply_v).zip(supply_v) {
            if holds(bounds, value, holding) {
                return Ok(Some(format!("the supply of the {device} is {value:.1} V")));
            }
        }
        if let Some(room) = self
            .journal
            .room()
            .filter(|&room| holds(disk_bytes, room as f64, holding))
        {
            return Ok(Some(format!("the disk has room for {} MB", room / 1_000_000)));
        }
        if holding && lamp_rel.is_some() {
            self.try_lamp().await?;
        }
        let off = self.lamp_rel.map(|level| (level - 1.0).abs());
        Ok(off
            .filter(|&off| holds(lamp_rel, off, holding))
            .map(|off| format!("the lamp is {:.1} % off", off * 100.0)))
    }

    /// Looks at the lamp by an exposure that counts for nothing.
    async fn try_lamp(&mut self) -> Result<(), Interrupt<R::Error>> {
        if let (true, Some(exposure)) = (self.lamp, self.lamp_exposure) {
            let counts = self.drive.expose(exposure).await?;
            self.note_lamp(&counts);
        }
        Ok(())
    }

    /// Looks at what a lit reading says of the lamp, where it has a monitor.
    pub(super) fn heed_lamp(&mut self, counts: &rig::Counts) -> Result<(), Interrupt<R::Error>> {
        if self.lamp_is_out(counts) {
            return Err(Interrupt::Lamp);
        }
        self.drive.is_sound();
        if self.file.visits.lamp == Lamp::Monitor {
            self.note_lamp(counts);
        }
        Ok(())
    }

    /// Remembers how bright the lamp was.
    fn note_lamp(&mut self, counts: &rig::Counts) {
        let nominal = self.file.calibration.monitor * f64::from(counts.exposure.integration_us);
        let level = f64::from(counts.monitor) / nominal;
        if holds(self.file.suspend.lamp_rel, (level - 1.0).abs(), false) {
            // Not only when it is time for the next look.
            self.judged = None;
        }
        self.lamp_rel = Some(level);
        self.lamp_exposure = Some(counts.exposure);
    }
}

fn holds(band: Option<Band>, value: f64, holding: bool) -> bool {
    band.is_some_and(|band| band.holds(value, holding))
}
