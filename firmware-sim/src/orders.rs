use rig::RigFile;
use serde::Deserialize;

use crate::{Fault, Server, SimError, WireSettings};

/// What a running simulator is told to do: a line of TOML, as `firmware-sim --orders` reads them from stdin.
///
/// Keys are those of the `[sim]` table that may change while it runs; a table keeps what the line does not name.
/// `fault = { device = "sensor", what = "overload" }` happens at once, or at its `at_s`; `plugged = false` pulls the
/// adapter's plug, `plugged = true` puts it in again, perhaps under another name.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Order {
    fault: Option<Fault>,
    wire: toml::Table,
    mishaps: toml::Table,
    plugged: Option<bool>,
}

impl std::str::FromStr for Order {
    type Err = SimError;

    fn from_str(line: &str) -> Result<Self, SimError> {
        config::parse(line).map_err(|flaws| SimError::Form {
            why: flaws.to_string(),
        })
    }
}

impl Order {
    /// Carries it out; `rig` is what the simulator runs by, and keeps what was changed.
    ///
    /// # Errors
    /// A value that is not allowed, and nothing is changed; no pseudo-terminal to be had.
    pub fn carry_out(self, rig: &mut RigFile, server: &mut Server) -> Result<(), SimError> {
        let mut changed = rig.clone();
        merge(&mut changed.sim, "wire", self.wire);
        merge(&mut changed.sim, "mishaps", self.mishaps);
        let wire = WireSettings::new(&changed)?;
        let mishaps = crate::Settings::new(&changed)?.mishaps;
        let same = changed.sim.get("mishaps") == rig.sim.get("mishaps");
        if !same {
            server.bench(|bench| bench.set_mishaps(mishaps))?;
        }
        server.faults(|faults| *faults = wire.faults);
        *rig = changed;
        if let Some(fault) = self.fault {
            server.bench(|bench| bench.schedule(fault));
        }
        match self.plugged {
            Some(true) => server.plug_in(),
            Some(false) => {
                server.unplug();
                Ok(())
            }
            None => Ok(()),
        }
    }
}

fn merge(sim: &mut toml::Table, name: &str, keys: toml::Table) {
    let table = sim.entry(name).or_insert_with(|| toml::Table::new().into());
    if let Some(table) = table.as_table_mut() {
        table.extend(keys);
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::WireFaults;

    fn obey(line: &str, rig: &mut RigFile, server: &mut Server) -> Result<(), SimError> {
        line.parse::<Order>()?.carry_out(rig, server)
    }

    fn faults(server: &Server) -> WireFaults {
        let mut now = WireFaults::default();
        server.faults(|faults| now = faults.clone());
        now
    }

    #[test]
    fn an_order_changes_what_it_names_and_nothing_else() {
        let mut rig = RigFile::default();
        let mut server = Server::start(&rig).unwrap();
        let before = faults(&server);
        obey("wire.drop_reply = 0.5", &mut rig, &mut server).unwrap();
        obey("wire.noise = 0.25\nmishaps.reboot = 3600", &mut rig, &mut server).unwrap();
        let expected = WireFaults {
            drop_reply: 0.5,
            noise: 0.25,
            ..before
        };
        assert_eq!(faults(&server), expected);
        let restarted = server.bench(|bench| {
            let soon = bench.now() + std::time::Duration::from_secs(60);
            (0..600).any(|_| {
                bench.advance_to(bench.next_event().unwrap_or(soon));
                bench.devices().iter().any(|device| !device.listens())
            })
        });
        assert!(restarted, "one restart a second is due");
    }

    #[test]
    fn a_fault_without_a_time_happens_at_once() {
        let mut rig = RigFile::default();
        let mut server = Server::start(&rig).unwrap();
        let order = "fault = { device = 'sensor', what = { hardware_error = 32 } }";
        obey(order, &mut rig, &mut server).unwrap();
        assert!(server.bench(|bench| bench.device(rig::Device::Sensor).alert()));
        assert!(!server.bench(|bench| bench.device(rig::Device::Light).alert()));
    }

    #[test]
    fn a_pulled_plug_hangs_up_and_comes_back() {
        let mut rig = RigFile::default();
        let mut server = Server::start(&rig).unwrap();
        let open = |server: &Server| std::fs::File::options().write(true).open(server.path());
        let mut client = open(&server).unwrap();
        client.write_all(&[0]).unwrap();
        obey("plugged = false", &mut rig, &mut server).unwrap();
        assert!(client.write_all(&[0]).is_err(), "the line is dead");
        obey("plugged = true", &mut rig, &mut server).unwrap();
        open(&server).unwrap().write_all(&[0]).unwrap();
    }

    #[test]
    fn bad_orders_are_refused_and_change_nothing() {
        let mut rig = RigFile::default();
        let mut server = Server::start(&rig).unwrap();
        let before = (rig.clone(), faults(&server));
        for line in [
            "wire.drop_reply = 2",
            "wire.nonsense = 1",
            "mishaps.reboot = -1",
            "mishaps.reboot = nan",
            "mishaps.flood = 1",
            "fault = { device = 'lamp', what = 'reboot' }",
            "fault = { device = 'sensor', at_s = -1, what = 'reboot' }",
            "fault = { device = 'sensor', what = 'tired' }",
            "unplug",
        ] {
            assert!(obey(line, &mut rig, &mut server).is_err(), "{line}");
        }
        assert_eq!((rig, faults(&server)), before);
    }
}
