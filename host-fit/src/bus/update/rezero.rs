//! A re-zero: declares the servo off, takes the mean of a second at rest as zero, declares the servo on.

use super::UpdateError;
use super::talk::{Link, Talk};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::Key;

/// How long the servo is declared off, s: longer than a re-zero takes.
const SERVO_OFF_S: u8 = 15;

/// The settings of a re-zero.
#[derive(Clone, Debug, Default)]
pub struct RezeroSettings {
    /// The stage's key.
    pub key: Option<Key>,
    /// Declare the servo off meanwhile.
    pub declares_servo_off: bool,
    /// Clear the zero instead of setting it.
    pub clears: bool,
}

/// Sets the zero of a stage at rest, or clears it.
///
/// # Errors
/// [`UpdateError::ServoOn`], [`UpdateError::NotAtRest`] with the reason that the node gives, and the errors of
/// [`Talk::exchange_tagged`].
pub fn rezero<L: Link>(talk: &mut Talk<L>, zero: &RezeroSettings) -> Result<(), UpdateError> {
    let seconds = SERVO_OFF_S;
    if zero.declares_servo_off {
        let off = Request::ServoOff { seconds };
        done(talk.exchange_tagged(zero.key.as_ref(), off)?, true)?;
    }
    let request = match zero.clears {
        true => Request::ClearZero,
        false => Request::Rezero { ticks: 0 },
    };
    let answer = talk.exchange_tagged(zero.key.as_ref(), request);
    if zero.declares_servo_off {
        // The declaration also expires by itself.
        let _ = talk.exchange(Request::ServoOff { seconds: 0 });
    }
    done(answer?, zero.declares_servo_off)
}

fn done((outcome, detail): (Outcome, u32), declared: bool) -> Result<(), UpdateError> {
    match outcome {
        Outcome::Done => Ok(()),
        outcome => Err(UpdateError::from_outcome(outcome, detail, declared)),
    }
}
