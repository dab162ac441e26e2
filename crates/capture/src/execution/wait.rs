use std::time::Duration;

use rig::Rig;

use super::{Execution, Interrupt};
use crate::{Command, State};

/// Longest time between two looks at a rig that waits, and at what the operator wants.
const LOOK: Duration = Duration::from_millis(200);

impl<R: Rig> Execution<'_, R> {
    /// Does what the operator asked for since the last look; returns when the capture is to go on.
    pub(super) async fn obey(&mut self) -> Result<(), Interrupt<R::Error>> {
        let mut paused = false;
        loop {
            let command = *self.control.borrow_and_update();
            match command {
                Command::Run => break,
                Command::Finish => return Err(Interrupt::Finish),
                Command::Stop => return Err(Interrupt::Stop),
                Command::Estop => return Err(Interrupt::Estop),
                Command::Pause => {}
            }
            if !paused {
                paused = true;
                self.state(State::Paused);
            }
            // The host's clock, since a simulator's runs ahead only when told to wait.
            let _ = tokio::time::timeout(self.look_every(), self.control.changed()).await;
            self.mark = self.look().await?;
        }
        if paused {
            self.stale = true;
            self.state(State::Running);
        }
        Ok(())
    }

    /// Time between two looks at a rig that waits: three per watchdog time, since one may be late.
    pub(super) fn look_every(&self) -> Duration {
        match self.file.motion.watchdog {
            Duration::ZERO => LOOK,
            watchdog => LOOK.min(watchdog / 3),
        }
    }

    /// Looks at every device, so that no watchdog trips, and at the photometer's clock, so that no wrap is missed.
    pub(super) async fn look(&mut self) -> Result<u64, Interrupt<R::Error>> {
        self.drive.snapshot().await?;
        let ticks = self.drive.ticks().await?;
        Ok(self.clock.unwrap(ticks))
    }

    /// Switches the lamp, and waits for steady light.
    pub(super) async fn switch_lamp(&mut self, on: bool) -> Result<(), Interrupt<R::Error>> {
        self.drive.lamp(on).await?;
        self.lamp = on;
        match on {
            true => self.warm_up(self.file.photometer.lamp_warm_up).await,
            false => Ok(()),
        }
    }

    /// Lets time pass, looking after the rig and at what the operator wants.
    pub(super) async fn let_pass(&mut self, mut left: Duration) -> Result<(), Interrupt<R::Error>> {
        while !left.is_zero() {
            self.obey().await?;
            let slice = left.min(self.look_every());
            self.drive.wait(slice).await?;
            left -= slice;
            self.mark = self.look().await?;
        }
        Ok(())
    }

    /// Waits until the lamp, which is on, gives steady light.
    pub(super) async fn warm_up(&mut self, time: Duration) -> Result<(), Interrupt<R::Error>> {
        self.state(State::WarmingUp);
        self.let_pass(time).await?;
        self.mark = self.look().await?;
        self.progress.warm();
        self.state(State::Running);
        Ok(())
    }
}
