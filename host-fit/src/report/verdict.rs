//! What a person reads first: whether the calibration can be used, its errors by axis, what to do next.

use super::budget::{self, COVERAGE};
use super::decision::Decision;
use super::figure::{Figure, Group, micro};
use super::table::Table;
use super::text::as_text;
use hallstage_calibration::diagnose::Diagnosis;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::judge::predicted::Predicted;
use hallstage_calibration::judge::statistics::PoseError;
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::words;
use hallstage_input::axis::PLANAR;
use hallstage_input::finding::Severity;
use serde::Serialize;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End<'a> {
    /// With a parameter blob.
    Written,
    /// With the best so far in the blob; the log was not diagnosed.
    Interrupted,
    /// Without a blob, or with errors beyond the limit, for this reason.
    Failed(&'a Refusal),
    /// A blob was judged on the log.
    Judged,
    /// The log was looked at, and nothing was kept.
    Checked,
}

/// What is judged.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// How the run ended.
    pub end: End<'a>,
    /// What is wrong with the log, and what is predicted.
    pub diagnosis: &'a Diagnosis,
    /// Whether the model is the field model, which is made for service.
    pub is_field: bool,
    /// Errors over all rows, if there is a fit or a blob.
    pub errors: Option<&'a PoseError>,
    /// The same with poses corrected by the speed and the acceleration of the reference, for a blob with the correction.
    pub corrected: Option<&'a PoseError>,
    /// The limits of the errors.
    pub decision: Decision,
}

impl Subject<'_> {
    /// The rms errors that the limits hold for: m, m, rad.
    fn decided(&self) -> Option<[f64; 3]> {
        match self.decision.in_service {
            true => Some(self.diagnosis.predicted.as_ref()?.rms),
            false => Some(self.errors?.axes.map(|axis| axis.rms)),
        }
    }

    /// Whether they are accepted. Where another reason than an error refuses the log, its errors decide nothing.
    pub fn passes(&self) -> [Option<bool>; 3] {
        let passes = self.decided().map(|rms| self.decision.passes(rms));
        let passes = passes.unwrap_or_default();
        let is_refused = self.diagnosis.verdict == Some(Verdict::Refused);
        match is_refused && !passes.contains(&Some(false)) {
            true => [None; 3],
            false => passes,
        }
    }

    /// The decision rule, and how the errors do by it.
    pub fn decision(&self) -> Group {
        let passes = self.passes();
        let by_axis = self.decided().map(|rms| self.decision.figures(rms, passes));
        let mut figures = by_axis.unwrap_or_default();
        figures.set("rule", self.decision.text());
        figures
    }
}

/// Verdict, errors by axis, and what to do.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// How the page marks it: `good`, `limited` or `refused`.
    pub mark: &'static str,
    /// The verdict.
    pub word: &'static str,
    /// What it means.
    pub sentence: String,
    /// A row for each axis.
    pub axes: Table,
    /// A row for each source of uncertainty.
    pub budget: Table,
    /// What stands below it: degrees of freedom, and the inputs that it lacks.
    pub budget_note: String,
    /// What to do next; empty if nothing.
    pub next: String,
    /// Whether that is the remedy of a finding. The message of the finding ends with it.
    #[serde(skip)]
    is_remedy: bool,
}

impl Summary {
    /// The summary of a run.
    pub fn new(of: &Subject) -> Self {
        let predicted = of.diagnosis.predicted.as_ref();
        let budget = of.diagnosis.budget.as_ref();
        let verdict = of.diagnosis.verdict;
        let remedy = remedy(of, verdict);
        let (mark, word) = match (of.end, verdict) {
            (End::Failed(_), _) => ("refused", "Refused"),
            (End::Interrupted, _) => ("limited", "Interrupted, the best so far"),
            (End::Written, Some(Verdict::Refused)) => ("refused", "Written in spite of a refusal"),
            (End::Judged, Some(Verdict::Refused)) => ("refused", "Not good enough for service"),
            (_, Some(Verdict::Refused)) => ("refused", "Refused"),
            (_, Some(Verdict::Limited)) => ("limited", "Limited"),
            (_, Some(Verdict::Good)) => ("good", "Good"),
            (_, None) => ("limited", "Within the limit on this log"),
        };
        Self {
            mark,
            word,
            sentence: sentence(of),
            axes: axes(of, predicted),
            budget: budget.map(budget::table).unwrap_or_default(),
            budget_note: budget.map_or(String::new(), budget::note),
            is_remedy: remedy.is_some(),
            next: remedy.unwrap_or_else(|| next(of, verdict).to_owned()),
        }
    }

