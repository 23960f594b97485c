//! Ticks beside the reference: rows of a fit, and what the designed probes explain of the signals.

use super::{Clocks, EXPLAINED_MIN, Records};
use crate::join::JoinError;
use crate::join::node_clock::Tick;
use crate::join::pairing::{ReferenceAt, at};
use hallstage_input::log::layout::Quantity;
use hallstage_solver::estimator::rows::{FieldRow, Rows};
use nalgebra::Vector3;

/// A tick with its reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferencedTick {
    pub(super) tick: Tick,
    pub(super) movement: i64,
    /// X, Y, Rz: m, m, rad.
    pub(super) pose: [f64; 3],
}

impl Records<'_> {
    /// The rows of the fit, with the speed of the reference.
    pub(super) fn field_rows(&self, rows: &[ReferencedTick], clocks: &Clocks) -> Rows {
        let hall_m = self.stage.hall.m_per_count;
        let mut used = Vec::with_capacity(rows.len());
        let mut movements = Vec::new();
        for movement in rows.chunk_by(|a, b| a.movement == b.movement) {
            let first = used.len();
            used.extend(movement.iter().filter_map(|row| {
                let t_us = clocks.on_reference_us(row.tick.t_us);
                let half_us = self.period_us / 2.0;
                let vertical = self.vertical(&row.tick);
                let at = |t_us| self.at(t_us, vertical);
                let (before, after) = (at(t_us - half_us)?, at(t_us + half_us)?);
                let change = |k: usize| (after.1[k] - before.1[k]) * 1e6 / self.period_us;
                let rate = |k: usize| if k < 3 { change(k) } else { 0.0 };
                (before.0 == after.0).then(|| FieldRow {
                    temperature_k: [[0.0; 2]; 3],
                    time_s: 1e-6 * (row.tick.t_us - clocks.middle_us),
                    signal_m: row
                        .tick
                        .frame
                        .codes
                        .hall
                        .map(|code| hall_m * f64::from(code)),
                    vertical,
                    reference: row.pose,
                    rate: std::array::from_fn(rate),
                    acceleration_m_s2: [0.0; 6],
                    weight: 1.0,
                })
            }));
            if used.len() > first {
                movements.push(first..used.len());
            }
        }
        Rows::from_movements(used, movements)
    }

    /// The ticks that have a reference.
    pub(super) fn rows(&self, ticks: &[Tick], clocks: &Clocks) -> Vec<ReferencedTick> {
        let row = |tick: &Tick| {
            let (movement, pose) =
                self.at(clocks.on_reference_us(tick.t_us), self.vertical(tick))?;
            Some(ReferencedTick {
                tick: *tick,
                movement,
                pose,
            })
        };
        ticks.iter().filter_map(row).collect()
    }

    /// Z, Rx, Ry of a tick: m, rad, rad.
    fn vertical(&self, tick: &Tick) -> [f64; 3] {
        let gaps = tick.frame.codes.capacitive;
        let gaps_m = gaps.map(|code| f64::from(code) * self.stage.capacitive.m_per_count);
        let logged = tick
            .frame
            .vertical
            .map(|pose| pose.to_array().map(f64::from));
        logged.unwrap_or_else(|| (self.per_gap * Vector3::from(gaps_m)).into())
    }

    /// Movement and pose at a time of the reference, with this vertical pose.
    fn at(&self, t_us: f64, vertical: [f64; 3]) -> Option<(i64, [f64; 3])> {
        let ReferenceAt::Found {
            movement, values, ..
        } = at(self.samples, t_us, 4.0 * self.longer_us)
        else {
            return None;
        };
        let values = [0, 1, 2].map(|k| values[k] * self.scale[k]);
        let pose = match self.quantities == Quantity::BEAMS {
            true => self.stage.interferometer.pose(values, vertical),
            false => values,
        };
        Some((movement, pose))
    }

    /// What the designed probes explain of the signals' motion, each with a factor for all rows and a
    /// constant for each movement, and that motion; codes squared.
    pub(super) fn explained(&self, rows: &[ReferencedTick]) -> [f64; 2] {
        self.sums(rows)
            .iter()
            .fold([0.0; 2], |[explained, motion], [ss, sp, pp]| {
                // A probe that reads against its designed sense explains nothing.
                let is_sound = *sp > 0.0 && *pp > 0.0;
                let own = if is_sound { sp * sp / pp } else { 0.0 };
                [explained + own, motion + ss]
            })
    }

    /// The motion of each signal, its product with the motion of the designed probe, and the motion of the probe:
    /// codes squared, codes m, m squared.
    pub(super) fn sums(&self, rows: &[ReferencedTick]) -> [[f64; 3]; 3] {
        let mut sums = [[0.0; 3]; 3];
        for movement in rows.chunk_by(|a, b| a.movement == b.movement) {
            for (k, [ss, sp, pp]) in sums.iter_mut().enumerate() {
                let n = movement.len() as f64;
                let pair = |row: &ReferencedTick| {
                    let read = self.plane * Vector3::from(row.pose);
                    [f64::from(row.tick.frame.codes.hall[k]), read[k]]
                };
                let [signal, probe] =
                    [0, 1].map(|i| movement.iter().map(|row| pair(row)[i]).sum::<f64>() / n);
                for row in movement {
                    let [s, p] = pair(row);
                    let (s, p) = (s - signal, p - probe);
                    *ss += s * s;
                    *sp += s * p;
                    *pp += p * p;
                }
            }
        }
        sums
    }

    /// The share of the motion that is explained, if it is enough.
    pub(super) fn share(&self, rows: &[ReferencedTick]) -> Result<f64, JoinError> {
        let [explained, motion] = self.explained(rows);
        match explained / motion {
            share if share >= EXPLAINED_MIN => Ok(share),
            share => Err(self.no_offset(share.max(0.0))),
        }
    }
}
