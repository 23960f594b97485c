//! A `stage.toml`: each number of one that is accepted lies in a range that makes sense.

#![no_main]

use host_fit::input::stage::Stage;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    match Stage::from_toml(text, Path::new("stage.toml")) {
        Ok(stage) => {
            assert!(stage.servo_period_s > 0.0 && stage.interferometer.y_baseline_m > 0.0);
            for scale in [stage.hall, stage.capacitive] {
                assert!(scale.m_per_count > 0.0 && scale.window.is_sound());
            }
            let places = stage.capacitive_probes_m.as_flattened();
            assert!(places.iter().all(|at| at.abs() <= 10.0));
        }
        // What is wrong, where, and what to do.
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("stage.toml:"), "{message}");
            assert!(
                message.contains([';', ',']) || message.contains("TOML"),
                "{message}"
            );
        }
    }
});
