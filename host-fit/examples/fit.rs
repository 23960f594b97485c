//! From a log to a parameter blob, by the library: reads, fits, prints what was found, writes.
//!
//! ```sh
//! cargo run -p host-fit --example fit -- host-fit/data/run30.csv.gz host-fit/data/stage.toml target/example.bin
//! ```

use host_fit::calibration::diagnose::diagnose_log;
use host_fit::calibration::fit::{FitSettings, ModelChoice, fit};
use host_fit::calibration::words::{message, model_reason};
use host_fit::input::finding::Severity;
use host_fit::input::log::{self, ReadOptions};
use host_fit::input::stage::Stage;
use host_fit::output::blob_file;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [log, stage, blob] = paths.as_slice() else {
        return Err("three arguments are needed: log, stage.toml, and the blob to write".into());
    };
    let stage = Stage::from_file(stage)?;
    let dataset = log::read(&[log], &stage, &ReadOptions::FIT)?.dataset;

    let settings = FitSettings::new(ModelChoice::Auto);
    let fit = fit(&dataset, &stage, &settings)?;
    println!("{}: {}", fit.model.title(), model_reason(&fit));
    for (axis, unit, error) in [("X", "um", 0), ("Y", "um", 1), ("Rz", "urad", 2)]
        .map(|(axis, unit, k)| (axis, unit, fit.judgement.errors.axes[k]))
    {
        let (rms, peak) = (error.rms * 1e6, error.peak * 1e6);
        println!("{axis:<2} {rms:.3} {unit} rms, {peak:.3} {unit} peak");
    }

    // What the fit itself does not refuse may still be wrong: two exchanged channels, for instance.
    let findings = diagnose_log(&dataset, &stage, Ok(&fit)).findings;
    for finding in &findings {
        println!("{:?}: {}", finding.severity, message(finding));
    }
    if findings
        .iter()
        .any(|finding| finding.severity == Severity::Refuse)
    {
        return Err("the log is refused: no blob was written".into());
    }
    blob_file::write(blob, &fit.set)?;
    println!("wrote {}", blob.display());
    Ok(())
}
