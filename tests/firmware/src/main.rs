//! Runs the stage controller's unmodified image on an emulated STM32F405, with an emulated
//! converter that plays a log over SPI, and compares what it sends over CAN with what the host
//! decodes from the log. Use: `bench FOLDER LIBRARY TICKS`, as `run` beside this package does.

mod adc_model;
mod bench;
mod can_model;
mod image;
mod machine;
mod peripherals;
mod unicorn;

use adc_model::Part;
use bench::{Bench, Comparison, Seen};

fn main() {
    let args: Vec<_> = std::env::args_os().collect();
    let bench = Bench::read(std::path::Path::new(&args[1]), args[2].clone()).unwrap();
    let ticks: u64 = args[3].to_string_lossy().parse().unwrap();
    let mut m = bench.machine(Part::Ads8688, [&bench.blob, &[]]).unwrap();
    let t = std::time::Instant::now();
    let mut c = Comparison::default();
    let mut done = 0;
    while done < ticks {
        m.run_ticks(1000.min(ticks - done)).unwrap();
        done += 1000;
        let s = Seen::since_last(&mut m);
        c.add(&s.axes, &bench.poses, 0);
        if done % 10000 == 0 || done <= 1000 { println!("{done} {c:?} {:?} dmg {} {:?}", s.last_status(), s.damaged, t.elapsed()); }
    }
}