    /// A sentence without figures.
    pub fn plain(mark: &'static str, word: &'static str, sentence: String) -> Self {
        Self {
            mark,
            word,
            sentence,
            ..Self::default()
        }
    }

    /// The summary on a terminal: a line, the table, a line.
    pub fn as_text(&self) -> String {
        // The error that ends the command says why it is refused.
        let sentence = match self.word {
            "Refused" => String::new(),
            _ => format!(": {}", self.sentence),
        };
        // A remedy stands in the message of its finding.
        let next = match self.next.as_str() {
            next if self.is_remedy || next.is_empty() => String::new(),
            next => format!("next: {next}\n"),
        };
        let axes = match self.axes.rows.is_empty() {
            true => String::new(),
            false => as_text(std::slice::from_ref(&self.axes)),
        };
        format!("{}{sentence}\n{axes}{next}", self.word)
    }
}

/// The meaning of the verdict.
fn sentence(of: &Subject) -> String {
    match of.end {
        End::Failed(refusal) => words::refusal(refusal, &of.diagnosis.findings),
        _ => words::verdict(of.diagnosis, of.is_field),
    }
}

/// By axis: rms over all rows, noise, rms predicted for service, the limit of one of these, expanded uncertainty. The
/// uncertainty is twice the combined uncertainty of the budget, or else the rms in service, or on the log; k = 2 covers
/// 95 % of normal errors.
fn axes(of: &Subject, predicted: Option<&Predicted>) -> Table {
    if of.errors.is_none() && predicted.is_none() {
        return Table::default();
    }
    let mut columns = vec![
        "rms on the log",
        "noise",
        "rms in service",
        match of.decision.in_service {
            true => "limit in service",
            false => "limit on the log",
        },
        "pass",
        "uncertainty, k = 2",
    ];
    if of.corrected.is_some() {
        columns.insert(1, "corrected for motion");
    }
    let mut table = Table {
        decimals: Some(2),
        ..Table::new("", &columns)
    };
    let passes = of.passes();
    for (k, axis) in PLANAR.iter().enumerate() {
        let rms = of.errors.map(|errors| errors.axes[k].rms);
        let service = predicted.map(|predicted| predicted.rms[k]);
        let noise = predicted.map(|predicted| predicted.rms[k] / predicted.ratio[k]);
        let limit = of.decision.accepted(k);
        let budget = of.diagnosis.budget.as_ref();
        let combined = budget.map(|budget| budget.combined()[0][k]);
        let uncertainty = combined.or(service).or(rms).map(|rms| COVERAGE * rms);
        let error = |error: Option<f64>| error.map_or(Figure::None, |error| micro(axis, error));
        let mut figures = [rms, noise, service, limit].map(error).to_vec();
        figures.extend([
            passes[k].map_or(Figure::None, Figure::Is),
            error(uncertainty),
        ]);
        if let Some(corrected) = of.corrected {
            figures.insert(1, micro(axis, corrected.axes[k].rms));
        }
        table.row(axis.name, figures);
    }
    table
}

/// The remedy of the worst finding, where it stands in the way.
fn remedy(of: &Subject, verdict: Option<Verdict>) -> Option<String> {
    let least = match (of.end, verdict) {
        (End::Failed(_), _) | (_, Some(Verdict::Refused)) => Severity::Refuse,
        (_, Some(Verdict::Limited)) if of.is_field => Severity::Warn,
        _ => return None,
    };
    let worst = (of.diagnosis.findings.iter()).find(|found| found.severity >= least);
    worst.map(words::remedy)
}

