use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::fs::{Access, major, minor};

use super::Finding;

/// Latency timer of an FTDI adapter that costs nothing, ms; what it has unless it is set is 16.
const LATENCY_TIMER_MS: u32 = 1;

/// Where pseudo-terminals are: what has one open is its other end.
const PSEUDO_TERMINALS: &str = "/dev/pts";

/// This machine's account of a serial port: who may open it, who has it, and what its adapter is set to. Opens
/// nothing.
#[derive(Clone, Debug)]
pub struct Host {
    root: PathBuf,
}

impl Default for Host {
    fn default() -> Self {
        Self::at("/")
    }
}

impl Host {
    /// A machine whose /proc, /sys and /etc lie below a directory.
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// All that can be said about a port from outside; where one of the findings fails, it cannot be opened.
    pub fn port(&self, path: &Path, latency_ms: f64) -> Vec<Finding> {
        let metadata = match fs::metadata(path) {
            Ok(metadata) => metadata,
            Err(error) => return vec![missing(path, &error)],
        };
        if !metadata.file_type().is_char_device() {
            let text = format!("{} is no serial port", path.display());
            return vec![Finding::fail("port", text, "correct bus.port in the rig file")];
        }
        // A name below /dev/serial/by-id leads to the port proper.
        let real = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let denied = rustix::fs::access(&real, Access::READ_OK | Access::WRITE_OK).is_err();
        let mut findings = vec![
            Finding::ok("port", described(path, &real)),
            self.permission(&real, &metadata, denied),
        ];
        findings.extend(self.holders(&real, &metadata));
        findings.push(self.latency_timer(&real, latency_ms));
        findings
    }

    fn permission(&self, path: &Path, metadata: &fs::Metadata, denied: bool) -> Finding {
        let mode = metadata.mode() & 0o777;
        let group = self.group(metadata.gid());
        let text = format!("mode {mode:03o}, group {group}");
        if !denied {
            return Finding::ok("permission", text);
        }
        let text = format!("{} may not be opened by this user: {text}", path.display());
        let remedy = if mode & 0o060 == 0o060 && metadata.gid() != 0 {
            format!("`sudo usermod -aG {group} $USER`, then log in again")
        } else {
            "udev rule (config/udev/70-goniod.rules): SUBSYSTEM==\"tty\", ATTRS{idVendor}==\"0403\", MODE=\"0660\", \
             GROUP=\"dialout\"; `sudo udevadm control --reload && sudo udevadm trigger`"
                .to_owned()
        };
        Finding::fail("permission", text, remedy)
    }

    /// Name of a group, or its number.
    fn group(&self, id: u32) -> String {
        let groups = fs::read_to_string(self.root.join("etc/group")).unwrap_or_default();
        let named = groups.lines().find_map(|line| {
            let mut fields = line.split(':');
            let (name, number) = (fields.next()?, fields.nth(1)?);
            (number.parse() == Ok(id)).then(|| name.to_owned())
        });
        named.unwrap_or_else(|| id.to_string())
    }

    /// Who has locked the port, and who has it open without a lock.
    fn holders(&self, path: &Path, metadata: &fs::Metadata) -> Vec<Finding> {
        let locking = self.locking(metadata);
        if !locking.is_empty() {
            let text = format!("{} is in use by {}", path.display(), self.named(&locking));
            let remedy = "stop that program (goniod: `systemctl stop goniod`), then ask again";
            return vec![Finding::fail("lock", text, remedy)];
        }
        let free = Finding::ok("lock", "no other program has locked it");
        if path.starts_with(PSEUDO_TERMINALS) {
            return vec![free];
        }
        let open = self.opening(path);
        if open.is_empty() {
            return vec![free];
        }
        let text = format!("{} has it open without a lock", self.named(&open));
        let remedy = "stop it: two programs on one bus damage each other's packets (ModemManager: \
                      ENV{ID_MM_DEVICE_IGNORE}=\"1\" in a udev rule)";
        vec![Finding::warn("lock", text, remedy)]
    }

