//! What goes to standard output and standard error, and what does not.

use crate::common::{Bench, log, stderr, stdout};

/// With rows every 40 ms, as the stage file says.
fn bench() -> Bench {
    let bench = Bench::new();
    let stage = bench.text("stage.toml");
    let slow = stage.replace("period_s = 0.002", "period_s = 0.04");
    bench.write("stage.toml", slow);
    bench.write("log.csv", log());
    bench
}

#[test]
fn quiet_shows_errors_only_and_verbose_the_time_of_each_step() {
    let bench = bench();
    let fit = "fit log.csv --out p.bin";
    let output = bench.good(fit);
    assert!(stdout(&output).contains("wrote p.bin"));
    assert!(stderr(&output).contains("note: "));
    // No colour where there is no terminal.
    assert!(!(stdout(&output) + &stderr(&output)).contains('\u{1b}'));
    let quiet = bench.good(&format!("{fit} --quiet"));
    assert_eq!((stdout(&quiet), stderr(&quiet)), Default::default());
    bench.bad("-q inspect absent.bin", 3, &["absent.bin"]);
    bench.bad(&format!("{fit} -q -v"), 2, &["cannot be used with"]);
    let verbose = stderr(&bench.good("check log.csv -v"));
    for step in ["reading: ", "fit and diagnosis: "] {
        assert!(verbose.contains(step), "{verbose}");
    }
}

#[test]
fn a_dash_is_standard_output_for_one_output_and_nothing_else() {
    let bench = bench();
    let fit = "fit log.csv --out";
    bench.good(&format!("{fit} p.bin"));
    let blob = bench.good(&format!("{fit} -"));
    assert_eq!(blob.stdout, bench.read("p.bin"));
    assert!(!bench.has("-") && !bench.has("-.posterior"));
    bench.bad(
        &format!("{fit} - --json -"),
        2,
        &["standard output: also another output"],
    );
    let json = bench.good(&format!("{fit} q.bin --json -"));
    assert!(serde_json::from_slice::<serde_json::Value>(&json.stdout).is_ok());
}

#[test]
fn a_blob_is_read_from_standard_input() {
    let bench = bench();
    bench.good("fit log.csv --out p.bin --serial HS-1");
    let output = bench.piped("inspect -", &bench.read("p.bin"));
    assert!(stdout(&output).contains("HS-1"));
}

#[test]
fn each_command_has_a_manual_page_and_completions() {
    let bench = bench();
    bench.good("man --out man");
    let help = stdout(&bench.good("--help"));
    let names = help
        .lines()
        .filter_map(|line| line.strip_prefix("  "))
        .filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
    let names: Vec<&str> = names
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(names.len() > 10, "{help}");
    let script = stdout(&bench.good("completions bash"));
    for name in names.iter().filter(|name| **name != "help") {
        let page = bench.text(&format!("man/host-fit-{name}.1"));
        assert!(page.contains("SYNOPSIS"), "{name}");
        assert!(
            script.contains(&format!("host__fit__{name}")) || script.contains(name),
            "{name}"
        );
    }
    assert!(bench.has("man/host-fit.1"));
}
