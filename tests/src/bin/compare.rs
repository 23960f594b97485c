//! Compares the words of a target with those of the host. See `compare --help`.

use clap::{Parser, Subcommand};
use host_fit::input::log::{self, ReadOptions};
use host_fit::input::shipped;
use host_fit::input::stage::Stage;
use host_fit::output::pose_file;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use runtime::blob::MAX_BYTES;
use runtime::{
    AnyDecoder, Decode, Decoder, OnInvalid, ParameterSet, PlanarPose, Pose, PoseTracker, Reading,
    Status, VerticalPose,
};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tests::compare::{Comparison, compare, to_bytes};
use tests::job::Bare;
use tests::motion::{self, Section};

/// Compares the words that a target gives with those of the host, bit for bit.
///
/// `make` writes the frames of a log, random codes and random parameters into a job file, for
/// Model (31) and for the field model, with and without temperatures; an
/// image that does the job on the target answers with a file of words; `check` compares them.
/// `poses` compares a pose file that a controller recorded with the host's decoder.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write a job file.
    Make {
        /// The parameter blob of a fit by Model (31); the field model's is made of it.
        params: PathBuf,
        /// The log; the one that ships with the program if not given.
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
        /// Ticks with random parameters, with either model; 0 leaves out the predicted poses, too.
        #[arg(long, default_value_t = 32_000)]
        parameters: usize,
        /// Ticks for which what is invalid is held.
        #[arg(long, default_value_t = 3)]
        hold: u16,
        /// Seed of everything random.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Do a job on this machine and compare the target's words.
    Check {
        /// The job file.
        job: PathBuf,
        /// The target's words.
        words: PathBuf,
    },
    /// Compare recorded poses with the host's decoder.
    Poses {
        /// The parameter blob that the controller runs.
        params: PathBuf,
        /// The log of the codes.
        log: PathBuf,
        /// The stage that the log belongs to.
        #[arg(long)]
        stage: PathBuf,
        /// The poses that the controller gave for them, in a pose file.
        poses: PathBuf,
        /// Ticks for which the controller holds what is invalid.
        #[arg(long, default_value_t = 0)]
        hold: u16,
    },
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Make {
            params,
            log,
            stage,
            out,
            codes,
            parameters,
            hold,
            seed,
        } => make(
            &params,
            log.as_deref().zip(stage.as_deref()),
            codes,
            parameters,
            hold,
            seed,
        )
        .and_then(|bytes| Ok(std::fs::write(&out, bytes).map(|()| true)?)),
        Command::Check { job, words } => check(&job, &words),
        Command::Poses {
            params,
            log,
            stage,
            poses,
            hold,
        } => check_poses(&params, &log, &stage, &poses, hold),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("compare: {error}");
            ExitCode::from(3)
        }
    }
}

fn read_blob(path: &Path) -> Result<ParameterSet, Box<dyn Error>> {
    let named = |error: &dyn Error| format!("{}: {error}", path.display());
    let bytes = std::fs::read(path).map_err(|error| named(&error))?;
    Ok(ParameterSet::from_bytes(&bytes).map_err(|error| named(&error))?)
}

fn make(
    params: &Path,
    log: Option<(&Path, &Path)>,
    codes: usize,
    parameters: usize,
    hold: u16,
    seed: u64,
) -> Result<Vec<u8>, Box<dyn Error>> {
    let set = read_blob(params)?;
    let dataset = match log {
        Some((log, stage)) => {
            log::read(&[log], &Stage::from_file(stage)?, &ReadOptions::DECODE)?.dataset
        }
        None => {
            let stage = Stage::from_toml(shipped::STAGE_TOML, Path::new("stage.toml"))?;
            let name = Path::new("paper.csv.gz");
            log::read_bytes(shipped::LOG_GZ, name, &stage, &ReadOptions::DECODE)?.dataset
        }
    };
    let rows = dataset.rows.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let field_set = motion::with_field_terms(&mut rng, &set);
    let mut sections = Vec::new();
    for set in [&set, &field_set] {
        let warm = motion::with_temperature(&mut rng, set);
        let mut buffer = [0; MAX_BYTES];
        let blob = warm.to_bytes(&mut buffer)?;
        let frames = motion::uniform_frames(&mut rng, codes / 2);
        sections.push(motion::of_blob(blob, frames, hold));
        let mut buffer = [0; MAX_BYTES];
        let blob = set.to_bytes(&mut buffer)?;
        let logged = motion::of_log(blob, &dataset, hold)
            .ok_or("the log holds a vertical pose in place of capacitive codes")?;
        let mut uniform = |ticks| {
            let frames = motion::uniform_frames(&mut rng, ticks);
            motion::of_blob(blob, frames, hold)
        };
        sections.extend(logged.iter().cloned());
        sections.push(uniform(codes));
        if parameters > 0 {
            sections.extend(logged.into_iter().map(motion::predicted));
            sections.push(motion::predicted(uniform(codes / 8)));
        }
        match warm.decoder() {
            AnyDecoder::Linear(sound) => {
                sections.extend(bare(&mut rng, &sound, parameters, |_| sound));
            }
            AnyDecoder::Field(sound) => {
                let [a, b, c] = *sound.probes();
                let other = |rng: &mut ChaCha8Rng| {
                    let probes = [a, b, c]
                        .map(|probe| motion::field_probe(rng, &probe.sensitivity, probe.lateral));
                    Decoder::new(*sound.constants(), probes)
                };
                sections.extend(bare(&mut rng, &sound, parameters, other));
            }
        }
    }
    let ticks: usize = sections.iter().map(|s: &Section| s.frames.len()).sum();
    println!("RESULT job_ticks={ticks}");
    println!("RESULT job_log_rows={rows}");
    Ok(to_bytes(&sections))
}

