//! The cost of bad rows in service for each `--loss`: rms errors against the truth over the errors of the fit
//! to the clean log, worst of X, Y, Rz.
//!
//! `cargo bench -p host-fit --bench robust`: a minute.

mod common;

use common::{Axes, Fallible, read, rms};
use host_fit::calibration::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::dataset::Dataset;
use host_fit::input::shipped::{self, LOG_GZ, RUN_GZ, SERVICE_GZ};
use host_fit::input::stage::Stage;
use host_fit::solver::estimator::model::Model;
use host_fit::solver::estimator::robust::Loss;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use runtime::ModelKind;
use std::io::Read;

/// Columns of the shipped logs.
const BEAMS: [usize; 3] = [2, 3, 4];
const HALL: [usize; 3] = [8, 9, 10];
const NM_PER_UM: i64 = 1000;
const CODES_PER_UM: i64 = 16;

/// Faults of a log.
const FAULTS: [&str; 7] = [
    "nothing",
    "1 % of rows 50 um off, a beam",
    "1 % of rows 50 um off, a Hall channel",
    "ten rows 50 um off, a beam",
    "X off by 10 um, up to 2 s",
    "reference stuck, up to 2 s",
    "Hall A flat in 4 % of the rows",
];

fn main() -> Fallible<()> {
    let stage = shipped::stage();
    let service = read(SERVICE_GZ, &stage)?;
    println!("| log, model | fault | none | huber | cauchy |\n|---|---|---|---|---|");
    for (name, log, kind) in [
        ("run of 30 s, field", RUN_GZ, ModelKind::Field),
        ("paper, (31)", LOG_GZ, ModelKind::M31),
    ] {
        let rows = unzipped(log)?;
        let mut clean = None;
        for (fault, title) in FAULTS.into_iter().enumerate() {
            let log = read(with_fault(&rows, fault).as_bytes(), &stage)?;
            print!("| {name} | {title} |");
            for loss in [Loss::None, Loss::Huber, Loss::Cauchy] {
                match rms_in_service(&log, &service, &stage, kind, loss) {
                    Ok(rms) => {
                        let clean = clean.get_or_insert(rms);
                        let worst = (0..3).map(|k| rms[k] / clean[k]).fold(0.0, f64::max);
                        print!(" {worst:.3} |");
                    }
                    Err(_) => print!(" refused |"),
                }
            }
            println!();
        }
    }
    Ok(())
}

fn rms_in_service(
    log: &Dataset,
    service: &Dataset,
    stage: &Stage,
    kind: ModelKind,
    loss: Loss,
) -> Fallible<Axes> {
    let settings = FitSettings {
        loss,
        ..FitSettings::new(ModelChoice::Named(Model::from_kind(kind)))
    };
    Ok(rms(&fit(log, stage, &settings)?.set, service, stage))
}

/// A log with one of the faults; every call gives the same log.
fn with_fault(log: &str, fault: usize) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (header, rows) = log.split_once('\n').unwrap_or_default();
    let cells = |row: &str| {
        row.split(',')
            .filter_map(|cell| cell.parse().ok())
            .collect()
    };
    let mut rows: Vec<Vec<i64>> = rows.lines().map(cells).collect();
    let count = rows.len();
    let jumps = match fault {
        1 | 2 => count / 100,
        3 => 10,
        _ => 0,
    };
    for _ in 0..jumps {
        let (columns, um) = if fault == 2 {
            (HALL, CODES_PER_UM)
        } else {
            (BEAMS, NM_PER_UM)
        };
        let jump = if random.random::<bool>() { 50 } else { -50 };
        rows[random.random_range(0..count)][columns[random.random_range(0..3)]] += jump * um;
    }
    // A movement of 2 s, or as long in the middle of a longer one.
    let middle = count / 2..(count / 2 + 1000).min(count);
    let (movement, held) = (rows[middle.start][0], rows[middle.start].clone());
    for row in &mut rows[middle] {
        match fault {
            4 if row[0] == movement => row[BEAMS[0]] += 10 * NM_PER_UM,
            5 if row[0] == movement => row[2..5].copy_from_slice(&held[2..5]),
            _ => {}
        }
    }
    if fault == 6 {
        let mut sorted: Vec<i64> = rows.iter().map(|row| row[HALL[0]]).collect();
        sorted.sort_unstable();
        let (low, high) = (sorted[count / 50], sorted[count - 1 - count / 50]);
        for row in &mut rows {
            row[HALL[0]] = row[HALL[0]].clamp(low, high);
        }
    }
    let line = |row: Vec<i64>| {
        let cells: Vec<String> = row.iter().map(ToString::to_string).collect();
        cells.join(",") + "\n"
    };
    header.to_owned() + "\n" + &rows.into_iter().map(line).collect::<String>()
}

fn unzipped(log: &[u8]) -> Fallible<String> {
    let mut text = String::new();
    flate2::read::GzDecoder::new(log).read_to_string(&mut text)?;
    Ok(text)
}
