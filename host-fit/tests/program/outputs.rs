//! Outputs: whole or not at all, never in the place of an input, and nothing but them on standard output.

use crate::common::{Bench, log, number, says, stderr, stdout, with_cell};
use host_fit::output::blob_file;

#[test]
fn an_output_that_cannot_be_written_is_refused_and_the_old_one_stays() {
    let bench = Bench::with_log();
    bench.bad("fit log.csv --out no/such/p.bin", 3, &["no/such"]);
    // All outputs are written, or none.
    let both = "fit log.csv --out p.bin --json";
    bench.bad(&format!("{both} no/such/p.json"), 3, &["folder"]);
    bench.bad(&format!("{both} ./p.bin"), 2, &["another output"]);
    assert!(!bench.has("p.bin"));
    bench.write("old.bin", "HALL, old");
    bench.bad("fit nowhere.csv --out old.bin", 3, &["nowhere.csv"]);
    assert_eq!(bench.read("old.bin"), b"HALL, old");
}

#[test]
fn what_the_command_did_not_write_is_replaced_only_by_force() {
    let bench = Bench::with_log();
    bench.write("old.csv", log());
    std::fs::create_dir(bench.path("old.r")).expect("a folder");
    bench.write("old.r/index.html", "<!doctype html>");
    let kept = |command: &str| bench.bad(command, 2, &["old.", "--force"]);
    kept("fit log.csv --out old.csv");
    kept("fit log.csv --out p.bin --json old.csv");
    kept("plan --seconds 5 --out old.csv");
    kept("simulate --protocol service --seed 1 --out old.csv");
    kept("simulate --protocol service --seed 1 --out s.csv --truth old.csv");
    bench.good("fit log.csv --out old.bin --serial A --model 31");
    kept("decode old.bin log.csv --out old.csv");
    kept("fit log.csv --out old.bin --serial B --model 31");
    kept("fit log.csv --out old.bin --model 31");
    for command in [
        "check log.csv",
        "eval old.bin log.csv",
        "inspect old.bin",
        "diff old.bin old.bin",
        "recalibrate old.bin log.csv --what gain --out new.bin",
    ] {
        kept(&format!("{command} --json old.csv"));
        if !command.starts_with("inspect") && !command.starts_with("diff") {
            kept(&format!("{command} --report old.r"));
        }
    }
    kept("fit log.csv --out p.bin --report old.r");
    kept("trend old.bin old.bin --report old.r");
    kept("export old.bin --out old.csv");
    kept("join log.csv sensors.csv --out old.csv");
    assert_eq!(bench.text("old.csv"), log());
    // Its own files, and by force.
    bench.good("fit log.csv --out old.bin --serial A --model 31");
    bench.good("fit log.csv --out old.bin --serial B --model 31 --force");
    for file in ["pose.csv", "pose.csv", "old.csv --force", "old.csv"] {
        bench.good(&format!("decode old.bin log.csv --out {file}"));
    }
    bench.good("simulate --protocol service --seed 1 --out old.csv --force");
    bench.good("plan --seconds 5 --out old.csv --force");
    bench.good("plan --seconds 6 --out old.csv");
}

#[test]
fn no_output_takes_the_place_of_an_input() {
    let bench = Bench::with_log();
    std::fs::create_dir(bench.path("r")).expect("a folder");
    bench.write("r/index.html", log());
    let taken = |command: &str| bench.bad(command, 2, &["name another"]);
    taken("fit r/index.html --out p.bin --report r");
    taken("fit log.csv --out r/index.html --report r");
    taken("fit log.csv --out p.bin --json r/index.html --report r");
    let stage = std::fs::read(bench.path("stage.toml")).expect("there");
    std::fs::write(bench.path("stage.toml"), [&stage[..], b"# mine\n"].concat()).expect("written");
    taken("demo --out .");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("log.csv", bench.path("soft")).expect("linked");
        taken("live soft --can no-such-bus --record log.csv");
        taken("fit log.csv --out soft");
        taken("fit log.csv --out - --json /dev/stdout");
        assert_eq!(bench.text("log.csv"), log());
    }
}

#[cfg(unix)]
#[test]
fn a_file_that_is_standard_input_is_no_output() {
    use std::fs::{File, OpenOptions};
    let bench = Bench::with_log();
    let log_file = || OpenOptions::new().append(true).open(bench.path("log.csv"));
    for (command, output) in [
        ("fit - --out log.csv", None),
        ("check - --json log.csv", None),
        ("decode p.bin - --out -", Some(log_file())),
    ] {
        let mut program = bench.command(command);
        program.stdin(File::open(bench.path("log.csv")).expect("there"));
        if let Some(output) = output {
            program.stdout(output.expect("there"));
        }
        let refused = program.output().expect("runs");
        assert_eq!(refused.status.code(), Some(2), "{command}");
        says(stderr(&refused), "an input of this command");
        assert_eq!(bench.text("log.csv"), log());
    }
}

