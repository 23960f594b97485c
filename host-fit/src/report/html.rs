//! Pages: a verdict, facts, findings by their cause, and sections of tables and charts. One template serves
//! all; its name ends in `.html`, so that every text is escaped.

use super::chart::Chart;
use super::table::Table;
use super::verdict::Summary;
use hallstage_calibration::words::Worded;
use hallstage_input::finding::{Code, Finding, Severity};
use minijinja::value::Serde;
use minijinja::{Environment, Error, UndefinedBehavior};
use serde::Serialize;

/// A page, complete in one file.
#[derive(Clone, Debug, Serialize)]
pub struct Page<'a> {
    /// Its title.
    pub title: &'static str,
    /// What tells it from other pages: the number of the certificate, or a number of its own.
    pub number: String,
    /// Whether a calibration can be used.
    pub verdict: Summary,
    /// Tables that stand beside the verdict.
    pub first: Vec<Table>,
    /// Name and text of the other facts on a certificate.
    pub facts: Vec<[String; 2]>,
    /// What was found; `None` of a page that is not about a log.
    pub causes: Option<Vec<Cause<'a>>>,
    /// What the user should know besides.
    pub warnings: &'a [String],
    /// What follows.
    pub sections: Vec<Section>,
}

/// Findings of one code.
#[derive(Clone, Debug, Serialize)]
pub struct Cause<'a> {
    code: Code,
    /// The worst of theirs.
    severity: Severity,
    meaning: &'static str,
    /// Predicted errors in service over the noise floor with the worst of them alone.
    cost: Option<f64>,
    findings: Vec<Worded<'a>>,
}

impl<'a> Cause<'a> {
    /// Findings in order, the most severe first.
    pub fn grouped(findings: &'a [Finding]) -> Vec<Self> {
        let mut causes: Vec<Self> = Vec::new();
        for found in findings {
            match causes.iter_mut().find(|cause| cause.code == found.code()) {
                Some(cause) => {
                    cause.cost = cause.cost.into_iter().chain(found.cost).reduce(f64::max);
                    cause.findings.push(Worded(found));
                }
                None => causes.push(Self {
                    code: found.code(),
                    severity: found.severity,
                    meaning: found.code().entry().meaning,
                    cost: found.cost,
                    findings: vec![Worded(found)],
                }),
            }
        }
        causes
    }
}

/// A part of a page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// Its title.
    pub title: &'static str,
    /// What stands first.
    pub notes: Vec<String>,
    /// Its tables; long ones are folded.
    pub tables: Vec<Table>,
    /// Its charts.
    pub charts: Vec<Chart>,
}

/// Renders a template; it may include the templates of verdict, findings, cells and charts.
fn rendered(name: &str, template: &str, of: &impl Serialize) -> Result<String, Error> {
    let mut engine = Environment::new();
    engine.set_undefined_behavior(UndefinedBehavior::Strict);
    engine.add_global("style", include_str!("style.css"));
    engine.add_filter("css", css);
    engine.add_template("cells.html", include_str!("cells.html"))?;
    engine.add_template("chart.html", include_str!("chart.html"))?;
    engine.add_template("verdict.html", include_str!("verdict.html"))?;
    engine.add_template("findings.html", include_str!("findings.html"))?;
    engine.render_named_str(name, template, Serde(of))
}

/// A text between quotation marks of a style sheet: all but letters and digits of ASCII by their numbers.
fn css(text: &str) -> String {
    let escaped = |c: char| match c.is_ascii_alphanumeric() {
        true => c.to_string(),
        false => format!("\\{:x} ", u32::from(c)),
    };
    text.chars().map(escaped).collect()
}

impl Page<'_> {
    /// The page as HTML.
    ///
    /// # Errors
    /// [`Error`] when the template names something that is not there.
    pub fn html(&self) -> Result<String, Error> {
        rendered("page.html", include_str!("page.html"), self)
    }

    /// Verdict and findings alone, to stand in a notebook.
    ///
    /// # Errors
    /// As [`Self::html`].
    pub fn head(&self) -> Result<String, Error> {
        let parts = "{% include \"verdict.html\" %}\n{% include \"findings.html\" %}";
        rendered("head.html", parts, self)
    }
}
