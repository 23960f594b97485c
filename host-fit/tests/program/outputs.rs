//! Outputs: whole or not at all, never in the place of an input, and nothing but them on standard output.

use crate::common::{Bench, log, says, stderr, stdout, with_cell};
use host_fit::output::blob_file;

#[test]
fn an_output_that_cannot_be_written_is_refused_and_the_old_one_stays() {
    let bench = Bench::with_log();
    bench.bad("fit log.csv --out no/such/p.bin", 3, &["no/such"]);
    // All outputs are written, or none.
    bench.write("file", "");
    for output in ["--json no/such/p.json", "--report file"] {
        let arguments = format!("fit log.csv --out p.bin {output}");
        bench.bad(&arguments, 3, &["folder"]);
        assert!(!bench.has("p.bin"), "{output}");
    }
    for twice in ["--json ./p.bin", "--report ./p.bin"] {
        let twice = format!("fit log.csv --out p.bin {twice}");
        bench.bad(&twice, 2, &["another output"]);
    }
    std::fs::create_dir(bench.path("p.bin")).expect("a folder");
    bench.bad("fit log.csv --out p.bin", 3, &["p.bin"]);
    bench.write("old.bin", "old");
    bench.bad("fit nowhere.csv --out old.bin", 3, &["nowhere.csv"]);
    assert_eq!(bench.read("old.bin"), b"old");
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
}

#[cfg(target_os = "linux")]
#[test]
fn an_output_that_cannot_be_written_leaves_the_others_as_they_were() {
    let bench = Bench::with_log();
    bench.write("p.bin", "the blob before");
    let fit = "fit log.csv --model 31 --out p.bin --json /dev/full";
    bench.bad(fit, 3, &["/dev/full", "no room"]);
    assert_eq!(bench.text("p.bin"), "the blob before");
    bench.write("truth.csv", "the truth before");
    let simulate = "simulate --protocol service --seed 3 --out /dev/full --truth truth.csv";
    bench.bad(simulate, 3, &["/dev/full", "no room"]);
    assert_eq!(bench.text("truth.csv"), "the truth before");
    assert!(bench.holds_only(&["log.csv", "p.bin", "truth.csv"]));
}

#[cfg(unix)]
#[test]
fn an_output_that_is_an_input_by_another_name_is_refused() {
    let bench = Bench::with_log();
    std::os::unix::fs::symlink("log.csv", bench.path("soft")).expect("linked");
    for command in [
        "live soft --can no-such-bus --record log.csv",
        "fit log.csv --out soft",
        &format!(
            "fit log.csv --out p.bin --json {}",
            bench.path("p.bin").display()
        ),
        "fit log.csv --out - --json /dev/stdout",
    ] {
        bench.bad(command, 2, &["another"]);
    }
    assert_eq!(bench.text("log.csv"), log());
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
    let rz = shown.lines().find(|line| line.starts_with("  rz "));
    assert!(rz.is_some_and(|line| line.contains(" 1.000 ")), "{shown}");
    let errors = &bench.json("p.json")["fit"]["errors"];
    assert!(errors["x"]["rmse_um"].is_null() && errors["y"]["rmse_um"].is_null());
    let compared = stdout(&bench.good("diff p.bin p.bin"));
    assert!(!compared.contains("inf"), "{compared}");
}