/// Ticks with random parameters: sets of odd words, and any codes.
fn bare<M: Bare>(
    rng: &mut ChaCha8Rng,
    sound: &Decoder<M>,
    ticks: usize,
    mut other: impl FnMut(&mut ChaCha8Rng) -> Decoder<M>,
) -> Vec<Section> {
    /// Frames that share one set of random parameters.
    const FRAMES_PER_SET: usize = 32;
    let mut sections = Vec::new();
    for k in 0..ticks / FRAMES_PER_SET {
        let decoder = other(rng);
        let decoder = if k % 2 == 0 {
            motion::odd(rng, &decoder)
        } else {
            decoder
        };
        let frames = motion::uniform_frames(rng, FRAMES_PER_SET);
        sections.push(motion::of_words(&decoder, frames));
    }
    if ticks > 0 {
        let wild = motion::wild_frames(rng, ticks / 8);
        sections.push(motion::of_words(sound, wild));
    }
    sections
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

fn check_poses(
    params: &Path,
    log: &Path,
    stage: &Path,
    poses: &Path,
    hold: u16,
) -> Result<bool, Box<dyn Error>> {
    let set: ParameterSet = read_blob(params)?;
    let stage = Stage::from_file(stage)?;
    let dataset = log::read(&[log], &stage, &ReadOptions::DECODE)?.dataset;
    let on_invalid = match hold {
        0 => OnInvalid::Zero,
        ticks => OnInvalid::Hold { ticks },
    };
    let decoder = set.decoder();
    let mut tracker = PoseTracker::new(decoder, on_invalid);
    let mut host = Vec::with_capacity(dataset.rows.len());
    for movement in &dataset.movements {
        tracker.forget();
        for row in &dataset.rows[movement.rows.clone()] {
            let frame = &row.frame;
            let reading = tracker.tick_with(frame.sequence(), |zero| frame.decode(&decoder, zero));
            host.push((movement.index, row.t_us, reading));
        }
    }
    let target = read_poses(poses)?;
    if host.len() != target.len() {
        let (rows, lines) = (host.len(), target.len());
        return Err(format!("the log has {rows} rows and the pose file {lines}").into());
    }
    let mut differing = 0;
    for (row, (host, target)) in host.iter().zip(&target).enumerate() {
        let (movement, t_us, reading) = host;
        let words = [reading, target].map(tests::job::answer);
        if words[0] != words[1] {
            differing += 1;
            if differing <= 10 {
                println!(
                    "row {row} (movement {}, {} us): {:08x?} on the host, {:08x?} recorded; codes {:?}",
                    movement, t_us, words[0], words[1], dataset.rows[row].frame,
                );
            }
        }
    }
    println!("RESULT rows={}", host.len());
    println!("RESULT differing_rows={differing}");
    Ok(differing == 0 && !host.is_empty())
}

/// The readings of a pose file.
fn read_poses(path: &Path) -> Result<Vec<Reading>, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    if lines.next() != Some(pose_file::HEADER) {
        return Err(format!("{} is no pose file", path.display()).into());
    }
    let reading = |line: &str| -> Result<Reading, Box<dyn Error>> {
        let cells: Vec<&str> = line.split(',').collect();
        let [_, _, words @ .., status] = cells.as_slice() else {
            return Err(format!("too few cells: {line}").into());
        };
        let micro: Result<Vec<f64>, _> = words.iter().map(|cell| cell.parse()).collect();
        let words: Vec<f32> = micro?.iter().map(|x| (x * 1e-6) as f32).collect();
        let [x, y, rz, z, rx, ry] = words[..] else {
            return Err(format!("not six words: {line}").into());
        };
        let planar = PlanarPose::from_array([x, y, rz]);
        let vertical = VerticalPose::from_array([z, rx, ry]);
        let pose = Pose { planar, vertical };
        let status = Status::from_bits(status.parse()?);
        Ok(Reading { pose, status })
    };
    lines.map(reading).collect()
}
