//! A log as the frames of a sensor node: prints a `candump -L` log, which `canplayer` plays onto a bus.
//! RATE times faster than the log (default 1), the first ROWS rows (default all), one servo period apart.
//!
//! ```sh
//! cargo run -p host-fit --example log_to_candump -- host-fit/data/paper.csv.gz host-fit/data/stage.toml 1 100
//! ```

use hal_adapters::can::sensor::{self, TemperatureSender};
use hal_adapters::can::{BusFrame, Layout};
use hal_adapters::candump::LogLine;
use hallstage_input::log::{LogRows, ReadOptions};
use hallstage_input::stage::Stage;
use std::error::Error;
use std::io::Write;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [log, stage, numbers @ ..] = args.as_slice() else {
        return Err("use: log_to_candump LOG STAGE [RATE [ROWS]]".into());
    };
    let rate: f64 = numbers.first().map_or(Ok(1.0), |text| text.parse())?;
    let most: u32 = numbers.get(1).map_or(Ok(u32::MAX), |text| text.parse())?;

    let stage = Stage::from_file(Path::new(stage))?;
    let (hall, gaps) = (stage.hall.window, stage.capacitive.window);
    let (low, high) = (hall.low.min(gaps.low), hall.high.max(gaps.high));
    // The rails beyond the window are sent too.
    let layout = Layout::from_range(low - 1, high + 1).ok_or("codes of more than 24 bits")?;
    let mut rows = LogRows::open(Path::new(log), "reading", &stage, &ReadOptions::DECODE)?;
    let period_us = rows.period_us() as u32;
    let mut temperatures = TemperatureSender::START;
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for sequence in 0..most {
        let Some(row) = rows.next_row()? else { break };
        let mut frame = row.row.frame.all_codes().ok_or("no capacitive codes")?;
        (frame.sequence, frame.time_us) = (sequence, sequence.wrapping_mul(period_us));
        let at_us = f64::from(sequence) * f64::from(period_us) / rate;
        let temperatures = temperatures.frame(&frame).into_iter();
        for coded in temperatures.chain(sensor::frames(layout, &frame)) {
            let line = LogLine {
                time_us: at_us as u64,
                interface: "vcan0",
                frame: BusFrame::from(coded),
            };
            writeln!(out, "{line}")?;
        }
    }
    Ok(out.flush()?)
}
