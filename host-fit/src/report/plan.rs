//! The figures of a planned run: as JSON, and as tables for a terminal.

use crate::input::stage::{AXES, Stage};
use crate::plan::Plan;
use crate::problem::terms::shown;
use crate::solve::field::terms::{COUNT, PER_PROBE, TERMS, name};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What `plan` says of a run.
#[derive(Clone, Debug, Serialize)]
pub struct PlanReport {
    /// Length of the run, s.
    pub seconds: f64,
    /// Length of each end, s.
    pub taper_s: f64,
    /// Rows at the servo rate.
    pub rows: usize,
    /// X, Y, Rz, Z, Rx, Ry.
    pub axes: Vec<AxisReport>,
    /// What service has to expect.
    pub service: ServiceReport,
    /// The 81 parameters of the field model by name.
    pub parameters: BTreeMap<String, ParameterReport>,
    /// The parameters with a prior of which the log will tell least, the worst first.
    pub least_determined: Vec<String>,
}

/// One axis of a run; lengths in m, angles in rad.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct AxisReport {
    /// Its key in `[motion]`.
    pub axis: &'static str,
    /// m or rad.
    pub unit: &'static str,
    /// Amplitude.
    pub amplitude: f64,
    /// Largest magnitude in service.
    pub service: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Largest speed, per s.
    pub peak_speed: f64,
    /// Its limit, per s.
    pub speed_limit: f64,
    /// Largest acceleration, per s2.
    pub peak_acceleration: f64,
    /// Its limit, per s2.
    pub acceleration_limit: f64,
}

/// Errors predicted for service, rms over its whole range.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ServiceReport {
    /// X.
    pub x: Micrometres,
    /// Y.
    pub y: Micrometres,
    /// Rz.
    pub rz: Microradians,
}

/// A displacement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Micrometres {
    /// The error, um.
    pub rmse_um: f64,
    /// The part of it that comes from the noise of the probes, um.
    pub floor_um: f64,
    /// One over the other.
    pub ratio: f64,
}

/// A rotation.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Microradians {
    /// The error, urad.
    pub rmse_urad: f64,
    /// The part of it that comes from the noise of the probes, urad.
    pub floor_urad: f64,
    /// One over the other.
    pub ratio: f64,
}

/// One parameter.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ParameterReport {
    /// Standard error after a fit to the run.
    pub standard_error: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Standard error over the deviation of the prior; null without prior. 1: the log tells nothing.
    pub of_prior: Option<f64>,
}

/// How many parameters are named.
const NAMED: usize = 5;
/// The axes with the units of tables and plots.
pub(super) const LABELS: [&str; 6] = [
    "X (um)",
    "Y (um)",
    "Rz (urad)",
    "Z (um)",
    "Rx (urad)",
    "Ry (urad)",
];

impl PlanReport {
    /// The figures of a plan.
    pub fn new(plan: &Plan, stage: &Stage) -> Self {
        let run = &plan.run;
        let axes = AXES.iter().zip(&stage.motion.axes).enumerate();
        let axes = axes.map(|(k, ((key, _), motion))| {
            let [peak_speed, peak_acceleration] = run.peaks(k);
            AxisReport {
                axis: key,
                unit: if key.starts_with('r') { "rad" } else { "m" },
                amplitude: run.amplitudes[k],
                service: motion.service,
                frequency_hz: run.frequency_hz(k),
                peak_speed,
                speed_limit: motion.speed,
                peak_acceleration,
                acceleration_limit: motion.acceleration,
            }
        });
        let errors = plan.forecast.posterior.standard_errors();
        let of_prior = |k: usize| TERMS[k % PER_PROBE].prior.map(|prior| errors[k] / prior);
        let parameter = |k: usize| {
            let report = ParameterReport {
                standard_error: errors[k],
                unit: TERMS[k % PER_PROBE].unit,
                of_prior: of_prior(k),
            };
            (name(k), report)
        };
        let mut worst: Vec<(f64, usize)> =
            (0..COUNT).filter_map(|k| Some((of_prior(k)?, k))).collect();
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self {
            seconds: run.seconds,
            taper_s: run.taper_s,
            rows: run.rows(stage.servo_period_s),
            axes: axes.collect(),
            service: service(plan),
            parameters: (0..COUNT).map(parameter).collect(),
            least_determined: worst.iter().take(NAMED).map(|&(_, k)| name(k)).collect(),
        }
    }

