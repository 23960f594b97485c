//! Compares the words of a target with the host's. See `compare --help`.

use clap::{Args, Parser, Subcommand};
use host_fit::input::log::{self, ReadOptions};
use host_fit::input::shipped;
use host_fit::input::stage::Stage;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tests::compare::{Comparison, compare, to_bytes};
use tests::motion::{self, Section};

/// Compares the words of a target with the host's, bit for bit.
///
/// `make` writes the frames of a log and random codes into a job file, for Model (31) and for the
/// field model, with and without temperatures; an image that does the job on the target answers with a file of words; `check` compares them.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write a job file.
    Make(Make),
    /// Do a job on this machine and compare the target's words.
    Check {
        /// The job file.
        job: PathBuf,
        /// The target's words.
        words: PathBuf,
    },
}

#[derive(Args)]
struct Make {
    /// The parameter blob of a fit by Model (31); those of the field model are the runtime's examples.
    params: PathBuf,
    /// The log; default: the log that ships with the program.
    #[arg(long)]
    log: Option<PathBuf>,
    /// The stage that the log belongs to.
    #[arg(long, requires = "log")]
    stage: Option<PathBuf>,
    /// Where to write the job.
    #[arg(long)]
    out: PathBuf,
    /// Ticks of uniform random codes, with Model (31) and again with the field model.
    #[arg(long, default_value_t = 100_000)]
    codes: usize,
    /// Leave out the predicted poses.
    #[arg(long)]
    unpredicted: bool,
}

/// Examples of the field model: each of its terms is there; temperatures and a motion correction in the second.
const FIELD_MODEL: &[u8] = include_bytes!("../../../runtime/examples/field.bin");
const MOTION: &[u8] = include_bytes!("../../../runtime/examples/motion.bin");
/// Longest hold of an invalid value, ticks.
const HOLD: u16 = 3;

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Make(args) => make(&args),
        Command::Check { job, words } => check(&job, &words),
    };
    tests::exit("compare", done)
}

fn read_blob(path: &Path) -> Result<ParameterSet, Box<dyn Error>> {
    let named = |error: &dyn Error| format!("{}: {error}", path.display());
    let bytes = std::fs::read(path).map_err(|error| named(&error))?;
    Ok(ParameterSet::from_bytes(&bytes).map_err(|error| named(&error))?)
}

fn make(args: &Make) -> Result<bool, Box<dyn Error>> {
    let codes = args.codes;
    let set = read_blob(&args.params)?;
    let dataset = match args.log.as_deref().zip(args.stage.as_deref()) {
        Some((log, stage)) => {
            log::read(&[log], &Stage::from_file(stage)?, &ReadOptions::DECODE)?.dataset
        }
        None => {
            let stage = shipped::stage();
            let name = Path::new("paper.csv.gz");
            log::read_bytes(shipped::LOG_GZ, name, &stage, &ReadOptions::DECODE)?.dataset
        }
    };
    let rows = dataset.rows.len();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let field_set = ParameterSet::from_bytes(FIELD_MODEL)?;
    let moving = ParameterSet::from_bytes(MOTION)?;
    let mut sections = Vec::new();
    for set in [&set, &field_set] {
        let mut warm = set.clone();
        warm.constants.temperature = moving.constants.temperature;
        warm.motion_correction = moving.motion_correction;
        let mut buffer = [0; MAX_BYTES];
        let blob = warm.to_bytes(&mut buffer)?;
        let frames = motion::uniform_frames(&mut rng, codes / 2);
        sections.push(motion::blob_section(blob, frames, HOLD));
        let mut buffer = [0; MAX_BYTES];
        let blob = set.to_bytes(&mut buffer)?;
        let logged = motion::log_sections(blob, &dataset, HOLD)
            .ok_or("the log holds a vertical pose in place of capacitive codes")?;
        let uniform = |rng: &mut ChaCha8Rng, ticks| {
            motion::blob_section(blob, motion::uniform_frames(rng, ticks), HOLD)
        };
        sections.extend(logged.iter().cloned());
        sections.push(uniform(&mut rng, codes));
        let wild = motion::wild_frames(&mut rng, codes / 25);
        sections.push(motion::blob_section(blob, wild, HOLD));
        if !args.unpredicted {
            sections.extend(logged.into_iter().map(motion::predicted));
            sections.push(motion::predicted(uniform(&mut rng, codes / 8)));
        }
    }
    let ticks: usize = sections.iter().map(|s: &Section| s.frames.len()).sum();
    println!("RESULT job_ticks={ticks}");
    println!("RESULT job_log_rows={rows}");
    std::fs::write(&args.out, to_bytes(&sections))?;
    Ok(true)
}

fn check(job: &Path, words: &Path) -> Result<bool, Box<dyn Error>> {
    let found = compare(&std::fs::read(job)?, &std::fs::read(words)?)?;
    let Comparison {
        ticks,
        nans,
        good,
        differing,
        first,
    } = &found;
    println!("RESULT ticks={ticks}");
    println!("RESULT good_ticks={good}");
    println!("RESULT words={}", ticks * tests::job::ANSWER_WORDS);
    println!("RESULT differing_words={differing}");
    println!("RESULT nan_words={nans}");
    for difference in first {
        println!("{difference}");
    }
    Ok(*differing == 0 && *nans == 0 && *ticks > 0)
}
