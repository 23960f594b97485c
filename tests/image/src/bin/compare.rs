//! Does a job file: reads `job.bin` of the host's current folder, writes `words.bin`.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use image::job::{self, Stop, Transfer};
use image::semihost::{CONSOLE, Fault, File, exit};

struct Files {
    job: File,
    words: File,
}

impl Transfer for Files {
    type Fault = Fault;

    fn read(&mut self, bytes: &mut [u8]) -> Result<bool, Fault> {
        self.job.read(bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        self.words.write(bytes)
    }
}

#[entry]
fn main() -> ! {
    let done = run();
    let text = match done {
        _ if !image::fpu_at_reset() => "the FPU is not set as after reset\n",
        Ok(()) => "every section done\n",
        Err(Stop::Transfer(Fault::Open)) => "cannot open job.bin or words.bin\n",
        Err(Stop::Transfer(Fault::Transfer)) => "reading job.bin or writing words.bin stopped\n",
        Err(Stop::NoJob) => "job.bin is not a job\n",
        Err(Stop::Refused(_)) => "a blob was refused\n",
    };
    if let Ok(console) = File::write_to(CONSOLE) {
        let _ = console.write(text.as_bytes());
    }
    exit(done.is_ok() && image::fpu_at_reset())
}

fn run() -> Result<(), Stop<Fault>> {
    let (job, words) = (File::read_from(c"job.bin")?, File::write_to(c"words.bin")?);
    job::run(&mut Files { job, words })
}
