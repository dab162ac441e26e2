use std::time::Duration;

use firmware_sim::in_process::{InProcessRig, SharedBench};
use rig::dynamixel::register::Register;
use rig::{Device, Drive, RigFile};

use super::Script;
use super::carry::{Bench, DEVICES, words};

/// After this every silence, stall, watchdog and boot is over.
const REST: Duration = Duration::from_secs(12);

/// The rig in this process, over tokio's paused clock.
pub(super) struct InProcess(SharedBench);

impl Bench for InProcess {
    type Rig = InProcessRig;

    const HANG: Duration = Duration::from_secs(3600);

    fn new(script: &Script, file: &RigFile) -> Result<(Self, InProcessRig), String> {
        let rig = InProcessRig::new(file).map_err(words)?;
        let bench = rig.bench();
        for fault in &script.fault {
            bench.schedule(*fault);
        }
        Ok((Self(bench), rig))
    }

    async fn rest(&self) {
        tokio::time::sleep(REST).await;
    }

    fn peek(&self, device: Device, register: Register) -> Result<i64, String> {
        let value = self.0.peek(device, register);
        value.map_err(|refusal| format!("{}: {refusal:?}", register.name))
    }

    fn mend(&mut self, rig: Drive<InProcessRig>, _: &RigFile) -> Result<Drive<InProcessRig>, String> {
        self.0.darken();
        for device in DEVICES {
            self.0.reboot(device);
        }
        Ok(rig)
    }
}
