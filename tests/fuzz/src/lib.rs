//! What the fuzz targets share: the command line in a folder of temporary files, and bus frames
//! out of bytes.

pub mod bus;

use host_fit::cli;
use host_fit::input::shipped::STAGE_TOML;
use std::path::{Path, PathBuf};

/// Parameters of the stage of [`STAGE_TOML`].
pub const PARAMS: &[u8] = include_bytes!("../../../runtime/examples/stage.bin");

/// A folder with the files of the commands: `stage.toml`, `params.bin` and what is fuzzed.
pub struct Folder(PathBuf);

impl Folder {
    /// A folder of this process among the temporary files; `run` removes it.
    ///
    /// # Panics
    /// It cannot be made.
    pub fn new() -> Self {
        let folder = std::env::temp_dir().join(std::process::id().to_string());
        std::fs::create_dir_all(&folder).expect("a folder");
        let folder = Self(folder);
        folder.write("stage.toml", STAGE_TOML.as_bytes());
        folder.write("params.bin", PARAMS);
        folder
    }

    /// Where a file of it is.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file of it.
    ///
    /// # Panics
    /// It cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).expect("room for it");
    }

    /// Runs a command; an argument that begins with `@` is a file of the folder. Gives whether it
    /// was done.
    ///
    /// # Panics
    /// The exit status is none that the command line promises, or the command left a file behind
    /// that is neither of the folder's nor the output `keeps`.
    pub fn run(&self, arguments: &[&str], keeps: &str) -> bool {
        let path = |argument: &&str| match argument.strip_prefix('@') {
            Some(name) => self.path(name),
            None => PathBuf::from(argument),
        };
        let mut all = vec![PathBuf::from("host-fit"), PathBuf::from("--quiet")];
        all.extend(arguments.iter().map(path));
        let status = cli::main_of(all);
        assert!([0, 3, 4].contains(&status), "{status} of {arguments:?}");
        let done = status == 0;
        self.holds_nothing_else(keeps, done);
        done
    }

    /// Outputs are written whole or not at all.
    fn holds_nothing_else(&self, keeps: &str, done: bool) {
        for entry in std::fs::read_dir(&self.0).expect("the folder") {
            let name = entry.expect("an entry").file_name();
            let is = |other: &str| Path::new(&name) == Path::new(other);
            assert!(
                ["stage.toml", "params.bin", "log", "bus", "reference"]
                    .into_iter()
                    .any(is)
                    || is(keeps),
                "left behind: {name:?}"
            );
        }
        if !keeps.is_empty() {
            assert_eq!(self.path(keeps).exists(), done, "{keeps}");
        }
    }

    /// Joins `bus` and `reference`. What comes of it is a log that `decode` takes.
    ///
    /// # Panics
    /// It is not.
    pub fn join(&self, options: &[&str]) {
        let files = "join @bus @reference --stage @stage.toml --out @joined.csv";
        let command: Vec<&str> = files.split(' ').chain(options.iter().copied()).collect();
        if self.run(&command, "joined.csv") {
            std::fs::rename(self.path("joined.csv"), self.path("log")).expect("the same folder");
            let decode = "decode @params.bin @log --stage @stage.toml --out @pose.csv";
            let command: Vec<&str> = decode.split(' ').collect();
            assert!(self.run(&command, "pose.csv"), "not decoded");
            self.remove("pose.csv");
        }
    }

    /// Removes an output.
    pub fn remove(&self, name: &str) {
        let _ = std::fs::remove_file(self.path(name));
    }
}

impl Default for Folder {
    fn default() -> Self {
        Self::new()
    }
}
