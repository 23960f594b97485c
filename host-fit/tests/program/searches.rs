//! The population searches through the command line, on the log that ships with the program.

use crate::common::{Bench, interrupt, number, stdout};

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("log.csv.gz", host_fit::input::shipped::LOG_GZ);
    bench
}

#[test]
fn the_papers_experiment_runs_and_ends_far_above_the_floor() {
    let bench = bench();
    let fit = "fit log.csv.gz --out p.bin --json fit.json --solver shtlbo \
               --project none --train 200 --draw plain --seed 3";
    bench.good(fit);
    let json = bench.json("fit.json");
    assert_eq!(json["evaluations"], 20_100);
    assert_eq!(json["train_rows"], 200);
    assert_eq!(
        (&json["solver"], &json["project"]),
        (&"shtlbo".into(), &"none".into())
    );
    let fitness = number(&json["train_fitness"]);
    assert!((3.0..15.0).contains(&fitness), "{fitness}");
    // With its own zero deviations it is worse than with refitted ones.
    let rms = |key: &str| number(&json[key]["y"]["rmse_um"]);
    assert!(rms("errors_solver_delta") > rms("errors"));
}

/// A search that would take hours is good within a second. Ctrl-C comes after two seconds of processor time, however
/// long a busy machine takes to give it these.
#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_best_so_far() {
    let bench = bench();
    let fit = "fit log.csv.gz --out p.bin --solver shtlbo --generations 10000000 --project linear --population 20000 \
               --train 200 --threads 1";
    let mut running = bench
        .command(fit)
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("host-fit starts");
    let id = running.id().to_string();
    let waits = || {
        let asked = std::process::Command::new("ps")
            .args(["-o", "time=", "-p", &id])
            .output();
        let used = stdout(&asked.expect("ps runs"));
        used.trim_end().ends_with("00:00") || used.trim_end().ends_with("00:01")
    };
    while running.try_wait().expect("its state").is_none() && waits() {
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    interrupt(&running);
    assert_eq!(running.wait().expect("host-fit ends").code(), Some(130));
    bench.good("inspect p.bin");
}
