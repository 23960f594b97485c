//! Logs of the paper's protocol: the share of predicted ranges for Model (31) that hold the true errors in
//! service, and the field model once the errors of the resets are declared.

use crate::common::{Twin, dataset, rms};
use crate::service;
use host_fit::calibration::diagnose::diagnose_log;
use host_fit::calibration::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::stage::Stage;
use host_fit::simulate::protocol::Protocol;
use host_fit::simulate::sensors::SensorErrors;

/// Prints a line for each of the two.
pub fn table(stage: &Stage, seeds: std::ops::Range<u64>) {
    let declared = Stage {
        reset_sd: Some(SensorErrors::USUAL.reset),
        ..stage.clone()
    };
    for (what, stage) in [("nothing declared", stage), ("resets declared", &declared)] {
        let (mut inside, mut axes, mut field, mut fits) = (0, 0, 0, 0);
        let (mut predicted, mut true_worst) = (0.0, [0.0, 0.0f64]);
        for seed in seeds.clone() {
            let twin = Twin::new(stage, seed);
            let log = twin.log(Protocol::Paper.run(stage.servo_period_s, seed));
            let service = dataset(&service(&twin), stage);
            let fitted = fit(&log, stage, &FitSettings::new(ModelChoice::Auto));
            let diagnosis = diagnose_log(&log, stage, fitted.as_ref());
            let (Ok(fitted), Some(expected)) = (fitted, diagnosis.predicted) else {
                println!("{what}: no fit of stage {seed}");
                continue;
            };
            let rms = rms(&fitted.set, &service, stage);
            let mut worst = 0.0f64;
            for (axis, rms) in rms.into_iter().enumerate() {
                let [low, high] = expected.range[axis];
                inside += usize::from((low..high).contains(&rms));
                axes += 1;
                worst = worst.max(rms * expected.ratio[axis] / expected.rms[axis]);
            }
            field += usize::from(fitted.model.name == "field");
            fits += 1;
            predicted += expected.worst_ratio();
            true_worst = [true_worst[0] + worst, true_worst[1].max(worst)];
        }
        let mean = |sum: f64| sum / f64::from(fits);
        println!(
            "paper's protocol, {what}: field model on {field} of {fits}; range holds the truth on {inside} of {axes} axes; worst axis \
             over the noise floor, mean: predicted {:.2}, true {:.2}; largest true {:.2}",
            mean(predicted),
            mean(true_worst[0]),
            true_worst[1]
        );
    }
}