    /// Errors predicted for service: label, rms, floor, ratio of X, Y (um) and Rz (urad).
    pub fn service_rows(&self) -> [(&'static str, f64, f64, f64); 3] {
        let ServiceReport { x, y, rz } = self.service;
        [
            (LABELS[0], x.rmse_um, x.floor_um, x.ratio),
            (LABELS[1], y.rmse_um, y.floor_um, y.ratio),
            (LABELS[2], rz.rmse_urad, rz.floor_urad, rz.ratio),
        ]
    }

    /// The tables for a terminal.
    pub fn text(&self) -> String {
        let mut out = format!(
            "run of {} s: one movement, {} rows, ends of {} s\n\n  {:<11}{:>10}{:>10}{:>10}{:>18}{:>22}\n",
            self.seconds,
            self.rows,
            self.taper_s,
            "",
            "amplitude",
            "service",
            "Hz",
            "speed (limit)",
            "acceleration (limit)"
        );
        for (label, a) in LABELS.iter().zip(&self.axes) {
            let micro = |x: f64| x * 1e6;
            let _ = writeln!(
                out,
                "  {label:<11}{:>10.1}{:>10.1}{:>10.3}{:>9.0} ({:>6.0}){:>13.0} ({:>6.0})",
                micro(a.amplitude),
                micro(a.service),
                a.frequency_hz,
                micro(a.peak_speed),
                micro(a.speed_limit),
                micro(a.peak_acceleration),
                micro(a.acceleration_limit)
            );
        }
        let _ = writeln!(
            out,
            "\n  predicted for service\n  {:<11}{:>10}{:>10}{:>10}",
            "", "error rms", "floor", "ratio"
        );
        for (label, rms, floor, ratio) in self.service_rows() {
            let _ = writeln!(out, "  {label:<11}{rms:>10.3}{floor:>10.3}{ratio:>10.4}");
        }
        let _ = writeln!(
            out,
            "\n  {:<14}{:>11}{:>11}{:>11}  unit",
            "std. errors", "A", "B", "C"
        );
        for (k, term) in TERMS.iter().enumerate() {
            let _ = write!(out, "  {:<14}", term.name);
            let (scale, unit) = shown(1.0, term.unit);
            for probe in 0..3 {
                let error = self.parameters[&name(probe * PER_PROBE + k)].standard_error;
                let _ = write!(out, "{:>11.1e}", error * scale);
            }
            let _ = writeln!(out, "  {unit}");
        }
        out.push_str("\n  least determined:");
        for (k, name) in self.least_determined.iter().enumerate() {
            let share = self.parameters[name].of_prior.unwrap_or(1.0);
            let comma = if k == 0 { "" } else { "," };
            let _ = write!(out, "{comma} {name} ({share:.2} of its prior)");
        }
        out.push('\n');
        out
    }
}

fn service(plan: &Plan) -> ServiceReport {
    let service = &plan.forecast.service;
    let ratios = service.ratios();
    let floor = service.noise.map(|variance| variance.sqrt() * 1e6);
    let linear = |k: usize| Micrometres {
        rmse_um: ratios[k] * floor[k],
        floor_um: floor[k],
        ratio: ratios[k],
    };
    ServiceReport {
        x: linear(0),
        y: linear(1),
        rz: Microradians {
            rmse_urad: ratios[2] * floor[2],
            floor_urad: floor[2],
            ratio: ratios[2],
        },
    }
}