#[cfg(unix)]
#[test]
fn standard_output_carries_an_output_alone_by_whatever_name() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    bench.good("decode p.bin log.csv --out pose.csv");
    for name in ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"] {
        let decoded = bench.good(&format!("decode p.bin log.csv --out {name}"));
        assert_eq!(stdout(&decoded), bench.text("pose.csv"), "{name}");
        assert!(stderr(&decoded).contains("rows, "), "{name}");
        // The header of an array holds the number of rows.
        let array = format!("decode p.bin log.csv --format npy --out {name}");
        bench.bad(&array, 2, &["--format npy", "name a file"]);
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    for command in [
        "decode p.bin log.csv --out /dev/stdout",
        "decode p.bin log.csv --out -",
        "inspect p.bin",
        "completions bash",
        "--help",
    ] {
        let (mut child, _) = bench.reading(command);
        drop(child.stdout.take());
        let ended = child.wait_with_output().expect("it ends");
        assert_eq!(ended.status.code(), Some(0), "{command:?}");
        assert!(!stderr(&ended).contains("host-fit: "), "{}", stderr(&ended));
    }
}

#[test]
fn text_from_a_file_forges_no_line() {
    let bench = Bench::new();
    let forged = with_cell(&log(), 4, "ifm_x_nm", "1\u{202e}warning: forged");
    bench.write("log.csv", forged);
    let of_log = stderr(&bench.run("fit log.csv --out p.bin"));
    let stage = bench.text("stage.toml") + "\"a\\nwarning: forged\\u001B[2J\" = 1\n";
    bench.write("odd.toml", stage);
    let of_stage = stderr(&bench.run("check log.csv --stage odd.toml"));
    bench.write("log.csv", log());
    bench.good("fit log.csv --out p.bin");
    let mut set = blob_file::read(&bench.path("p.bin")).expect("a blob");
    set.serial = "a\nwarning: forged\u{1b}[2J".try_into().expect("short");
    blob_file::write(&bench.path("q.bin"), &set).expect("written");
    let shown = stdout(&bench.good("inspect q.bin"));
    let compared = stdout(&bench.good("diff q.bin q.bin"));
    for text in [of_log, of_stage, shown, compared] {
        says(&text, "warning: forged");
        assert!(!text.contains(['\u{1b}', '\u{202e}']), "{text}");
        assert!(
            !text.lines().any(|line| line.starts_with("warning: f")),
            "{text}"
        );
    }
}

#[test]
fn errors_of_a_fit_that_cannot_be_are_unknown() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    let mut set = blob_file::read(&bench.path("p.bin")).expect("a blob");
    set.fit.rms = [3e38, -1e-6, 1e-6];
    blob_file::write(&bench.path("p.bin"), &set).expect("written");
    let shown = stdout(&bench.good("inspect p.bin --json p.json"));
    let rz = shown.lines().find(|line| line.starts_with("  Rz "));
    assert!(rz.is_some_and(|line| line.contains(" 1.000 ")), "{shown}");
    let errors = &bench.json("p.json")["fit"]["errors"];
    assert!(errors["x"]["rmse_um"].is_null() && errors["y"]["rmse_um"].is_null());
    let compared = stdout(&bench.good("diff p.bin p.bin"));
    assert!(!compared.contains("inf"), "{compared}");
}

#[test]
fn inspect_and_diff_show_a_motion_correction() {
    let bench = Bench::new();
    for blob in ["warm.bin", "motion.bin"] {
        let examples = concat!(env!("CARGO_MANIFEST_DIR"), "/../runtime/examples");
        std::fs::copy(format!("{examples}/{blob}"), bench.path(blob)).expect("an example");
    }
    let inspected = bench.figures("inspect motion.bin");
    assert_eq!(inspected["layout_version"], 4);
    let motion = &inspected["motion_correction"];
    let is = |value: &serde_json::Value, expected: f64| {
        assert!(
            (number(value) - expected).abs() <= 1e-6 * expected.abs(),
            "{value}"
        );
    };
    is(&motion["acceleration_s2"][2][0], -1.5e-5);
    is(&motion["velocity_s"][2][1], 1.4e-3);
    let without = bench.figures("inspect warm.bin");
    assert!(without["motion_correction"].is_null());
    for blobs in ["warm.bin motion.bin", "motion.bin warm.bin"] {
        let compared = bench.figures(&format!("diff {blobs}"));
        let of_rz = &compared["parameters"]["A_rz_x"];
        assert_eq!(of_rz["unit"], "s2/m");
        let known = if of_rz["a"].is_null() { "b" } else { "a" };
        is(&of_rz[known], -1.5e-5);
        is(&compared["pose_difference"]["axes"]["x"]["peak_um"], 0.0);
    }
}
