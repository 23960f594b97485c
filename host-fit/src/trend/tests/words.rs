//! What a trend says, as figures, words and charts.

use super::*;

#[test]
fn a_forced_blob_is_named() {
    let mut blobs = [0.0, 30.0].map(|day| blob(day, 1.0, "S"));
    blobs[0].1.fit.forced = true;
    let found = Trend::new(&blobs, &shipped::stage()).expect("a trend");
    let warnings = shown::warnings(&found);
    assert!(
        warnings
            .iter()
            .any(|of| of.starts_with("day 0 was refused")),
        "{warnings:?}"
    );
    assert!(
        !warnings
            .iter()
            .any(|of| of.starts_with("day 30 was refused"))
    );
}

#[test]
fn a_figure_has_one_key_whatever_its_value() {
    let keys = |found: &Trend| -> Vec<Vec<String>> {
        let json = serde_json::to_value(shown::figures(found)).expect("JSON");
        let axes = json["axes"].as_array().expect("axes").iter();
        axes.map(|axis| axis.as_object().expect("an axis").keys().cloned().collect())
            .collect()
    };
    let all = [trend(&[0.0; 2]), trend(&[0.0; 6])];
    let jumped = trend(&[0.0, 0.0, 0.0, 0.0, 2e-3, 2e-3]);
    assert!(jumped.drifts[0].jump.is_some());
    let [x, y, rz] = &keys(&jumped)[..] else {
        panic!("three axes")
    };
    assert!(x.iter().any(|key| key == "drift_a_month_um") && x == y);
    assert!(rz.iter().any(|key| key == "jump_urad"));
    assert!(all.iter().all(|found| keys(found) == keys(&jumped)));
}

#[test]
fn an_interval_without_an_end_is_said_in_words() {
    let mut found = trend(&[0.0; 4]);
    let said = |found: &Trend, days: [Option<f64>; 3]| {
        let mut found = found.clone();
        found.drifts[0].days = days;
        let json = serde_json::to_string(&shown::figures(&found)).expect("JSON");
        assert!(!json.contains("no date"), "{json}");
        (shown::answer(&found), json)
    };
    let (answer, _) = said(&found, [Some(10.0), Some(5.0), Some(20.0)]);
    assert!(
        answer.ends_with("on 2026-04-11; between 2026-04-06 and 2026-04-21 (95 %)."),
        "{answer}"
    );
    let (answer, _) = said(&found, [Some(10.0), Some(5.0), None]);
    assert!(
        answer.ends_with("on 2026-04-11; not before 2026-04-06, or never (95 %)."),
        "{answer}"
    );
    let (answer, json) = said(&found, [None, Some(5.0), None]);
    let words =
        "may reach their limit of 1.00 µm from 2026-04-06 on (95 %); by the line they do not.";
    assert!(answer.ends_with(words), "{answer}");
    assert!(json.contains(r#""reached":null"#) && json.contains(r#""earliest":"2026-04-06""#));
    // The page is not marked as good, and the errors end at their limit in the chart.
    let page =
        |found: &Trend| shown::page(found, Vec::new(), Provenance::default()).expect("a page");
    found.drifts[0].days = [None, Some(5.0), None];
    assert!(page(&found).contains("verdict limited"));
    found.drifts[0].days = [None; 3];
    assert!(page(&found).contains("verdict good"));
}

#[test]
fn the_curve_of_the_errors_grows_with_the_drift_to_the_limit_and_beyond() {
    let found = trend(&[0.0; 4]);
    let day = found.drifts[0].days[0].expect("a date");
    let curve = shown::forecast(&found, 0, 90.0 + day);
    assert!(
        curve[0].0 == 90.0 && (curve[0].1 - 0.5).abs() < 1e-6,
        "{:?}",
        curve[0]
    );
    let (last, error) = curve[curve.len() - 1];
    assert!(
        (last - 90.0 - day).abs() < 1e-9 && (error - 1.0).abs() < 1e-9,
        "{last} {error}"
    );
}
