//! Tables of figures. The terminal and the pages show the same tables.

use super::figure::{Figure, Group, Item};
use super::text::words;
use hallstage_input::axis::sign;
use serde::{Serialize, Serializer};

/// A table of figures. The name of a row stands in its first column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Its title.
    pub title: String,
    /// Titles of the columns, beginning with the column of names. Empty in a list of names with their figures.
    pub columns: Vec<String>,
    /// Name and figures of each row.
    pub rows: Vec<(String, Vec<Figure>)>,
    /// A remark for each row, which stands in the last column, or none at all.
    pub remarks: Vec<String>,
    /// Decimals of um and urad; three if not given.
    pub decimals: Option<usize>,
}

/// Title of the first column, name of the row, and its figures by the titles of their columns.
type NamedRow = (String, String, Vec<(String, Figure)>);

/// A table as texts.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Cells {
    pub(super) titles: Vec<String>,
    /// Which columns hold texts, and so stand to the left.
    pub(super) is_left: Vec<bool>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these columns after the column of names.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        let columns = [""].iter().chain(columns);
        Self {
            title: title.into(),
            columns: columns.map(|title| (*title).to_owned()).collect(),
            ..Self::default()
        }
    }

    /// Adds a row.
    pub fn row(&mut self, name: impl Into<String>, figures: impl IntoIterator<Item = Figure>) {
        self.rows.push((name.into(), figures.into_iter().collect()));
    }

    /// A table with a row for each group. The first figure of a group is the name of its row.
    pub fn from_groups(title: &str, groups: &[Group]) -> Self {
        let rows = groups.iter().map(|group| {
            let mut figures = group.flat();
            let first = if figures.is_empty() {
                (String::new(), Figure::None)
            } else {
                figures.remove(0)
            };
            (first.0, first.1.text(), figures)
        });
        Self::from_rows(title, rows.collect())
    }

    /// A table of these rows, which need not have the same columns. A column without a value is left out.
    fn from_rows(title: &str, rows: Vec<NamedRow>) -> Self {
        let head = rows
            .first()
            .map_or(String::new(), |(head, ..)| head.clone());
        let mut columns = vec![head];
        for (name, figure) in rows.iter().flat_map(|(.., figures)| figures) {
            if !figure.is_empty() && !columns[1..].contains(name) {
                columns.push(name.clone());
            }
        }
        let row = |(_, name, figures): NamedRow| {
            let cell = |column: &String| {
                let found = figures.iter().find(|(name, _)| name == column);
                found.map_or(Figure::None, |(_, figure)| figure.clone())
            };
            (name, columns[1..].iter().map(cell).collect())
        };
        Self {
            title: title.to_owned(),
            rows: rows.into_iter().map(row).collect(),
            columns,
            ..Self::default()
        }
    }

    /// The texts. Where each row has one unit, the units stand in a column at the end, else in the titles.
    pub(super) fn cells(&self) -> Cells {
        let text = |figure: &Figure| match (figure, self.decimals) {
            (Figure::Number { value, unit, .. }, Some(decimals))
                if value.is_finite() && matches!(unit.name, "um" | "urad") =>
            {
                format!("{value:.decimals$}")
            }
            _ => figure.text(),
        };
        if self.columns.is_empty() {
            let line = |(name, figures): &(String, Vec<Figure>)| {
                let cell = |figure: &Figure| {
                    format!("{} {}", text(figure), sign(figure.unit().name))
                        .trim_end()
                        .to_owned()
                };
                std::iter::once(name.clone())
                    .chain(figures.iter().map(cell))
                    .collect()
            };
            let rows: Vec<Vec<String>> = self.rows.iter().map(line).collect();
            let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
            return Cells {
                titles: Vec::new(),
                is_left: vec![true; columns],
                rows,
            };
        }
        let unit = |figures: &mut dyn Iterator<Item = &Figure>| -> Option<&'static str> {
            let mut units = figures
                .map(|figure| sign(figure.unit().name))
                .filter(|unit| !unit.is_empty());
            let first = units.next().unwrap_or_default();
            units.all(|unit| unit == first).then_some(first)
        };
        let row_units: Option<Vec<&str>> = self
            .rows
            .iter()
            .map(|(_, row)| unit(&mut row.iter()))
            .collect();
        let row_units = row_units.filter(|units| units.iter().any(|unit| !unit.is_empty()));
        let column = |k: usize| self.rows.iter().filter_map(move |(_, row)| row.get(k));
        let titled = |(k, title): (usize, &String)| match k
            .checked_sub(1)
            .and_then(|k| unit(&mut column(k)))
        {
            Some(unit) if !unit.is_empty() && row_units.is_none() => format!("{title}, {unit}"),
            _ => title.clone(),
        };
        let mut titles: Vec<String> = self.columns.iter().enumerate().map(titled).collect();
        let is_text = |k: usize| column(k).any(Figure::is_text);
        let mut is_left: Vec<bool> = std::iter::once(true)
            .chain((1..titles.len()).map(|k| is_text(k - 1)))
            .collect();
        let row = |(k, (name, figures)): (usize, &(String, Vec<Figure>))| {
            let cells = std::iter::once(name.clone()).chain(figures.iter().map(text));
            let unit = row_units.as_ref().map(|units| units[k].to_owned());
            cells
                .chain(unit)
                .chain(self.remarks.get(k).cloned())
                .collect()
        };
        let rows = self.rows.iter().enumerate().map(row).collect();
        let more = [
            (row_units.is_some(), "unit"),
            (!self.remarks.is_empty(), "meaning"),
        ];
        for (_, title) in more.into_iter().filter(|(is_there, _)| *is_there) {
            titles.push(title.to_owned());
            is_left.push(true);
        }
        Cells {
            titles,
            is_left,
            rows,
        }
    }
}

