//! The terminal of a scope, and its keys. The terminal is as before when the scope ends, whatever ends it.

use super::history::History;
use super::view::{self, Choice};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::io;
use std::time::Duration;

/// What the user wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// To go on.
    GoOn,
    /// To end.
    Quit,
}

/// An open terminal.
pub struct Screen {
    terminal: DefaultTerminal,
    choice: Choice,
}

impl Screen {
    /// Takes the terminal.
    ///
    /// # Errors
    /// The terminal cannot be used.
    pub fn open() -> io::Result<Self> {
        Ok(Self {
            terminal: ratatui::try_init()?,
            choice: Choice::default(),
        })
    }

    /// Draws the rows so far.
    ///
    /// # Errors
    /// The terminal cannot be written.
    pub fn draw(&mut self, history: &History) -> io::Result<()> {
        let choice = self.choice;
        self.terminal
            .draw(|frame| view::draw(frame, history, choice))?;
        Ok(())
    }

    /// Takes the keys that were pressed, and waits for the first of them at most this long.
    ///
    /// # Errors
    /// The terminal cannot be read.
    pub fn keys(&mut self, history: &mut History, wait: Duration) -> io::Result<Wish> {
        let mut wait = wait;
        while event::poll(wait)? {
            wait = Duration::ZERO;
            if let Event::Key(key) = event::read()?
                && key.kind == KeyEventKind::Press
                && press(&mut self.choice, history, key) == Wish::Quit
            {
                return Ok(Wish::Quit);
            }
        }
        Ok(Wish::GoOn)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

fn press(choice: &mut Choice, history: &mut History, key: KeyEvent) -> Wish {
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Wish::Quit,
        KeyCode::Char('q') | KeyCode::Esc => return Wish::Quit,
        KeyCode::Char(' ') if history.is_frozen => history.follow(),
        KeyCode::Char(' ') => history.is_frozen = true,
        KeyCode::Char('s') => choice.shows_spectrum = !choice.shows_spectrum,
        KeyCode::Char('+') => history.zoom(false),
        KeyCode::Char('-') => history.zoom(true),
        KeyCode::Left | KeyCode::Char('<') => {
            history.is_frozen = true;
            history.move_by(-1);
        }
        KeyCode::Right | KeyCode::Char('>') => history.move_by(1),
        KeyCode::Char(digit) => {
            let sensor = digit.to_digit(10).and_then(|sensor| sensor.checked_sub(1));
            if let Some(hidden) =
                sensor.and_then(|sensor| choice.is_hidden.get_mut(sensor as usize))
            {
                *hidden = !*hidden;
            }
        }
        _ => {}
    }
    Wish::GoOn
}

#[cfg(test)]
mod tests {
    use super::super::history::tests::{empty, row};
    use super::*;

    #[test]
    fn keys_freeze_move_hide_and_quit() {
        let (mut choice, mut history) = (Choice::default(), empty());
        (0..5_000).for_each(|k| history.push(row(k, |q| q)));
        let typed = |choice: &mut Choice, history: &mut History, key: char| {
            press(choice, history, KeyEvent::from(KeyCode::Char(key)))
        };
        for key in "<2s".chars() {
            assert_eq!(typed(&mut choice, &mut history, key), Wish::GoOn);
        }
        assert!(history.is_frozen && choice.shows_spectrum);
        assert_eq!(choice.is_hidden, [false, true, false, false, false, false]);
        for key in " 2s79\u{e9}".chars() {
            assert_eq!(typed(&mut choice, &mut history, key), Wish::GoOn);
        }
        assert!(!history.is_frozen && choice == Choice::default());
        assert_eq!(typed(&mut choice, &mut history, 'q'), Wish::Quit);
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(press(&mut choice, &mut history, ctrl_c), Wish::Quit);
    }
}
