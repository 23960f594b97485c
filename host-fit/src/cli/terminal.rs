//! What goes to the terminal: tables to standard output, notes, warnings and errors to standard error.
//!
//! Where standard output carries an output of the command (`--json -`), tables go to standard error.
//! Text from a file cannot move the cursor or begin a line here: see [`plain`].

use crate::cli::error::HostError;
use crate::report::table::Table;
use crate::report::text::{as_text, plain};
use crate::report::verdict::Summary;
use anstyle::{AnsiColor, Style};
use hallstage_calibration::words;
use hallstage_input::finding::{Finding, Severity};
use std::borrow::Cow;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, AtomicI8, Ordering};
use std::time::Instant;

/// -1 quiet, 0 as usual, 1 and more for details.
static LEVEL: AtomicI8 = AtomicI8::new(0);
/// Whether standard output carries an output.
static TAKEN: AtomicBool = AtomicBool::new(false);

/// From now on less (-1) or more (1) is shown.
pub(super) fn set_level(level: i8) {
    LEVEL.store(level, Ordering::Relaxed);
}

/// From now on standard output is for an output of the command.
pub(super) fn keep_for_output() {
    TAKEN.store(true, Ordering::Relaxed);
}

/// Whether only errors are shown.
pub(super) fn is_quiet() -> bool {
    LEVEL.load(Ordering::Relaxed) < 0
}

/// Writes a table to standard output. A reader that closes the pipe early, as `head` does, is no error.
pub(super) fn print(text: &str) -> Result<(), HostError> {
    marked("", Style::new(), text)
}

/// Writes a summary, its verdict in colour on a terminal.
pub(super) fn verdict(summary: &Summary) -> Result<(), HostError> {
    let color = match summary.mark {
        "good" => AnsiColor::Green,
        "limited" => AnsiColor::Yellow,
        _ => AnsiColor::Red,
    };
    let text = summary.as_text();
    let rest = text.strip_prefix(summary.word).unwrap_or(&text);
    let style = Style::new().bold().fg_color(Some(color.into()));
    marked(summary.word, style, rest)
}

/// Writes a word in a style and a text.
fn marked(word: &str, style: Style, text: &str) -> Result<(), HostError> {
    if is_quiet() {
        return Ok(());
    }
    let text = for_locale(plain(text, "\n"));
    let text = format!("{style}{word}{style:#}{text}");
    if TAKEN.load(Ordering::Relaxed) {
        let _ = anstream::stderr().write_all(text.as_bytes());
        return Ok(());
    }
    let mut out = anstream::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(HostError::input(format!(
            "cannot write to standard output: {error}"
        ))),
        _ => Ok(()),
    }
}

/// Text without µ, ° and ±, where the locale is not UTF-8.
fn for_locale(text: Cow<'_, str>) -> Cow<'_, str> {
    let names = ["LC_ALL", "LC_CTYPE", "LANG"];
    let mut locales = names.into_iter().filter_map(std::env::var_os);
    let locale = locales
        .find(|locale| !locale.is_empty())
        .unwrap_or_default();
    let locale = locale.to_string_lossy().to_lowercase();
    match locale.contains("utf-8") || locale.contains("utf8") {
        true => text,
        false => Cow::Owned(
            text.replace('µ', "u")
                .replace('°', "deg")
                .replace('±', "+-"),
        ),
    }
}

/// Whether an error says no more than that the reader of an output on standard output has closed it.
pub(super) fn is_closed(error: &HostError) -> bool {
    TAKEN.load(Ordering::Relaxed) && error.is_closed_pipe()
}

/// Writes tables that only `--verbose` shows.
pub(super) fn details(tables: &[Table]) -> Result<(), HostError> {
    match LEVEL.load(Ordering::Relaxed) > 0 {
        true => print(&(as_text(tables) + "\n")),
        false => Ok(()),
    }
}

/// Does a step; `--verbose` shows how long it took.
pub(super) fn timed<T>(step: &str, work: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let done = work();
    if LEVEL.load(Ordering::Relaxed) > 0 {
        let text = format!("{:.3} s", started.elapsed().as_secs_f64());
        line(step, AnsiColor::Cyan, text);
    }
    done
}

/// Writes warnings.
pub(super) fn warn(warnings: &[String]) {
    for warning in warnings.iter().filter(|_| !is_quiet()) {
        line("warning", AnsiColor::Yellow, warning);
    }
}

/// Writes findings; not refusals: the error that ends the command names them.
pub(super) fn show(findings: &[Finding]) {
    for finding in findings.iter().filter(|_| !is_quiet()) {
        match finding.severity {
            Severity::Note => line("note", AnsiColor::Cyan, words::message(finding)),
            Severity::Warn => line("warning", AnsiColor::Yellow, words::message(finding)),
            Severity::Refuse => {}
        }
    }
}

/// Writes the error that ends the command.
pub(super) fn fail(error: &HostError) {
    line("host-fit", AnsiColor::Red, error);
}

/// Writes a line to standard error, its start in colour on a terminal. A closed standard error is no
/// reason to fail.
fn line(start: &str, color: AnsiColor, text: impl Display) {
    let style = Style::new().bold().fg_color(Some(color.into()));
    let text = text.to_string();
    let text = for_locale(plain(&text, ""));
    let _ = writeln!(anstream::stderr(), "{style}{start}:{style:#} {text}");
}
