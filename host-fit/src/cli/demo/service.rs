//! What calibrations are worth in service: other motions of the stage against its true pose.

use super::job::settings;
use crate::cli::error::HostError;
use crate::fit::{Fit, FitError, fit};
use crate::input::dataset::Dataset;
use crate::input::log::{ReadOptions, read_bytes};
use crate::input::shipped::{RUN_GZ, SERVICE_GZ};
use crate::input::stage::Stage;
use crate::judge::precision::largest_difference;
use crate::judge::statistics::PoseError;
use crate::judge::{Decoded, Zeros};
use crate::recalibrate::Known;
use runtime::{ModelKind, ParameterSet};
use std::fmt::Write;

/// Calibrations with their errors in service.
#[derive(Debug)]
pub(super) struct Service {
    /// Rows of the service log.
    rows: usize,
    /// What was fitted to what, and its errors.
    lines: Vec<(&'static str, PoseError)>,
    /// The field model as fitted to the run of 30 s.
    pub(super) field: ParameterSet,
    /// What is kept beside its blob.
    pub(super) known: Option<Known>,
    /// Largest difference of the target's `f32` from `f64` with that, m, m, rad.
    f32_difference: [f64; 3],
}

impl Service {
    /// Fits Model (31) and the field model to the run of 30 s and judges both beside `paper`,
    /// Model (31) as fitted to the paper's protocol, and beside the noise floor.
    ///
    /// # Errors
    /// [`HostError`] when a shipped log is refused, which tests rule out.
    pub(super) fn new(stage: &Stage, paper: &ParameterSet) -> Result<Self, HostError> {
        let read = |bytes: &[u8], name: &str| -> Result<Dataset, HostError> {
            Ok(read_bytes(bytes, name.as_ref(), stage, &ReadOptions::default())?.dataset)
        };
        let run = read(RUN_GZ, "run30.csv.gz")?;
        let service = read(SERVICE_GZ, "service.csv.gz")?;
        let fitted = |log: &Dataset, model| fit(log, stage, &settings(model));
        let of_run = fitted(&run, ModelKind::M31)?.set;
        let Fit {
            calibration,
            set: field,
            field: of_field,
            ..
        } = fitted(&run, ModelKind::Field)?;
        let constants = calibration.constants().map_err(FitError::Unusable)?;
        let f32_difference =
            largest_difference(&constants, &calibration.probes, &field.decoder(), &service);
        let of_service = fitted(&service, ModelKind::Field)?.set;
        let errors = |set| {
            Decoded::new(set, &service)
                .judge(&service, stage, Zeros::None)
                .errors
        };
        Ok(Self {
            rows: service.rows.len(),
            lines: vec![
                (
                    "Model (31), fitted to the paper's protocol of 114 s",
                    errors(paper),
                ),
                ("Model (31), fitted to the run of 30 s", errors(&of_run)),
                ("field model, fitted to the run of 30 s", errors(&field)),
                ("what the noise of the probes leaves", errors(&of_service)),
            ],
            field,
            known: of_field.as_ref().map(Known::of_fit),
            f32_difference,
        })
    }

    /// The table.
    pub(super) fn as_text(&self) -> String {
        let mut out = format!(
            "In service: {} rows of other motions of the same stage, all six axes moving, against its true pose.\n\
             The run of 30 s moves all six axes at once; no zero deviation is taken off; rms and peak\n  {:<52}{:>14}{:>16}{:>17}\n",
            self.rows, "", "X (um)", "Y (um)", "Rz (urad)"
        );
        for (what, error) in &self.lines {
            let _ = write!(out, "  {what:<52}");
            for axis in error.axes {
                let _ = write!(out, "{:>8.3}{:>8.3}", axis.rms * 1e6, axis.peak * 1e6);
            }
            out.push('\n');
        }
        let [x, y, rz] = self.f32_difference.map(|d| d * 1e9);
        let _ = writeln!(
            out,
            "f32 against f64 of the field model, largest over these rows: X {x:.3} nm, Y {y:.3} nm, Rz {rz:.3} nrad"
        );
        out
    }
}
