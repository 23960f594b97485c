//! The faults of a log, one after the other as long as they explain more than chance.

use super::estimate::Estimate;
use super::motion::Follows;
use super::score::{Fault, Scan};
use super::slow::{misfit, noisy_beam};
use super::{FAULTS_MAX, Finder};
use crate::diagnose::limits::UNDECIDED;
use hallstage_input::channel::Channel;

/// Causes are undecided where their gains differ by less than this part: large faults are not quite linear.
const ALIKE_PART: f64 = 0.01;

impl Finder<'_> {
    /// The faults, and the estimate with the faults among its unknowns; `None` where there are no faults.
    pub(super) fn search(&self, faultless: &Estimate) -> Option<(Vec<Fault>, Option<Estimate>)> {
        let (mut faults, mut last): (Vec<Fault>, Option<Estimate>) = (Vec::new(), None);
        while faults.len() < FAULTS_MAX {
            let estimate = last.as_ref().unwrap_or(faultless);
            let found = self.ranked(estimate, &faults)?;
            let needs = |fault: &Fault| self.needs(fault, &faults);
            let Some(best) = found.first().filter(|best| best.gain > needs(best)) else {
                break;
            };
            let needs = needs(best);
            let with = [&faults[..], std::slice::from_ref(best)].concat();
            // A large fault bends the effects of the others, too.
            let next = self.refitted(estimate, &with);
            let next = next.and_then(|next| self.refitted(&next, &with));
            // It explains more than what remains, and most of the noise of a beam, which makes accelerations of its own.
            let follows = best.suspect.follows;
            let explains = |next: &Estimate| {
                let (before, after) = (estimate.chi_squared, next.chi_squared);
                let is_noise = || {
                    matches!(follows, Follows::Acceleration(_) | Follows::OwnAcceleration)
                        || noisy_beam(&self.effects(estimate), estimate).is_some()
                };
                before - after > needs * misfit(&self.means, next)
                    && (before - after > after - self.means.freedom() || !is_noise())
            };
            let Some(next) = next.filter(explains) else {
                break;
            };
            let alike = self.alike(best, &found, misfit(&self.means, &next));
            faults.push(Fault {
                alike,
                ..best.clone()
            });
            last = Some(next);
        }
        Some((faults, last))
    }

    /// Further faults, the most likely first.
    fn ranked(&self, estimate: &Estimate, faults: &[Fault]) -> Option<Vec<Fault>> {
        // Other models lack terms, and are not for service.
        let with_motion = self.calibrated.is_for_service;
        let (effects, misfit) = (self.effects(estimate), misfit(&self.means, estimate));
        let mut found = Scan::new(&effects, estimate, faults, misfit)?.faults(with_motion);
        if let Some(beam) = noisy_beam(&effects, estimate) {
            found.retain(|fault| fault.suspect.channels() == (beam..beam + 1));
        }
        let value = |fault: &Fault| {
            // The dearer of two causes is charged: in service there are no beams.
            let is_cheap = fault.suspect.is_beam() && fault.suspect.quantity().is_none();
            let less = if is_cheap { UNDECIDED } else { 0.0 };
            fault.gain / misfit - self.needs(fault, faults) - less
        };
        found.sort_by(|a, b| value(b).total_cmp(&value(a)));
        Some(found)
    }

    /// The gain that a fault needs beside others. A fault is rare, but not one more of the same channels or from the same
    /// mean on.
    pub(super) fn needs(&self, fault: &Fault, others: &[Fault]) -> f64 {
        let of_channel = |channel: usize| {
            let mut others = others.iter();
            others.any(|other| other.suspect.channels().contains(&channel))
        };
        let is_same = fault.suspect.channels().all(of_channel);
        let onset = fault.shape.onset();
        let is_same_time = onset.is_some() && others.iter().any(|of| of.shape.onset() == onset);
        let is_rare = !is_same && !is_same_time;
        (self.means).per_fault(onset.is_some() && !is_same_time, is_rare)
    }

    /// The channels of other causes that explain the log as well as the best.
    fn alike(&self, best: &Fault, found: &[Fault], misfit: f64) -> Vec<Channel> {
        let near = best.gain - f64::max(UNDECIDED * misfit, ALIKE_PART * best.gain);
        let others = found.iter().filter(|other| other.gain > near);
        let mut alike: Vec<Channel> = others.map(|other| other.suspect.channel()).collect();
        alike.retain(|channel| *channel != best.suspect.channel());
        // Several shapes of one channel may explain the log.
        alike.sort_unstable();
        alike.dedup();
        alike
    }
}
