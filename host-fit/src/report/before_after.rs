//! The errors of a log before and after the fit, as the paper's Figs 10 to 12 and Tables 2, 4 and 8
//! set them side by side: designed values, Model (30), the model that was fitted.

use crate::fit::{Fit, calibration};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::statistics::PoseError;
use crate::judge::{Decoded, Zeros};
use crate::problem::Problem;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::solve::{Projection, Solver, SolverOptions};
use runtime::ModelKind;
use runtime::calibration::Origin;

/// The errors that one set of parameters leaves.
#[derive(Clone, Debug)]
pub(super) struct Errors {
    /// Which parameters, of which model.
    pub(super) title: String,
    /// By row, m, m, rad; `None` where there was no pose.
    pub(super) by_row: Vec<Option<[f64; 3]>>,
    /// rms and peak.
    pub(super) figures: PoseError,
}

impl Errors {
    /// With zero deviations refitted where the model has them. `None` where no decoder can be
    /// made, or where it decodes no row.
    fn of(model: &'static Model, parameters: &Parameters, log: (&Dataset, &Stage)) -> Option<Self> {
        let (dataset, stage) = log;
        let calibration = calibration(&dataset.rows, stage, model, parameters).ok()?;
        let set = calibration.prepare(&Origin::default()).ok()?;
        let decoded = Decoded::new(&set, dataset);
        let judgement = decoded.judge(dataset, stage, Zeros::of_model(model));
        (judgement.errors.rows > 0).then(|| Self {
            title: String::new(),
            by_row: decoded.errors_less(&judgement.zeros, dataset),
            figures: judgement.errors,
        })
    }
}

/// The errors before and after, as far as there are any, those of the fit last.
pub(super) fn before_after(dataset: &Dataset, stage: &Stage, fit: Option<&Fit>) -> Vec<Errors> {
    let designed = Errors::of(
        Model::of(ModelKind::M15),
        &Parameters::designed(stage),
        (dataset, stage),
    );
    let mut all: Vec<Errors> = Vec::new();
    all.extend(designed.map(|errors| Errors {
        title: "designed values, Model (15)".to_owned(),
        ..errors
    }));
    let fitted = fit.map(|fit| fit.model.kind);
    if fitted.is_none_or(|kind| matches!(kind, ModelKind::M31 | ModelKind::Field)) {
        all.extend(model_30(dataset, stage).map(|errors| Errors {
            title: "Model (30)".to_owned(),
            ..errors
        }));
    }
    all.extend(fit.map(|fit| Errors {
        title: fit.model.title(),
        by_row: fit.decoded.errors_less(&fit.judgement.zeros, dataset),
        figures: fit.judgement.errors,
    }));
    all
}

/// Model (30) by least squares on all rows.
fn model_30(dataset: &Dataset, stage: &Stage) -> Option<Errors> {
    let model = Model::of(ModelKind::M30);
    let rows: Vec<usize> = (0..dataset.rows.len()).collect();
    let problem = Problem::new(dataset, &rows, stage, model);
    let options = SolverOptions::new(Projection::Linear, 1);
    let solution = Solver::LeastSquares.solve(&problem, &options).ok()?;
    Errors::of(model, &solution.parameters, (dataset, stage))
}
