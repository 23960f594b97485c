//! The text of logs: in files, or in memory.

use host_fit::input::log::layout::{Column, LogLayout, Quantity};
use host_fit::input::log::table::Table;
use host_fit::input::log::{self, LogError, LogReading, LogRow, ReadOptions};
use host_fit::input::stage::{Stage as Designed, TemperatureTable};
use host_fit::input::text::TextReader;
use std::io;
use std::path::{Path, PathBuf};

/// The columns that the package writes itself, apart from the columns that hold temperatures.
const COLUMNS: [&str; 19] = [
    "", "log", "movement", "time_s", "hall_a", "hall_b", "hall_c", "cap_1", "cap_2", "cap_3",
    "z_m", "rx_rad", "ry_rad", "x_m", "y_m", "rz_rad", "ifm_x_m", "ifm_y1_m", "ifm_y2_m",
];
/// Temperatures of mount and body, degC.
pub const TEMPERATURES: [&str; 2] = ["mount_c", "body_c"];

/// Logs that are read together.
pub enum Logs {
    /// Files.
    Files(Vec<PathBuf>),
    /// Names and texts.
    Texts(Vec<(PathBuf, Vec<u8>)>),
}

/// Where a log can be read again.
pub struct Source {
    pub logs: Logs,
    /// Whether the package names the columns, not the stage.
    pub is_own: bool,
}

impl Source {
    /// Files in the form that the package writes, or in the form that the stage describes.
    pub fn files(paths: Vec<PathBuf>, stage: &Designed) -> Self {
        let is_own = paths.iter().all(|path| {
            // A pipe can be read once.
            path.is_file() && TextReader::open(path).is_ok_and(|text| is_own(text, &stage.log))
        });
        Self {
            logs: Logs::Files(paths),
            is_own,
        }
    }

    /// A text in memory.
    pub fn text(name: &Path, text: Vec<u8>, is_own: bool) -> Self {
        Self {
            logs: Logs::Texts(vec![(name.to_owned(), text)]),
            is_own,
        }
    }

    /// The stage with the columns of these logs.
    pub fn designed(&self, stage: &Designed) -> Designed {
        if !self.is_own {
            return stage.clone();
        }
        let mut log = LogLayout::default();
        for quantity in [Quantity::HALL, Quantity::GAPS].concat() {
            let name = quantity.key().to_owned();
            log.set(quantity, Column { name, scale: 1.0 });
        }
        // These are no quantities of a layout.
        log.ignored = ["", "log"]
            .into_iter()
            .chain(TEMPERATURES)
            .map(str::to_owned)
            .collect();
        Designed {
            log,
            temperature: TemperatureTable {
                columns: TEMPERATURES.map(|name| Some(name.to_owned())),
                scale_mc: [1e3, 0.0],
                ..stage.temperature.clone()
            },
            ..stage.clone()
        }
    }

    /// Reads the logs; `take` gets every row with the number of its log.
    ///
    /// # Errors
    /// See [`LogError`].
    pub fn read(
        &self,
        stage: &Designed,
        options: &ReadOptions,
        take: impl FnMut(usize, &LogRow),
    ) -> Result<LogReading, LogError> {
        match &self.logs {
            Logs::Files(paths) => log::read_each(paths, stage, options, take),
            Logs::Texts(texts) => log::read_each_of_bytes(texts, stage, options, take),
        }
    }

    /// The names and bytes of the logs.
    ///
    /// # Errors
    /// Errors of reading the files.
    pub fn texts(&self) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
        match &self.logs {
            Logs::Files(paths) => {
                let read = |path: &PathBuf| Ok((path.clone(), std::fs::read(path)?));
                paths.iter().map(read).collect()
            }
            Logs::Texts(texts) => Ok(texts.clone()),
        }
    }
}

/// Whether a text has the columns of the package, and the stage names none of them for anything.
pub fn is_own(text: TextReader<'_>, layout: &LogLayout) -> bool {
    let known = [&COLUMNS[..], &TEMPERATURES].concat();
    Table::open(text, |name| known.contains(&name)).is_ok_and(|table| {
        let names = &table.head.names;
        let is_named =
            |of: Quantity| layout.is_mapped(of) && names.contains(&layout.column(of).name);
        names.iter().all(|name| known.contains(&name.as_str()))
            && names.iter().any(|name| name == "time_s")
            && !Quantity::ALL.into_iter().any(is_named)
    })
}
