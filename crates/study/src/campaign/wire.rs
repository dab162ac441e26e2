use std::time::Duration;

use firmware_sim::{Server, WireFaults, WireSettings};
use rig::dynamixel::register::Register;
use rig::{Device, Drive, Dynamixel, RigFile};

use super::carry::{Bench, DEVICES, words};
use super::{Script, WireFault};

/// After this every watchdog and boot is over. Not every fault of a script: a run may be resumed in the midst of them.
const REST: Duration = Duration::from_secs(3);

/// The rig behind a pseudo-terminal, in wire time.
pub(super) struct OverWire {
    server: Server,
    /// When the plug is pulled, earliest first.
    unplugged: Vec<Duration>,
}

impl Bench for OverWire {
    type Rig = Dynamixel;

    /// Of the host's time, most of which goes by in waiting for replies that do not come.
    const HANG: Duration = Duration::from_secs(180);

    fn new(script: &Script, file: &RigFile) -> Result<(Self, Dynamixel), String> {
        let server = Server::start(file).map_err(words)?;
        for (at, faults) in timetable(&script.wire, file)? {
            server.schedule(at, faults);
        }
        server.bench(|bench| script.fault.iter().for_each(|fault| bench.schedule(*fault)));
        let unplugs = script.wire.iter().filter(|fault| fault.unplugs);
        let rig = Dynamixel::open(server.path(), file).map_err(words)?;
        let bench = Self {
            server,
            unplugged: unplugs.map(WireFault::at).collect(),
        };
        Ok((bench, rig))
    }

    fn look(&mut self) {
        let now = self.server.bench(|bench| bench.now());
        if self.unplugged.first().is_some_and(|at| *at <= now) {
            self.unplugged.remove(0);
            self.server.unplug();
        }
    }

    async fn rest(&self) {
        self.server.bench(|bench| bench.advance_to(bench.now() + REST));
    }

    fn peek(&self, device: Device, register: Register) -> Result<i64, String> {
        let bytes = self
            .server
            .bench(|bench| bench.device(device).read(register.address, register.size));
        let bytes = bytes.map_err(|refusal| format!("{}: {refusal:?}", register.name))?;
        Ok(bytes
            .iter()
            .rev()
            .fold(0, |value, &byte| value << 8 | i64::from(byte)))
    }

    fn mend(&mut self, rig: Drive<Dynamixel>, file: &RigFile) -> Result<Drive<Dynamixel>, String> {
        // Gives the port up.
        drop(rig);
        self.server.bench(|bench| {
            bench.darken();
            for device in DEVICES {
                bench.device(device).reboot();
            }
        });
        self.server.plug_in().map_err(words)?;
        let rig = Dynamixel::open(self.server.path(), file).map_err(words)?;
        Ok(Drive::new(rig, file.clone()))
    }
}

/// What goes wrong on the wire from when on.
fn timetable(wire: &[WireFault], file: &RigFile) -> Result<Vec<(Duration, WireFaults)>, String> {
    let mut times: Vec<Duration> = wire.iter().flat_map(|fault| [fault.at(), fault.end()]).collect();
    times.sort();
    times.dedup();
    let at = |time: Duration| {
        let active = wire
            .iter()
            .filter(|fault| fault.at() <= time && time < fault.end());
        let keys = active.flat_map(|fault| fault.faults.clone());
        let mut file = file.clone();
        file.sim
            .insert("wire".to_owned(), keys.collect::<toml::Table>().into());
        let settings = WireSettings::new(&file).map_err(words)?;
        Ok((time, settings.faults))
    };
    times.into_iter().map(at).collect()
}
