use super::*;
use crate::report::decision::Decision;
use crate::report::result::Judged;
use crate::report::verdict::End;
use hallstage_calibration::diagnose::Diagnosis;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::fit::{FitSettings, ModelChoice, fit};
use hallstage_calibration::judge::Zeros;
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_input::dataset::{Movement, Row};
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::log::{ReadOptions, read_bytes};
use hallstage_input::shipped::{LOG_GZ, stage};

/// Every 20th row of the shipped log.
fn shipped(stage: &Stage) -> Dataset {
    let read = read_bytes(LOG_GZ, "log".as_ref(), stage, &ReadOptions::default());
    let read = read.expect("sound");
    let mut dataset = Dataset {
        sha256: read.dataset.sha256,
        ..Dataset::default()
    };
    for movement in &read.dataset.movements {
        let (start, number) = (dataset.rows.len(), dataset.movements.len());
        let rows = read.dataset.rows[movement.rows.clone()].iter().step_by(20);
        dataset.rows.extend(rows.map(|row| Row {
            movement: number,
            ..*row
        }));
        dataset.movements.push(Movement {
            rows: start..dataset.rows.len(),
            ..movement.clone()
        });
    }
    dataset.logs.clear();
    dataset.end_log("a <log> & more.csv");
    dataset
}

fn subject<'a>(end: End<'a>, diagnosis: &'a Diagnosis) -> Subject<'a> {
    Subject {
        end,
        diagnosis,
        is_field: false,
        errors: None,
        corrected: None,
        decision: Decision::default(),
    }
}

fn source<'a>(stage: &'a Stage, dataset: &'a Dataset, subject: Subject<'a>) -> Source<'a> {
    let mut provenance = Provenance::new(std::iter::empty());
    provenance.add_logs(dataset);
    Source {
        title: "Calibration certificate",
        subject,
        facts: vec![["stage".to_owned(), "<b>&S".to_owned()]],
        stage,
        dataset,
        provenance,
        warnings: Vec::new(),
        report: None,
        as_found: None,
        certificates: Some(Certificates::default()),
    }
}

#[test]
fn a_page_holds_every_figure_in_one_file_that_needs_no_other() {
    let stage = stage();
    let dataset = shipped(&stage);
    let fit = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto)).expect("a fit");
    let diagnosis = Diagnosis {
        verdict: Some(Verdict::Limited),
        ..Diagnosis::default()
    };
    let judged = Judged {
        set: &fit.set,
        judgement: &fit.judgement,
        zeros: Zeros::Refit,
        by_row: fit.errors_by_row(&dataset),
        over_rows: fit.judgement.errors,
        stage: &stage,
        dataset: &dataset,
        skipped_rows: 0,
        elapsed_s: 0.0,
        warnings: Vec::new(),
        diagnosis: &diagnosis,
        refusal: None,
    };
    let report = Report::from_judgement(judged);
    let subject = Subject {
        errors: Some(&fit.judgement.errors),
        ..subject(End::Written, &diagnosis)
    };
    let source = Source {
        report: Some(&report),
        ..source(&stage, &dataset, subject)
    };
    let page = source.html().expect("a page");
    for part in [
        "Limited</b>",
        "uncertainty, k = 2",
        "X ±",
        "movements like the log",
        "on one scale",
        "Errors against Rz",
        "Errors against signal C",
        "sensitivity at rest over the designed one",
        "X rms, µm",
        "prefers-color-scheme: dark",
        "table-header-group",
    ] {
        assert!(page.contains(part), "no `{part}`");
    }
    // Before and after, nine quantities.
    assert_eq!(page.matches("<svg ").count(), 11);
    for part in [
        "http:", "https:", "src=", "<script", "@import", "url(", "NaN", " um", " urad",
    ] {
        assert!(!page.contains(part), "`{part}`");
    }
    assert!(page.contains("&lt;b&gt;&amp;S") && !page.contains("<b>&"));
    assert!(page.contains("a &lt;log&gt; &amp; more.csv"));
    // Angles in mrad: the designed ones are zero and within the 140 of the ranges.
    let theta = page.split(">theta</td>").nth(1).expect("theta");
    let value = theta.split('>').nth(5);
    let value = value.and_then(|cell| cell.split(['(', '<']).next());
    let value: f64 = value.and_then(|v| v.parse().ok()).expect("a number");
    assert!((-4.0..-1.0).contains(&value), "{value}");
    assert!(page.len() < 1_000_000, "{}", page.len());
    assert_eq!(page, source.html().expect("a page"));
}

