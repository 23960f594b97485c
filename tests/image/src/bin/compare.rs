//! Does a job file: reads `job.bin` of the host's current folder, writes `words.bin`.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use image::job::{
    self, ANSWER_WORDS, BLOB_WORDS, Bare, FRAME_WORDS, HEAD_WORDS, Head, PARAMETER_WORDS,
    PredictingTracker,
};
use image::semihost::{CONSOLE, Fault, File, exit};
use runtime::{Decode, FieldModel, LinearModel, ParameterSet, PoseTracker, Reading};

/// Frames of one transfer.
const BATCH: usize = 512;

/// Why a job is not done to its end.
enum Stop {
    Host(Fault),
    NoJob,
    Refused,
    FpuSettings,
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Self::Host(fault)
    }
}

#[entry]
fn main() -> ! {
    let done = run();
    let text = match done {
        Ok(()) => "every section done\n",
        Err(Stop::Host(Fault::Open)) => "cannot open job.bin or words.bin\n",
        Err(Stop::Host(Fault::Transfer)) => "reading job.bin or writing words.bin stopped\n",
        Err(Stop::NoJob) => "job.bin is not a job\n",
        Err(Stop::Refused) => "a blob was refused\n",
        Err(Stop::FpuSettings) => "the FPU is not set as after reset\n",
    };
    if let Ok(console) = File::write_to(CONSOLE) {
        let _ = console.write(text.as_bytes());
    }
    exit(done.is_ok())
}

fn run() -> Result<(), Stop> {
    if !image::fpu_at_reset() {
        return Err(Stop::FpuSettings);
    }
    let input = File::read_from(c"job.bin")?;
    let output = File::write_to(c"words.bin")?;
    loop {
        let mut head = [[0; 4]; HEAD_WORDS];
        if !input.read(head.as_flattened_mut())? {
            return Ok(());
        }
        let head = Head::from_words(head.map(u32::from_le_bytes));
        match head.source {
            job::WORDS => bare::<LinearModel>(&input, &output, &head)?,
            job::FIELD_WORDS => bare::<FieldModel>(&input, &output, &head)?,
            job::BLOB | job::PREDICTED => {
                let mut bytes = [0; 4 * BLOB_WORDS];
                let length = head.parameter_words().ok_or(Stop::NoJob)? * 4;
                let blob = bytes.get_mut(..length).ok_or(Stop::NoJob)?;
                if !input.read(blob)? {
                    return Err(Stop::NoJob);
                }
                let set = ParameterSet::from_flash(blob).map_err(|_| Stop::Refused)?;
                let decoder = set.decoder();
                let mut tracker = PoseTracker::new(decoder, head.on_invalid());
                let mut predicting = PredictingTracker::new(tracker.clone());
                frames(&input, &output, head.frames, |frame| match head.source {
                    job::PREDICTED => predicting.tick(frame),
                    _ => tracker.tick(frame),
                })?;
            }
            _ => return Err(Stop::NoJob),
        }
    }
}

/// Reads a decoder as bare words and ticks.
fn bare<M: Bare>(input: &File, output: &File, head: &Head) -> Result<(), Stop> {
    let mut words = [[0; 4]; PARAMETER_WORDS];
    let count = head.parameter_words().ok_or(Stop::NoJob)?;
    let taken = words.get_mut(..count).ok_or(Stop::NoJob)?;
    if !input.read(taken.as_flattened_mut())? {
        return Err(Stop::NoJob);
    }
    let (decoder, zero) = job::from_words::<M>(&words.map(u32::from_le_bytes));
    frames(input, output, head.frames, |frame| {
        decoder.decode(frame, &zero)
    })
}

/// Ticks through the frames of one section.
fn frames(
    input: &File,
    output: &File,
    count: u32,
    mut tick: impl FnMut(&runtime::RawFrame) -> Reading,
) -> Result<(), Stop> {
    let mut left = usize::try_from(count).map_err(|_| Stop::NoJob)?;
    let mut taken = [[[0u8; 4]; FRAME_WORDS]; BATCH];
    let mut given = [[[0u8; 4]; ANSWER_WORDS]; BATCH];
    while left > 0 {
        let now = left.min(BATCH);
        left -= now;
        let (Some(taken), Some(given)) = (taken.get_mut(..now), given.get_mut(..now)) else {
            return Err(Stop::NoJob);
        };
        if !input.read(taken.as_flattened_mut().as_flattened_mut())? {
            return Err(Stop::NoJob);
        }
        for (words, answer) in taken.iter().zip(given.iter_mut()) {
            let frame = job::frame(words.map(u32::from_le_bytes));
            *answer = job::answer(&tick(&frame)).map(u32::to_le_bytes);
        }
        output.write(given.as_flattened().as_flattened())?;
    }
    Ok(())
}
