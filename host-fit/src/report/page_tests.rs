use super::*;
use crate::diagnose::finding::{Code, Severity};
use crate::fit::{FitSettings, ModelChoice, fit};
use crate::input::dataset::{LogSource, Movement};
use crate::input::log;
use crate::input::log::ReadOptions;
use crate::input::shipped::{LOG_GZ, STAGE_TOML};
use crate::report::json::{Choice, Circumstances, of_fit};
use crate::solve::Solver;

/// Every 20th row of the shipped log, each movement as often as `copies` says.
fn shipped(stage: &Stage, copies: usize) -> Dataset {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv.gz");
    std::fs::write(&path, LOG_GZ).expect("written");
    let read = log::read(&[path], stage, &ReadOptions::default()).expect("sound");
    let mut dataset = Dataset {
        sha256: read.dataset.sha256,
        ..Dataset::default()
    };
    for _ in 0..copies {
        for movement in &read.dataset.movements {
            let (start, number) = (dataset.rows.len(), dataset.movements.len());
            let rows = read.dataset.rows[movement.rows.clone()].iter().step_by(20);
            dataset
                .rows
                .extend(rows.map(|row| crate::input::dataset::Row {
                    movement: number,
                    ..*row
                }));
            dataset.movements.push(Movement {
                rows: start..dataset.rows.len(),
                ..movement.clone()
            });
        }
    }
    dataset.logs = vec![LogSource {
        path: "a <log> & more.csv".into(),
        rows: 0..dataset.rows.len(),
        has_reference: true,
    }];
    dataset
}

fn provenance(dataset: &Dataset) -> Provenance {
    let mut provenance = Provenance {
        serial: "<b>&S".to_owned(),
        ..Provenance::new(std::iter::empty())
    };
    provenance.add_logs(dataset);
    provenance
}

fn stage() -> Stage {
    Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound")
}

#[test]
fn a_page_holds_every_figure_in_one_file_that_needs_no_other() {
    let stage = stage();
    let dataset = shipped(&stage, 1);
    let settings = FitSettings {
        solver: Solver::Finished,
        ..FitSettings::new(ModelChoice::Auto)
    };
    let fit = fit(&dataset, &stage, &settings).expect("a fit");
    let choice = Choice {
        solver: "shtlbo-lm",
        project: "linear",
        seed: 1,
        lag_compensated: false,
    };
    let circumstances = Circumstances {
        stage: &stage,
        dataset: &dataset,
        skipped_rows: 0,
        elapsed_s: 0.0,
        warnings: Vec::new(),
        findings: Vec::new(),
    };
    let report = of_fit(&fit, choice, &circumstances);
    let source = Source {
        stage: &stage,
        dataset: &dataset,
        provenance: provenance(&dataset),
        findings: &[],
        warnings: &[],
        fit: Some((&fit, &report)),
        end: End::Written,
    };
    let page = source.html().expect("a page");
    for part in [
        "Good</b>: errors in X, Y, Rz of 0.9",
        "Errors with designed values, Model (15)",
        "Errors with Model (30)",
        "Errors with Model (31)",
        "Displacements by the interferometers",
        "rms error of each movement",
        "Errors against Rz",
        "Errors against signal C",
        "Amplitude spectral density",
        "mutation probability p",
        "Zero deviations, and the ends",
        "interferometer.y_baseline_m",
        "Standard errors: sandwich",
        "prefers-color-scheme: dark",
        "table-header-group",
    ] {
        assert!(page.contains(part), "no `{part}`");
    }
    // Three before and after, three of signals, two by movement, nine quantities, spectrum,
    // distribution, search.
    assert_eq!(page.matches("<svg ").count(), 20);
    for part in [
        "http:", "https:", "src=", "<script", "@import", "url(", "NaN",
    ] {
        assert!(!page.contains(part), "`{part}`");
    }
    assert!(page.contains("&lt;b&gt;&amp;S") && !page.contains("<b>&"));
    assert!(page.contains("a &lt;log&gt; &amp; more.csv"));
    // Angles in degrees: the designed ones are zero and within the eight of the ranges.
    let theta = page.split("<td>theta_b</td><td>").nth(1).expect("theta_b");
    let value: f64 = (theta.split('<').next().and_then(|v| v.parse().ok())).expect("a number");
    assert!((0.3..0.6).contains(&value), "{value}");
    assert!(page.len() < 1_000_000, "{}", page.len());
    assert_eq!(page, source.html().expect("a page"));
}

#[test]
fn the_page_of_a_refused_log_has_its_findings_and_signals_and_does_not_grow_with_the_rows() {
    let stage = stage();
    let length = |copies: usize| {
        let dataset = shipped(&stage, copies);
        let finding = Finding {
            code: Code::ChannelsSwapped,
            severity: Severity::Refuse,
            message: "Hall A & B".to_owned(),
            channel: None,
            movement: None,
            t_us: None,
            value: None,
            unit: None,
        };
        let source = Source {
            stage: &stage,
            dataset: &dataset,
            provenance: provenance(&dataset),
            findings: &[finding],
            warnings: &["a line is cut".to_owned()],
            fit: None,
            end: End::Failed("it does not fit"),
        };
        let page = source.html().expect("a page");
        assert!(page.contains("Refused</b>: no parameter blob was written: it does not fit."));
        assert!(page.contains("<code>channels_swapped</code> Hall A &amp; B"));
        assert!(page.contains("a line is cut"));
        // Signals, and errors with the designed values and Model (30).
        assert_eq!(page.matches("<svg ").count(), 5);
        page.len()
    };
    let (short, long) = (length(1), length(8));
    assert!(long < short + short / 2, "{short} {long}");
}
