//! The messages as the Python package says them: arguments in place of options, functions in place of commands.

/// Commands, and the functions that do the same.
const FUNCTIONS: [(&str, &str); 6] = [
    (
        "host-fit plan --seconds 8",
        "hallstage.plan(stage, seconds=8)",
    ),
    ("host-fit plan", "hallstage.plan"),
    ("host-fit check", "hallstage.check"),
    ("host-fit fit", "hallstage.fit"),
    ("host-fit eval", "Calibration.evaluate"),
    ("host-fit recalibrate", "Calibration.recalibrate"),
];
/// Values of options in messages.
const VALUES: [&str; 11] = [
    "30",
    "all",
    "cauchy",
    "delta",
    "field",
    "gain",
    "gains",
    "lm",
    "none",
    "skip",
    "stratified",
];

/// A message of the program as a message of the package.
pub fn python(message: &str) -> String {
    let replace =
        |text: String, (command, function): &(&str, &str)| text.replace(command, function);
    let named = FUNCTIONS.iter().fold(message.to_owned(), replace);
    let mut out = String::new();
    let mut rest = named.as_str();
    while let Some(at) = rest.find("--") {
        let (before, option) = (&rest[..at], &rest[at + 2..]);
        let name = word(option, |c| c.is_ascii_lowercase() || c == '-');
        out += before;
        rest = &option[name.len()..];
        if name.is_empty() || before.ends_with(|c: char| c.is_alphanumeric() || c == '-') {
            out += "--";
            out += name;
            continue;
        }
        out += &name.replace('-', "_");
        let value = rest.strip_prefix(' ').unwrap_or_default();
        let value = word(value, |c| c.is_ascii_alphanumeric());
        if VALUES.contains(&value) {
            out += &format!("=\"{value}\"");
            rest = &rest[1 + value.len()..];
        } else if name == "force" {
            out += "=True";
        } else if let Some((_, after)) = rest.strip_prefix(" <").and_then(|r| r.split_once('>')) {
            rest = after;
        }
    }
    out + rest
}

/// The characters at the start of a text that belong to a word.
fn word(text: &str, belongs: impl Fn(char) -> bool) -> &str {
    let end = text.find(|c| !belongs(c)).unwrap_or(text.len());
    &text[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_arguments_and_commands_are_functions() {
        for (program, package) in [
            (
                "skip such rows with --bad-rows skip",
                "skip such rows with bad_rows=\"skip\"",
            ),
            ("or a larger --train", "or a larger train"),
            (
                "at once (host-fit plan --seconds 8); or try --what gains",
                "at once (hallstage.plan(stage, seconds=8)); or try what=\"gains\"",
            ),
            (
                "host-fit plan makes such a run",
                "hallstage.plan makes such a run",
            ),
            (
                "with host-fit recalibrate.",
                "with Calibration.recalibrate.",
            ),
            (
                "--force writes it in spite of that",
                "force=True writes it in spite of that",
            ),
            (
                "invalid value '13' for '--model <MODEL>'",
                "invalid value '13' for 'model'",
            ),
            ("join it by host-fit join", "join it by host-fit join"),
            ("a--b.csv:3: -- is no number", "a--b.csv:3: -- is no number"),
        ] {
            assert_eq!(python(program), package);
        }
    }
}