impl Serialize for Table {
    /// Title and texts, for a page.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        (&self.title, self.cells()).serialize(to)
    }
}

impl Group {
    /// Its tables: one of its plain figures, then one for each group of groups and each list in it.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = Vec::new();
        self.add_tables("", &mut tables);
        tables.retain(|table| !table.rows.is_empty());
        tables
    }

    fn add_tables(&self, title: &str, all: &mut Vec<Table>) {
        let (mut plain, mut rows, mut others) = (
            Table {
                title: title.to_owned(),
                ..Table::default()
            },
            Vec::new(),
            Vec::new(),
        );
        let has_figures = self
            .0
            .iter()
            .any(|(_, item)| matches!(item, Item::Figure(_)));
        for (name, item) in &self.0 {
            let name = words(name);
            let inner = format!("{title} {name}").trim().to_owned();
            match item {
                Item::Hidden(_) | Item::Figure(Figure::None) => {}
                Item::Figure(figure) => plain.row(name, [figure.readable(true)]),
                Item::Group(group) if title.is_empty() || has_figures || group.has_groups() => {
                    group.add_tables(&inner, &mut others);
                }
                Item::Group(group) => rows.push((String::new(), name, group.flat())),
                Item::List(groups) => others.push(Table::from_groups(&inner, groups)),
            }
        }
        all.push(plain);
        all.push(Table::from_rows(title, rows));
        all.append(&mut others);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::{bare, figure, group};
    use crate::report::text::as_text;
    use serde_json::json;

    fn result() -> Group {
        let axis = |unit, rmse, peak| group! { "rmse" => figure(rmse, unit), "peak" => figure(peak, unit) };
        group! {
            "rows" => 3,
            "elapsed" => figure(1.25, "s"),
            "absent" => Figure::None,
            "secret" => json!(7),
            "fitness" => bare(1.5, "um"),
            "errors" => group! { "x" => axis("um", 1.0, 20.5), "rz" => axis("urad", 0.25, 0.5) },
            "lag" => figure(-3.0, "us").with_error(Some(0.5)),
            "logs" => vec![group! { "path" => "a.csv", "errors" => group! {
                "x" => group! { "rmse" => figure(2.0, "um") }, "rz" => group! { "rmse" => figure(3.0, "urad") },
            } }],
        }
    }

    #[test]
    fn a_result_is_shown_by_name_value_and_unit() {
        let want = [
            "  rows     3",
            "  elapsed  1.25 s",
            "  fitness  1.500 µm",
            "  lag      -3.00(50) µs",
            "",
            "errors",
            "       rmse    peak  unit",
            "  X   1.000  20.500  µm",
            "  Rz  0.250   0.500  µrad",
            "",
            "logs",
            "  path   errors X rmse, µm  errors Rz rmse, µrad",
            "  a.csv              2.000                 3.000",
            "",
        ];
        assert_eq!(as_text(&result().tables()), want.join("\n"));
    }

    #[test]
    fn the_keys_of_json_end_with_the_unit() {
        let want = json!({
            "rows": 3, "elapsed_s": 1.25, "absent": null, "secret": 7, "fitness": 1.5,
            "errors": {
                "x": { "rmse_um": 1.0, "peak_um": 20.5 }, "rz": { "rmse_urad": 0.25, "peak_urad": 0.5 },
            },
            "lag_us": -3.0, "standard_error_us": 0.5,
            "logs": [{ "path": "a.csv", "errors": { "x": { "rmse_um": 2.0 }, "rz": { "rmse_urad": 3.0 } } }],
        });
        assert_eq!(serde_json::to_value(result()).expect("JSON"), want);
    }
}
