use rig::RigFile;
use serde::Deserialize;

use crate::{Fault, Server, Settings, SimError, WireSettings};

/// What a running simulator is told to do: a line of TOML, as `firmware-sim --orders` reads them from stdin.
///
/// Keys are those of the `[sim]` table that may change while it runs; a table keeps what the line does not name.
/// `fault = { device = "sensor", what = "overload" }` happens at once, or at its `at_s`; `plugged = false` pulls the
/// adapter's plug, `plugged = true` puts it in again, perhaps under another name. `sim.jitter_counts = 2` and
/// `sim.light.static_error_counts = 5` change the mechanics of both arms, or of one. `sim.place.tilt_deg = 20` puts the
/// specimen on a wedge.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Order {
    fault: Option<Fault>,
    wire: toml::Table,
    mishaps: toml::Table,
    plugged: Option<bool>,
    sim: toml::Table,
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
        merge(&mut changed.sim, table("wire", self.wire));
        merge(&mut changed.sim, table("mishaps", self.mishaps));
        merge(&mut changed.sim, self.sim);
        let wire = WireSettings::new(&changed)?;
        let settings = Settings::new(&changed)?;
        let before = Settings::new(rig)?;
        only_what_may_change(&settings, &before)?;
        let mishaps = settings.mishaps;
        let same = changed.sim.get("mishaps") == rig.sim.get("mishaps");
        if !same {
            server.bench(|bench| bench.set_mishaps(mishaps))?;
        }
        if settings.mechanics != before.mechanics {
            server.bench(|bench| bench.set_mechanics(settings.mechanics));
        }
        if settings.place != before.place {
            server.bench(|bench| bench.place(settings.place));
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

/// A table with one table in it.
fn table(name: &str, keys: toml::Table) -> toml::Table {
    toml::Table::from_iter([(name.to_owned(), keys.into())])
}

/// Sets keys, and in tables within only those that are named.
fn merge(into: &mut toml::Table, keys: toml::Table) {
    for (key, value) in keys {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(old)), toml::Value::Table(new)) => merge(old, new),
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}

/// Whether two states of the `[sim]` table differ in what a bench that runs can take on.
fn only_what_may_change(changed: &Settings, before: &Settings) -> Result<(), SimError> {
    let rest = |settings: &Settings| Settings {
        mechanics: before.mechanics,
        mishaps: before.mishaps.clone(),
        place: before.place,
        ..settings.clone()
    };
    if rest(changed) == rest(before) {
        return Ok(());
    }
    Err(SimError::Form {
        why:
            "only the mechanics of the arms can change while the simulator runs, such as sim.jitter_counts, and how the \
              specimen lies (sim.place); everything else holds from power-on, so change the rig file and start it again"
                .to_owned(),
    })
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
    fn the_mechanics_of_one_arm_change_while_it_runs() {
        let text = "[sim]\nimperfections = \"none\"";
        let mut rig = RigFile::parse(text, "rig.toml".as_ref()).unwrap();
        let mut server = Server::start(&rig).unwrap();
        obey("sim.light.gravity_counts = 8", &mut rig, &mut server).unwrap();
        let order = "sim = { light = { sag_deg_per_s = 30 }, sensor = { sag_deg_per_s = 5 } }";
        obey(order, &mut rig, &mut server).unwrap();
        let settings = Settings::new(&rig).unwrap();
        assert_eq!(
            settings.mechanics[0].gravity_counts, 8.0,
            "what is not named stays"
        );
        let before = server.bench(|bench| bench.pose());
        server.bench(|bench| bench.advance_to(bench.now() + std::time::Duration::from_secs(1)));
        let after = server.bench(|bench| bench.pose());
        assert!(
            (after.light.deg() - before.light.deg() + 30.0).abs() < 0.1,
            "{after:?}"
        );
        assert!(
            (after.sensor.deg() - before.sensor.deg() - 5.0).abs() < 0.1,
            "{after:?}"
        );
    }

    #[test]
    fn somebody_puts_the_specimen_on_a_wedge_while_it_runs() {
        let mut rig = RigFile::default();
        let mut server = Server::start(&rig).unwrap();
        obey("sim.place.tilt_deg = 20", &mut rig, &mut server).unwrap();
        obey("sim.place.axis_deg = 90", &mut rig, &mut server).unwrap();
        let place = Settings::new(&rig).unwrap().place;
        let [tilt, axis] = [place.tilt, place.axis].map(f64::to_degrees);
        assert!(
            (tilt - 20.0).abs() < 1e-12 && (axis - 90.0).abs() < 1e-12,
            "{place:?}"
        );
        assert!(obey("sim.place.tilt_deg = 61", &mut rig, &mut server).is_err());
        assert_eq!(Settings::new(&rig).unwrap().place, place);
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
            "sim.jitter_counts = -1",
            "sim.jitter_counts = nan",
            "sim.light.ring = { counts = 20 }",
            "sim.seed = 7",
            "sim.place.tilt_deg = 70",
            "fault = { device = 'light', what = { mechanics = { stiction_counts = 101 } } }",
            "fault = { device = 'light', what = { turn_deg = 181 } }",
        ] {
            assert!(obey(line, &mut rig, &mut server).is_err(), "{line}");
        }
        assert_eq!((rig, faults(&server)), before);
    }
}
