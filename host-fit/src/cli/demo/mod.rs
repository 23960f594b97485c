//! `host-fit demo`.

mod job;
mod service;

use crate::cli::demo::job::{Demo, TABLE_2, TABLE_4, TABLE_8, table_7};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output;
use crate::problem::parameters::Parameters;
use crate::report::text;
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub(super) struct DemoArgs {
    /// Where to leave logs, stage.toml, both blobs and pose.csv; a temporary folder if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also print the zero deviation of each movement (Table A1).
    #[arg(long)]
    zero_deviations: bool,
}

/// Runs the demo and prints what the paper prints.
pub(super) fn run(args: &DemoArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let temporary;
    let folder = match &args.out {
        Some(folder) => {
            output::make_folder(folder)?;
            folder.as_path()
        }
        None => {
            temporary = tempfile::tempdir().map_err(HostError::NoTemporaryFolder)?;
            temporary.path()
        }
    };
    let demo = job::run(folder)?;
    terminal::print(&as_text(&demo, args.zero_deviations))?;
    let mut end = format!(
        "\nall of this took {:.2} s\n",
        started.elapsed().as_secs_f64()
    );
    if args.out.is_some() {
        for file in &demo.files {
            let _ = writeln!(end, "wrote {}", file.display());
        }
    } else {
        end.push_str("logs, stage.toml, blobs and poses are kept with --out DIR\n");
    }
    terminal::print(&end)
}

fn as_text(demo: &Demo, zero_deviations: bool) -> String {
    let fit = &demo.model_31;
    let mut out = String::from(
        "The paper's stage is not this one, so its figures show what to expect, not what to match: comparable\n\
         are the protocol, the models and the order of improvement; not the parameters of a particular stage.\n\
         Its Tables 4 and 8 come from a population search on 100 and 200 rows, ours from least squares on all.\n\n",
    );
    let mut errors = |title: &str, error, paper| {
        let _ = writeln!(out, "{}", text::errors(title, error, paper));
    };
    errors(
        "Table 2: designed parameters, Model (15), movements at Z = +-250 um",
        &demo.designed,
        Some(TABLE_2),
    );
    errors(
        "Table 4: Model (30) fitted to the same movements",
        &demo.model_30.judgement.errors,
        Some(TABLE_4),
    );
    errors(
        "the same Model (30) over all 19 vertical settings",
        &demo.model_30_everywhere,
        None,
    );
    errors(
        "Table 8: Model (31) fitted to all rows",
        &fit.judgement.errors,
        Some(TABLE_8),
    );
    let _ = writeln!(
        out,
        "Table 7: parameters (lever arms in place of H, which no data can tell apart)\n{}",
        text::parameters(
            fit.model,
            &fit.solution.parameters,
            &Parameters::designed(&demo.stage),
            &fit.standard_error,
            Some(&table_7())
        )
    );
    if zero_deviations {
        out.push_str("Table A1: zero deviations, um\n");
        let _ = writeln!(
            out,
            "  {:>8}{:>10}{:>10}{:>9}{:>9}{:>9}",
            "Z (um)", "Rx (urad)", "Ry (urad)", "A", "B", "C"
        );
        for ([z, rx, ry], zero) in &demo.zero_deviations {
            let [a, b, c] = zero.delta_m.map(|d| d * 1e6);
            // Adding zero turns a rounded -0 into 0.
            let [z, rx, ry] = [z, rx, ry].map(|v| v.round() + 0.0);
            let _ = writeln!(out, "  {z:>8}{rx:>10}{ry:>10}{a:>9.2}{b:>9.2}{c:>9.2}");
        }
        out.push('\n');
    }
    let _ = writeln!(
        out,
        "{}",
        text::errors(
            "The log decoded by the target's f32 decoder from the blob just written",
            &demo.decoded,
            None
        )
    );
    let [x, y, rz] = demo.f32_difference.map(|d| d * 1e9);
    let _ = writeln!(
        out,
        "f32 against f64, largest over all rows: X {x:.3} nm, Y {y:.3} nm, Rz {rz:.3} nrad"
    );
    let _ = writeln!(
        out,
        "log read in {:.0} ms; Model (31) fitted and judged in {:.0} ms, of which the solver {:.1} ms ({} passes, {})",
        demo.reading.as_secs_f64() * 1e3,
        demo.fitting.as_secs_f64() * 1e3,
        fit.solution.elapsed.as_secs_f64() * 1e3,
        fit.solution.evaluations,
        fit.solution.stopped
    );
    for warning in &fit.warnings {
        let _ = writeln!(out, "warning: {warning}");
    }
    let _ = write!(out, "\n{}", demo.service.as_text());
    out
}