    /// Processes that hold a lock on a file, from /proc/locks ("1: FLOCK  ADVISORY  WRITE 1234 00:1a:3 0 EOF").
    fn locking(&self, metadata: &fs::Metadata) -> Vec<u32> {
        let locks = fs::read_to_string(self.root.join("proc/locks")).unwrap_or_default();
        let device = metadata.dev();
        let file = format!("{:02x}:{:02x}:{}", major(device), minor(device), metadata.ino());
        let holders = locks.lines().filter_map(|line| {
            let fields: Vec<_> = line.split_whitespace().collect();
            // A process that waits for a lock has an arrow in front, and holds none.
            (fields.get(1) != Some(&"->") && fields.get(5) == Some(&file.as_str()))
                .then(|| fields[4].parse().ok())
                .flatten()
        });
        holders.collect()
    }

    /// Other processes that have a file open, as far as this user may know.
    fn opening(&self, path: &Path) -> Vec<u32> {
        let processes = fs::read_dir(self.root.join("proc"))
            .into_iter()
            .flatten()
            .flatten();
        let ids = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
        let has = |id: &u32| {
            let open = fs::read_dir(self.root.join(format!("proc/{id}/fd")));
            let mut open = open.into_iter().flatten().flatten();
            open.any(|entry| fs::read_link(entry.path()).is_ok_and(|target| target == path))
        };
        ids.filter(|&id| id != std::process::id()).filter(has).collect()
    }

    fn named(&self, processes: &[u32]) -> String {
        let name = |id: &u32| {
            let name = fs::read_to_string(self.root.join(format!("proc/{id}/comm")));
            let name = name.map_or_else(|_| "a program".to_owned(), |name| name.trim().to_owned());
            format!("{name} (process {id})")
        };
        processes.iter().map(name).collect::<Vec<_>>().join(", ")
    }

    fn latency_timer(&self, path: &Path, latency_ms: f64) -> Finding {
        const CHECK: &str = "latency timer";
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let file = format!("/sys/bus/usb-serial/devices/{name}/latency_timer");
        let timer = fs::read_to_string(self.root.join(&file[1..]));
        let Some(timer_ms) = timer.ok().and_then(|text| text.trim().parse::<u32>().ok()) else {
            return Finding::ok(CHECK, "none: this is no FTDI adapter");
        };
        if timer_ms <= LATENCY_TIMER_MS {
            return Finding::ok(CHECK, format!("{timer_ms} ms"));
        }
        let mut text = format!("{timer_ms} ms: every question to a device takes as long");
        if f64::from(timer_ms) > latency_ms {
            text += &format!("; the rig file says latency_ms = {latency_ms}");
        }
        let rule =
            "ACTION==\"add\", SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\"";
        let remedy = format!(
            "now: `echo 1 | sudo tee {file}`; for good, as udev rule (config/udev/70-goniod.rules): {rule}"
        );
        Finding::warn(CHECK, text, remedy)
    }
}

fn missing(path: &Path, error: &std::io::Error) -> Finding {
    let present = crate::ports().unwrap_or_default();
    let names: Vec<_> = present
        .iter()
        .map(|adapter| adapter.path.display().to_string())
        .collect();
    let text = format!("{}: {error}", path.display());
    let remedy = if names.is_empty() {
        "no serial port here: plug the adapter in; `dmesg | tail` says whether the system knows it".to_owned()
    } else {
        format!("present: {}; correct bus.port in the rig file", names.join(", "))
    };
    Finding::fail("port", text, remedy)
}

