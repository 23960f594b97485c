//! The picture of a scope: made for 80 x 24 characters, larger where there is room.

use super::history::{History, ScopeRow};
use super::trace::{self, Facts};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Paragraph};

/// Characters of the names and of the figures of a trace.
const NAME: u16 = 9;
const FIGURES: u16 = 32;

/// What the keys have chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Choice {
    pub(super) shows_spectrum: bool,
    pub(super) is_hidden: [bool; 6],
}

const KEYS: &str = "q quit  space freeze  < > move  + - zoom  s spectrum  1-6 hide";
const WARNING: Style = Style::new().fg(Color::Red);

/// Draws everything.
pub(super) fn draw(frame: &mut Frame<'_>, history: &History, choice: Choice) {
    let [head, traces, state, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(6),
        Constraint::Length(1),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    frame.render_widget(Paragraph::new(title(history)), head);
    let codes = [0, 1, 2, 3, 4, 5].map(|sensor| history.codes(sensor));
    let mut facts: Vec<Facts> = codes
        .iter()
        .zip(&history.scales)
        .map(|(codes, scale)| Facts::new(codes, history.window().len(), scale, history.period_s))
        .collect();
    facts.chunks_mut(3).for_each(trace::compare);
    let warnings = [0, 1, 2, 3, 4, 5].map(|sensor| {
        let wires = (sensor < 3).then(|| history.wires(sensor)).flatten();
        let warning = wires.unwrap_or_default() + " " + &facts[sensor].warning();
        warning.trim().to_owned()
    });
    let shown: Vec<usize> = (0..6).filter(|sensor| !choice.is_hidden[*sensor]).collect();
    let rows = Layout::vertical(shown.iter().map(|_| Constraint::Fill(1))).split(traces);
    for (sensor, area) in shown.into_iter().zip(rows.iter()) {
        let [name, picture, figures] = Layout::horizontal([
            Constraint::Length(NAME),
            Constraint::Min(10),
            Constraint::Length(FIGURES),
        ])
        .areas(*area);
        let scale = &history.scales[sensor];
        let label = format!("{} {}", sensor + 1, scale.name);
        frame.render_widget(Paragraph::new(label), name);
        let (points, bounds) = match choice.shows_spectrum {
            true => lines(&codes[sensor], history, sensor),
            false => curve(&codes[sensor], 2 * usize::from(picture.width)),
        };
        chart(frame, picture, &points, bounds);
        let warning = &warnings[sensor];
        let text = match choice.shows_spectrum {
            true => strongest(&points, scale.unit),
            false => figures_of(&facts[sensor], &codes[sensor], scale.unit, warning),
        };
        frame.render_widget(Paragraph::new(text), figures);
    }
    let faults = warnings
        .iter()
        .filter(|warning| !warning.is_empty())
        .count();
    let text = match faults {
        _ if history.counts[0] == 0 => format!("no row yet  {}", history.state),
        0 => format!("no fault of a sensor in this window  {}", history.state),
        faults => format!("faults of sensors: {faults}  {}", history.state),
    };
    frame.render_widget(Paragraph::new(text), state);
    frame.render_widget(Paragraph::new(KEYS), keys);
}

fn title(history: &History) -> String {
    let mut window = history.window();
    let seconds = |row: Option<&ScopeRow>| row.map_or(0.0, |row| 1e-6 * row.t_us);
    let first_s = seconds(window.next());
    let last_s = seconds(window.last());
    let [rows, missing] = history.counts;
    let frozen = if history.is_frozen { "  FROZEN" } else { "" };
    format!(
        "{}  {first_s:.2} .. {last_s:.2} s  {rows} rows, {missing} missing{frozen}",
        history.title
    )
}

/// Smallest and largest code of each half character, so that no spike is lost, and the bounds of both axes.
fn curve(codes: &[i32], columns: usize) -> (Vec<(f64, f64)>, [[f64; 2]; 2]) {
    let per_column = codes.len().div_ceil(columns.max(1)).max(1);
    let mut points = Vec::new();
    for (column, piece) in codes.chunks(per_column).enumerate() {
        for code in [piece.iter().min(), piece.iter().max()]
            .into_iter()
            .flatten()
        {
            points.push((column as f64, f64::from(*code)));
        }
    }
    let columns = codes.len().div_ceil(per_column);
    let bounds = [[0.0, columns as f64], ends(&points)];
    (points, bounds)
}

/// The spectrum, with the bounds of both axes.
fn lines(codes: &[i32], history: &History, sensor: usize) -> (Vec<(f64, f64)>, [[f64; 2]; 2]) {
    let points = trace::spectrum(codes, &history.scales[sensor], history.period_s);
    let bounds = [[0.0, 0.5 / history.period_s], ends(&points)];
    (points, bounds)
}

fn ends(points: &[(f64, f64)]) -> [f64; 2] {
    let values = || points.iter().map(|(_, value)| *value);
    let [low, high] = [
        values().fold(f64::MAX, f64::min),
        values().fold(f64::MIN, f64::max),
    ];
    if low < high {
        [low, high]
    } else {
        [low - 1.0, low + 1.0]
    }
}

fn chart(frame: &mut Frame<'_>, area: Rect, points: &[(f64, f64)], [x, y]: [[f64; 2]; 2]) {
    let line = Dataset::default()
        .marker(Marker::Braille)
        .graph_type(GraphType::Line)
        .style(Style::new().fg(Color::Cyan))
        .data(points);
    let chart = Chart::new(vec![line])
        .x_axis(Axis::default().bounds(x))
        .y_axis(Axis::default().bounds(y));
    frame.render_widget(chart, area);
}

fn figures_of(facts: &Facts, codes: &[i32], unit: &str, warning: &str) -> Vec<Line<'static>> {
    let [low, high] = facts.range;
    let last = codes.last().copied().unwrap_or_default();
    let noise = facts
        .noise
        .map_or("-".to_owned(), |noise| format!("{noise:.3}"));
    let digits = usize::from(unit != "codes");
    vec![
        Line::from(format!(" {low:.digits$} .. {high:.digits$} {unit}")),
        Line::from(format!(" noise {noise} {unit}  code {last}")),
        Line::styled(format!(" {warning}"), WARNING),
    ]
}

