//! The sentences: every finding, verdict, refusal and error becomes words here, for terminals, pages, JSON and Python alike.

mod causes;
mod evidence;
mod finding;
mod fit;
mod python;
mod refusal;
mod run;
mod verdict;

pub use finding::{message, remedy};
pub use fit::{model_reason, search_stopped, stopped};
pub use python::python;
pub use refusal::{NO_FIT, WordedRefusal, refusal};
pub use verdict::{own_logs, up_to, verdict};

use hallstage_input::finding::{Finding, Severity};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// A finding with its message, as JSON and Python show it.
#[derive(Clone, Copy, Debug)]
pub struct Worded<'a>(pub &'a Finding);

impl Serialize for Worded<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let found = self.0;
        let (value, unit) = found.kind.size().unzip();
        let mut out = serializer.serialize_struct("Finding", 9)?;
        out.serialize_field("code", &found.code())?;
        out.serialize_field("severity", &found.severity)?;
        out.serialize_field("message", &message(found))?;
        out.serialize_field("channel", &found.channel())?;
        out.serialize_field("movement", &found.movement())?;
        out.serialize_field("t_us", &found.t_us())?;
        out.serialize_field("value", &value)?;
        out.serialize_field("unit", &unit)?;
        out.serialize_field("cost", &found.cost)?;
        out.end()
    }
}

/// Findings with their messages.
pub fn worded(findings: &[Finding]) -> Vec<Worded<'_>> {
    findings.iter().map(Worded).collect()
}

/// Serializes findings with their messages: for a field of a report.
///
/// # Errors
/// The errors of the serializer.
pub fn serialize<S: Serializer>(findings: &[Finding], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(findings.iter().map(Worded))
}

/// The messages of findings.
pub fn messages(findings: &[Finding]) -> Vec<String> {
    findings.iter().map(message).collect()
}

/// The messages of the findings of at least this severity, one after the other.
pub fn paragraph(findings: &[Finding], least: Severity) -> String {
    let severe = findings.iter().filter(|finding| finding.severity >= least);
    severe.map(message).collect::<Vec<_>>().join(" ")
}

/// Text with a capital at its start and a full stop at its end.
fn sentence(text: &str) -> String {
    let mut rest = text.chars();
    let first = rest.next().map(char::to_uppercase).into_iter().flatten();
    let stop = if text.ends_with(['.', '?']) { "" } else { "." };
    first.chain(rest).chain(stop.chars()).collect()
}