/// A port with what is known of its adapter.
fn described(path: &Path, real: &Path) -> String {
    let mut text = path.display().to_string();
    if path != real {
        text += &format!(" is {}", real.display());
    }
    let adapters = crate::ports().unwrap_or_default();
    let usb = adapters
        .into_iter()
        .find(|adapter| adapter.path == real)
        .and_then(|adapter| adapter.usb);
    if let Some(usb) = usb {
        let product = usb.product.unwrap_or_default();
        text += &format!(", USB {:04x}:{:04x} {product}", usb.vendor_id, usb.product_id);
    }
    text
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;
    use crate::doctor::Verdict;

    /// A machine with one process that has a port open, and one adapter.
    fn machine() -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        let at = |path: &str| root.path().join(path);
        fs::create_dir_all(at("proc/4711/fd")).unwrap();
        fs::create_dir_all(at("proc/self/fd")).unwrap();
        fs::create_dir_all(at("etc")).unwrap();
        fs::create_dir_all(at("sys/bus/usb-serial/devices/ttyUSB0")).unwrap();
        fs::write(at("proc/4711/comm"), "ModemManager\n").unwrap();
        fs::write(at("etc/group"), "root:x:0:\ndialout:x:20:anna\n").unwrap();
        fs::write(at("sys/bus/usb-serial/devices/ttyUSB0/latency_timer"), "16\n").unwrap();
        symlink("/dev/null", at("proc/4711/fd/3")).unwrap();
        root
    }

    #[test]
    fn a_missing_port_and_a_file_that_is_none_fail() {
        let host = Host::default();
        let missing = host.port(Path::new("/dev/ttyNOWHERE"), 2.0);
        assert_eq!(missing.len(), 1);
        assert_eq!((missing[0].check, missing[0].verdict), ("port", Verdict::Fail));
        let file = tempfile::NamedTempFile::new().unwrap();
        let regular = host.port(file.path(), 2.0);
        assert!(regular[0].text.contains("is no serial port"), "{regular:?}");
    }

    #[test]
    fn who_has_it_open_is_named() {
        let root = machine();
        let host = Host::at(root.path());
        let findings = host.port(Path::new("/dev/null"), 2.0);
        let lock = findings.iter().find(|finding| finding.check == "lock").unwrap();
        assert_eq!(lock.verdict, Verdict::Warn);
        assert!(
            lock.text.starts_with("ModemManager (process 4711) has it open"),
            "{lock:?}"
        );

        let metadata = fs::metadata("/dev/null").unwrap();
        let (device, inode) = (metadata.dev(), metadata.ino());
        let file = format!("{:02x}:{:02x}:{inode}", major(device), minor(device));
        let locks = format!(
            "1: FLOCK  ADVISORY  WRITE 99 00:01:{inode}1 0 EOF\n2: FLOCK  ADVISORY  WRITE 4711 {file} 0 EOF\n\
             2: -> FLOCK  ADVISORY  WRITE 4712 {file} 0 EOF\n"
        );
        fs::write(root.path().join("proc/locks"), locks).unwrap();
        let findings = host.port(Path::new("/dev/null"), 2.0);
        let lock = findings.iter().find(|finding| finding.check == "lock").unwrap();
        assert_eq!(lock.verdict, Verdict::Fail);
        assert_eq!(lock.text, "/dev/null is in use by ModemManager (process 4711)");
    }

    #[test]
    fn a_latency_timer_of_16_ms_comes_with_the_rule_that_mends_it() {
        let root = machine();
        let host = Host::at(root.path());
        let finding = host.latency_timer(Path::new("/dev/ttyUSB0"), 2.0);
        assert_eq!(finding.verdict, Verdict::Warn);
        assert!(
            finding.text.contains("16 ms") && finding.text.contains("latency_ms = 2"),
            "{finding:?}"
        );
        let remedy = finding.remedy.unwrap();
        assert!(remedy.contains("ATTR{latency_timer}=\"1\""), "{remedy}");
        assert!(
            remedy.contains("/sys/bus/usb-serial/devices/ttyUSB0/latency_timer"),
            "{remedy}"
        );
        fs::write(
            root.path()
                .join("sys/bus/usb-serial/devices/ttyUSB0/latency_timer"),
            "1\n",
        )
        .unwrap();
        assert_eq!(host.latency_timer(Path::new("/dev/ttyUSB0"), 2.0).text, "1 ms");
        assert_eq!(
            host.latency_timer(Path::new("/dev/ttyACM0"), 2.0).verdict,
            Verdict::Ok
        );
    }

    #[test]
    fn a_port_that_may_not_be_opened_names_the_group_to_join() {
        let root = machine();
        fs::write(root.path().join("etc/group"), "root:x:0:\nplugdev:x:4242:\n").unwrap();
        let host = Host::at(root.path());
        assert_eq!(
            (host.group(4242), host.group(7)),
            ("plugdev".to_owned(), "7".to_owned())
        );
        let metadata = fs::metadata("/dev/null").unwrap();
        assert_eq!(
            host.permission(Path::new("/dev/null"), &metadata, false).verdict,
            Verdict::Ok
        );
        let denied = host.permission(Path::new("/dev/null"), &metadata, true);
        assert_eq!(denied.verdict, Verdict::Fail);
        assert!(denied.text.contains("group root"), "{denied:?}");
        assert!(
            denied.remedy.unwrap().contains("GROUP=\"dialout\""),
            "no use to join root"
        );
    }
}
