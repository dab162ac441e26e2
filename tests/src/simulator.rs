use std::path::{Path, PathBuf};

use firmware_sim::Server;
use rig::RigFile;

/// A simulated bus in this process, in wire time, and the rig file that names its terminal.
///
/// The test keeps the simulator's side of the wire: it can cut cables, clear faults and count motions.
pub struct Simulator {
    /// The bus.
    pub server: Server,
    text: String,
}

impl Simulator {
    /// A simulator of the rig that `rig` describes; the text's `[bus] port` stays open for [`Self::rig_file`].
    ///
    /// # Panics
    /// If the text is no rig file, or there is no pseudo-terminal to be had.
    pub fn new(rig: &str) -> Self {
        let file = RigFile::parse(rig, Path::new("rig.toml")).expect("the test's rig file is sound");
        let server = Server::start(&file).expect("the test's [sim] is sound and there are pseudo-terminals");
        Self {
            server,
            text: rig.to_owned(),
        }
    }

    /// Writes the rig file into a directory, with the port of this simulator.
    ///
    /// # Panics
    /// If the directory cannot be written.
    pub fn rig_file(&self, directory: &Path) -> PathBuf {
        let mut rig: toml::Table = self.text.parse().expect("it was parsed before");
        let bus = rig.entry("bus").or_insert_with(|| toml::Table::new().into());
        let port = self.server.path().display().to_string();
        bus.as_table_mut()
            .expect("[bus] is a table")
            .insert("port".into(), port.into());
        let path = directory.join("rig.toml");
        std::fs::write(&path, rig.to_string()).expect("the test's own directory can be written");
        path
    }
}
