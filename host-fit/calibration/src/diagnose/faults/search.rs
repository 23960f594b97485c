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
/// The most likely faults that are tried where others explain too little.
const TRIES_MAX: usize = 4;

impl Finder<'_> {
    /// The faults, and the estimate with the faults among its unknowns, if there are any.
    pub(super) fn search(&self, faultless: &Estimate) -> (Vec<Fault>, Option<Estimate>) {
        let (mut faults, mut last): (Vec<Fault>, Option<Estimate>) = (Vec::new(), None);
        while faults.len() < FAULTS_MAX {
            let estimate = last.as_ref().unwrap_or(faultless);
            let Some(found) = self.ranked(estimate, &faults) else {
                break;
            };
            let likely = found
                .iter()
                .filter(|fault| fault.gain > self.needs(fault, &faults));
            let mut explained = likely.take(TRIES_MAX).filter_map(|fault| {
                let with = [&faults[..], std::slice::from_ref(fault)].concat();
                // A large fault bends the effects of the others, too.
                let next = self.refitted(estimate, &with)?;
                let next = self.refitted(&next, &with)?;
                let gain = estimate.chi_squared - next.chi_squared;
                let least = self.needs(fault, &faults) * misfit(&self.means, &next);
                (gain > least).then_some((fault, next))
            });
            let Some((best, next)) = explained.next() else {
                break;
            };
            if self.is_noise(best, [estimate, &next]) {
                break;
            }
            let alike = self.alike(best, &found, misfit(&self.means, &next));
            faults.push(Fault {
                alike,
                ..best.clone()
            });
            last = Some(next);
        }
        (faults, last)
    }

    /// Whether accelerations explain too little: noise of a beam makes some of its own.
    fn is_noise(&self, fault: &Fault, [before, after]: [&Estimate; 2]) -> bool {
        let makes_noise = matches!(
            fault.suspect.follows,
            Follows::Acceleration(_) | Follows::OwnAcceleration
        );
        let is_noise = || makes_noise || noisy_beam(&self.effects(before), before).is_some();
        let left = after.chi_squared - self.means.freedom();
        before.chi_squared - after.chi_squared <= left && is_noise()
    }

    /// Further faults, the most likely first.
    fn ranked(&self, estimate: &Estimate, faults: &[Fault]) -> Option<Vec<Fault>> {
        // Other models lack terms, and are not for service.
        let with_motion = self.calibrated.is_for_service;
        let (effects, misfit) = (self.effects(estimate), misfit(&self.means, estimate));
        let mut found = Scan::new(&effects, estimate)?.faults(with_motion);
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
