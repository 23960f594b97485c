//! The uncertainty budget: as figures, and as the table below the verdict.

use super::errors::pose;
use super::figure::{Figure, Group, bare, group, micro};
use super::table::Table;
use hallstage_calibration::budget::{Budget, Source};
use hallstage_input::axis::PLANAR;
use serde_json::{Value, json};

/// Coverage factor of the expanded uncertainty.
pub const COVERAGE: f64 = 2.0;

/// All figures. `sensitivity` is the contribution over service by a unit of the input.
pub fn figures(budget: &Budget) -> Group {
    let [rms, ends] = budget.combined();
    let freedom = budget.effective_freedom().map(|freedom| freedom.round());
    group! {
        "sources" => rows(budget),
        "combined" => group! { "rms" => pose(rms), "ends" => pose(ends) },
        "expanded" => group! {
            "k" => COVERAGE,
            "rms" => pose(rms.map(|u| COVERAGE * u)),
            "ends" => pose(ends.map(|u| COVERAGE * u)),
        },
        "degrees_of_freedom" => freedom.into_iter().collect::<Figure>(),
        "not_included" => budget.not_included.iter().map(String::as_str).collect::<Figure>(),
    }
}

/// The rows of a table for programs: the sources, the combined uncertainty, and what is not included.
pub fn frame(budget: &Budget) -> Vec<Value> {
    let [rms, ends] = budget.combined();
    let combined = group! { "source" => "combined", "rms" => pose(rms), "ends" => pose(ends) };
    let absent = budget.not_included.iter();
    let absent = absent.map(|name| group! { "source" => format!("not included: {name}") });
    let all = rows(budget).into_iter().chain([combined]).chain(absent);
    let known = |row: Group| {
        let mut row = json!(row);
        if let Some(row) = row.as_object_mut() {
            row.retain(|_, value| !value.is_null());
        }
        row
    };
    all.map(known).collect()
}

/// One row for each source.
fn rows(budget: &Budget) -> Vec<Group> {
    let row = |source: &Source| {
        group! {
            "source" => source.name.as_str(),
            "u" => source.value.map(|value| bare(value, "")),
            "unit" => source.unit.as_str(),
            "sensitivity" => source.value.map(|value| pose(source.rms.map(|rms| rms / value))),
            "rms" => pose(source.rms),
            "ends" => pose(source.ends),
        }
    };
    budget.sources.iter().map(row).collect()
}

/// The table of a certificate.
pub(super) fn table(budget: &Budget) -> Table {
    let columns = [
        "u",
        "X",
        "Y",
        "Rz",
        "X at the ends",
        "Y at the ends",
        "Rz at the ends",
    ];
    let mut table = Table {
        decimals: Some(3),
        ..Table::new(
            "Uncertainty budget: standard uncertainties in service, rms",
            &columns,
        )
    };
    let contributions = |[rms, ends]: [[f64; 3]; 2]| {
        let all = [rms, ends]
            .into_iter()
            .flat_map(|of_axes| PLANAR.iter().zip(of_axes));
        all.map(|(axis, u)| micro(axis, u)).collect::<Vec<_>>()
    };
    for source in &budget.sources {
        let u = source.value.map_or(Figure::None, |value| {
            Figure::Text(worded(value, &source.unit))
        });
        table.row(
            &*source.name,
            [u].into_iter()
                .chain(contributions([source.rms, source.ends])),
        );
    }
    let combined = budget.combined();
    table.row(
        "combined",
        [Figure::None].into_iter().chain(contributions(combined)),
    );
    let expanded = combined.map(|of_axes| of_axes.map(|u| COVERAGE * u));
    table.row(
        "expanded, k = 2",
        [Figure::None].into_iter().chain(contributions(expanded)),
    );
    table
}

/// What stands below the table.
pub(super) fn note(budget: &Budget) -> String {
    let freedom = budget.effective_freedom();
    let freedom = freedom.into_iter().fold(f64::INFINITY, f64::min);
    let absent = match budget.not_included.as_slice() {
        [] => String::new(),
        absent => format!(" Not included: {}.", absent.join(", ")),
    };
    format!(
        "u: standard uncertainty of the input. Effective degrees of freedom: {freedom:.0} or more.{absent}"
    )
}

/// A standard uncertainty in a unit that reads well.
fn worded(value: f64, unit: &str) -> String {
    let (by, unit) = match unit {
        "m" => (1e3, "mm"),
        "rad" => (1e3, "mrad"),
        "" => (1e2, "%"),
        unit => (1.0, unit),
    };
    let number = format!("{:.4}", value * by);
    format!(
        "{} {unit}",
        number.trim_end_matches('0').trim_end_matches('.')
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_uncertainty_reads_in_the_unit_of_a_drawing() {
        for (value, unit, want) in [
            (0.17e-3, "m", "0.17 mm"),
            (1e-4, "rad", "0.1 mrad"),
            (1e-3, "", "0.1 %"),
            (0.3, "ppm", "0.3 ppm"),
            (0.12, "K", "0.12 K"),
        ] {
            assert_eq!(worded(value, unit), want);
        }
    }
}
