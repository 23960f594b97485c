//! Logs as laboratories have them, from the command line: read from a pipe, drafted for.

use crate::common::{Bench, log, says, stderr, stdout};

const MARK: &str = "# FILL IN: ";

#[test]
fn a_log_comes_by_standard_input_too() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    bench.good("decode p.bin log.csv --out want.csv");
    let pipe = |log: &[u8], status: i32| {
        let output = bench.piped("decode p.bin - --out pose.csv", log);
        assert_eq!(output.status.code(), Some(status), "{}", stderr(&output));
        stderr(&output)
    };
    pipe(&bench.read("log.csv"), 0);
    assert_eq!(bench.read("pose.csv"), bench.read("want.csv"));
    pipe(host_fit::input::shipped::LOG_GZ, 0);
    let message = pipe(b"movement,t_us,hall_a\n", 3);
    says(&message, "standard input:1");
    let message = pipe(b"", 3);
    says(&message, "standard input: the log is empty");
}

#[test]
fn init_drafts_a_stage_file_that_is_refused_until_it_is_filled_in() {
    let bench = Bench::new();
    let renamed = log()
        .replacen("movement", "Run", 1)
        .replacen("ifm_x_nm", "Laser X [nm]", 1)
        .replacen("hall_b_cnt", "Hall 2", 1)
        .replace('\n', ",21.5\n")
        .replacen("21.5", "temperature", 1);
    bench.write("log.csv", renamed);
    bench.bad("init log.csv", 2, &["stage.toml exists", "--force"]);
    let shown = stdout(&bench.good("init log.csv --out new.toml"));
    says(&shown, "11 columns mapped, left out: temperature");
    let fit = "fit log.csv --stage new.toml --out p.bin";
    bench.bad(fit, 3, &["new.toml", "`: missing; fill in the"]);
    // The examples are of the stage that made the log.
    let text = bench.text("new.toml");
    assert!(text.contains(MARK));
    bench.write(
        "new.toml",
        text.replace(MARK, "")
            .replace("period_s = 0.04 ", "period_s = 0.002 "),
    );
    bench.good(fit);
    let shown = stdout(&bench.good("init log.csv --out -"));
    assert_eq!(shown, text);
    bench.good("init log.csv --force");
    assert_eq!(bench.text("stage.toml"), text);
    bench.bad("init nowhere.csv --out other.toml", 3, &["nowhere.csv"]);
    assert!(!bench.has("other.toml"));
}