#[test]
fn the_page_of_a_refused_log_has_its_findings_by_cause() {
    let stage = stage();
    let found = |log: &str, cost| Finding {
        log: Some(log.to_owned()),
        ..Finding::new(Kind::UnevenTimes { rms_us: 3.0 }).with_cost(cost)
    };
    let diagnosis = Diagnosis {
        findings: vec![found("A & B.csv", 3.0), found("C.csv", 7.25)],
        ..Diagnosis::default()
    };
    let dataset = shipped(&stage);
    let refused = subject(End::Failed(&Refusal::Findings), &diagnosis);
    let source = Source {
        warnings: vec!["a line is cut".to_owned()],
        ..source(&stage, &dataset, refused)
    };
    let page = source.html().expect("a page");
    assert!(page.contains("Refused</b>: The log is refused."));
    // One cause, with the cost of the worst.
    assert_eq!(page.matches("<code>jitter</code>").count(), 1);
    assert!(page.contains("(2 times): left as it is, 7.25 times the noise in service"));
    assert!(page.contains("A &amp; B.csv: Rows come"));
    assert!(page.contains("a line is cut") && !page.contains("uncertainty, k = 2"));
}

#[test]
fn a_page_is_a_certificate_once_its_fields_are_filled_in() {
    let mut stage = stage();
    let dataset = shipped(&stage);
    let diagnosis = Diagnosis {
        findings: vec![
            Finding::new(Kind::UnevenTimes { rms_us: 3.0 }).with_severity(Severity::Warn),
            Finding::new(Kind::UnevenTimes { rms_us: 3.0 }).with_severity(Severity::Note),
        ],
        ..Diagnosis::default()
    };
    let ended = |stage: &Stage, end| {
        let subject = subject(end, &diagnosis);
        source(stage, &dataset, subject).html().expect("a page")
    };
    let page = |stage: &Stage| ended(stage, End::Written);
    assert!(page(&stage).contains("<h1>Calibration report</h1>"));
    stage.certificate.texts = TEXTS.map(|key| format!("of \"</{key}>"));
    let full = page(&stage);
    assert!(full.contains("<h1>Calibration certificate</h1>"));
    let refused = ended(&stage, End::Failed(&Refusal::Findings));
    assert!(refused.contains("<h1>Calibration report</h1>"));
    // On the foot of each page.
    assert!(full.contains("of\\20 \\22 \\3c \\2f number\\3e "), "{full}");
    assert!(!full.contains("\"</number>") && full.contains("counter(pages)"));
    assert_eq!(
        full.matches("<details class=\"finding warn\" open>")
            .count(),
        1
    );
    stage.certificate.texts[2].clear();
    let open = page(&stage);
    assert!(open.contains("<h1>Calibration report</h1>"));
    assert!(open.contains("<td>missing for a certificate</td><td>customer</td>"));
    // Only the certificate has its number.
    let foot = |page: &str| page.contains("of\\20 \\22 \\3c \\2f number\\3e ");
    assert!(foot(&full) && !foot(&refused) && !foot(&open));
    assert!(open.contains("<td>number</td><td>document "));
    stage.certificate.texts[2] = "a customer".to_owned();
    let without_posterior = Source {
        certificates: None,
        ..source(&stage, &dataset, subject(End::Written, &diagnosis))
    };
    let report = without_posterior.html().expect("a page");
    assert!(report.contains("<h1>Calibration report</h1>"));
    assert!(report.contains("<td>a posterior, which keeps the number</td>"));
    let of = |title, [own, before]: [&str; 2]| {
        let own = Certificates::default()
            .with(before.to_owned())
            .with(own.to_owned());
        let certificates = match title == CERTIFICATE {
            true => own.next(),
            false => own,
        };
        let source = Source {
            title,
            certificates: Some(certificates),
            ..source(&stage, &dataset, subject(End::Written, &diagnosis))
        };
        source.html().expect("a page")
    };
    let judged = of("Verification of a calibration", ["B & 6", "A"]);
    let named = "<td>certificate of the blob</td><td>";
    assert!(!foot(&judged) && judged.contains(&format!("{named}B &amp; 6</td>")));
    let uncertified = of("Verification of a calibration", ["", "A"]);
    let text = format!("{named}none; the latest before it is A</td>");
    assert!(uncertified.contains(&text));
    let next = of(CERTIFICATE, ["B & 6", "A"]);
    assert!(foot(&next) && next.contains("<td>latest certificate before</td><td>B &amp; 6</td>"));
    // However early it was taken, and however it is written.
    let number = stage.certificate.texts[0].clone();
    for taken in [number.clone(), format!(" {} ", number.to_uppercase())] {
        let again = of(CERTIFICATE, ["C-2", &taken]);
        assert!(again.contains("a number of its own") && !foot(&again));
    }
}