/// What to do next where no finding stands in the way.
fn next(of: &Subject, verdict: Option<Verdict>) -> &'static str {
    match (of.end, verdict) {
        (End::Failed(_), _) => "",
        (_, Some(Verdict::Limited)) if !of.is_field => {
            "for service record all six axes moving at once: host-fit plan"
        }
        (End::Written, _) => "judge it on another log with host-fit eval",
        (End::Checked, _) => "host-fit fit",
        (End::Judged, Some(Verdict::Refused)) => "host-fit recalibrate, or a new fit",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_calibration::judge::predicted::Validity;
    use hallstage_calibration::judge::statistics::AxisError;
    use hallstage_input::finding::{Finding, Kind};

    const PREDICTED: Predicted = Predicted {
        rms: [1.2e-6, 0.5e-6, 2.4e-6],
        ratio: [1.2, 1.0, 1.0],
        range: [[1e-6, 3e-6], [0.4e-6, 0.6e-6], [2e-6, 3e-6]],
    };

    fn summary(end: End, verdict: Option<Verdict>, is_field: bool) -> Summary {
        limited(end, verdict, is_field, true)
    }

    fn limited(end: End, verdict: Option<Verdict>, is_field: bool, in_service: bool) -> Summary {
        let axis = AxisError {
            rms: 1e-6,
            ..AxisError::default()
        };
        let errors = PoseError {
            axes: [axis; 3],
            rows: 1,
        };
        let diagnosis = Diagnosis {
            // The kind has a remedy of its own.
            findings: vec![Finding::new(Kind::MovementsMissed { movements: vec![] })],
            verdict,
            predicted: Some(PREDICTED),
            validity: Some(Validity {
                within_k: 3.4,
                is_followed: true,
            }),
            ..Diagnosis::default()
        };
        let limits = [None, Some(0.9e-6), None];
        Summary::new(&Subject {
            end,
            diagnosis: &diagnosis,
            is_field,
            errors: Some(&errors),
            corrected: None,
            decision: match in_service {
                true => Decision::in_service(limits, false, (&PREDICTED, None), verdict),
                false => Decision::on_log(limits),
            },
        })
    }

    #[test]
    fn the_end_of_the_run_and_the_verdict_decide_what_is_said_first() {
        use Verdict::{Good, Limited, Refused};
        let (good, limited, refused) = (Some(Good), Some(Limited), Some(Refused));
        let failed = &Refusal::Unfinished { over_noise: 7.0 };
        let failed = End::Failed(failed);
        for (end, verdict, is_field, [mark, sentence, next]) in [
            (End::Written, good, true, ["good", "1.20", "host-fit eval"]),
            (End::Written, good, true, ["good", "within 3 K", "eval"]),
            (End::Checked, good, true, ["good", "1.20", "host-fit fit"]),
            (End::Written, limited, true, ["limited", "1.20", "--draw"]),
            (End::Written, limited, false, ["limited", "µm in X", "plan"]),
            (End::Written, refused, true, ["refused", "1.20", "fit eval"]),
            (failed, good, true, ["refused", "7.0 times the noise", ""]),
            (End::Interrupted, good, true, ["limited", "1.20", ""]),
            (End::Judged, None, true, ["limited", "1.20 times", ""]),
            (
                End::Judged,
                refused,
                true,
                ["refused", "1.20 times", "recalibrate"],
            ),
        ] {
            let found = summary(end, verdict, is_field);
            assert_eq!(found.mark, mark, "{end:?} {verdict:?}");
            assert!(found.sentence.contains(sentence), "{found:?}");
            assert!(found.next.contains(next), "{found:?}");
        }
    }

    #[test]
    fn all_axes_pass_by_one_quantity_that_the_column_of_the_limit_names() {
        let rows = |in_service: bool| {
            let text = limited(End::Written, Some(Verdict::Good), true, in_service).as_text();
            let lines = text.lines().skip(1);
            let lines = lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
            lines.collect::<Vec<_>>()
        };
        // rms, noise, in service, limit, k = 2. The smaller limit counts.
        let [title, x, y, rz, next] = &rows(true)[..] else {
            panic!("three axes");
        };
        assert!(
            title.contains("limit in service pass uncertainty"),
            "{title}"
        );
        assert_eq!(x, "X 1.00 1.00 1.20 1.30 yes 2.40 µm");
        assert_eq!(y, "Y 1.00 0.50 0.50 0.65 yes 1.00 µm");
        assert_eq!(rz, "Rz 1.00 2.40 2.40 3.12 yes 4.80 µrad");
        assert_eq!(next, "next: judge it on another log with host-fit eval");
        let [title, x, y, ..] = &rows(false)[..] else {
            panic!("three axes");
        };
        // Errors within the limits do not pass where the log is refused.
        let refused = summary(End::Judged, Some(Verdict::Refused), true);
        let cells = refused.axes.cells().rows;
        assert!(cells.iter().all(|row| row[5] == "-"), "{cells:?}");
        assert!(title.contains("limit on the log pass"), "{title}");
        assert_eq!(x, "X 1.00 1.00 1.20 - - 2.40 µm");
        assert_eq!(y, "Y 1.00 0.50 0.50 0.90 no 1.00 µm");
    }
}