fn strongest(points: &[(f64, f64)], unit: &str) -> Vec<Line<'static>> {
    let top = points.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let (hz, amplitude) = top.map_or((0.0, 0.0), |(hz, log)| (*hz, 10f64.powf(*log)));
    let last = points.last().map_or(0.0, |(hz, _)| *hz);
    vec![
        Line::from(format!(" to {last:.0} Hz, logarithmic")),
        Line::from(format!(" most {amplitude:.3} {unit} at {hz:.1} Hz")),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::history::tests::{empty, row};
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn screen(history: &History, choice: Choice) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).expect("in memory");
        terminal
            .draw(|frame| draw(frame, history, choice))
            .expect("in memory");
        let cells = terminal.backend().buffer().content();
        let line =
            |cells: &[ratatui::buffer::Cell]| cells.iter().map(|cell| cell.symbol()).collect();
        cells.chunks(80).map(line).collect()
    }

    #[test]
    fn six_traces_fit_into_80_by_24_and_name_what_is_wrong() {
        let mut history = empty();
        history.state = "good".to_owned();
        (0..4_000).for_each(|k| history.push(row(k, |[a, b, c]| [-a, (4.0 * b).min(10_000.0), c])));
        let lines = screen(&history, Choice::default());
        let has = |text: &str| lines.iter().filter(|line| line.contains(text)).count();
        assert_eq!((has("INVERTED"), has("AT A RAIL")), (1, 1), "{lines:#?}");
        for name in [
            "1 Hall A", "2 Hall B", "3 Hall C", "4 Gap 1", "5 Gap 2", "6 Gap 3",
        ] {
            assert_eq!(has(name), 1, "{lines:#?}");
        }
        assert!(
            lines[0].starts_with("run.csv  3.90 .. 8.00 s  4000 rows, 0 missing"),
            "{}",
            lines[0]
        );
        assert!(
            lines[22].starts_with("faults of sensors: 2  good") && lines[23].starts_with("q quit"),
            "{lines:#?}"
        );
        let drawn = |line: &&String| line.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c));
        assert!(lines.iter().filter(drawn).count() > 15, "{lines:#?}");
    }

    #[test]
    fn hidden_sensors_leave_room_and_a_spectrum_names_its_line() {
        let mut history = empty();
        (0..4_000).for_each(|k| history.push(row(k, |q| q)));
        let choice = Choice {
            shows_spectrum: true,
            is_hidden: [false, true, true, true, true, true],
        };
        let lines = screen(&history, choice);
        assert!(lines.iter().all(|line| !line.contains("Hall B")));
        assert!(
            lines.iter().any(|line| line.contains("at 1.0 Hz")),
            "{lines:#?}"
        );
        screen(&empty(), choice);
        let lines = screen(&empty(), Choice::default());
        assert!(lines[22].starts_with("no row yet"), "{lines:#?}");
    }
}
