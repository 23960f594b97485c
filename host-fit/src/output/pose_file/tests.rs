use super::read::parse;
use super::*;
use crate::input::dataset::{Movement, Row};
use proptest::prelude::*;
use runtime::calibration::Origin;
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeGeometry;
use runtime::model::{ModelKind, Probes, Sensitivity};
use runtime::{AnyDecoder, Calibration, PlanarPose, Pose, RawFrame, Status, VerticalPose};
use std::path::Path;

fn decoder() -> AnyDecoder {
    let probe = |eta, a, b, c| Sensitivity {
        eta,
        per_z_m: a,
        per_rx_rad: b,
        per_ry_rad: c,
    };
    let window = CodeWindow {
        low: -32767,
        high: 32766,
    };
    let calibration = Calibration {
        model: ModelKind::M31,
        geometry: ProbeGeometry {
            lever_arm_m: [0.2, -0.19, -0.36],
            misalignment_rad: [0.01, -0.02, 0.03],
        },
        probes: Probes::Linear([
            probe(0.88, -300.0, -120.0, 60.0),
            probe(0.75, -280.0, -110.0, -50.0),
            probe(0.82, -310.0, -100.0, 55.0),
        ]),
        hall_m_per_code: 6.25e-8,
        hall_window: window,
        capacitive_probes_m: [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]],
        capacitive_m_per_code: 1.5625e-8,
        capacitive_window: window,
        calibrated_planar: [0.01; 3],
        calibrated_vertical: [3e-4; 3],
        sensitivity_min: Calibration::SENSITIVITY_MIN,
    };
    let set = calibration.prepare(&Origin::default()).expect("sound");
    set.decoder()
}

/// Movements of these rows: Hall code of A, and the sequence number.
fn dataset(movements: &[&[(i32, u32)]]) -> Dataset {
    let mut dataset = Dataset::default();
    for (slot, rows) in movements.iter().enumerate() {
        let start = dataset.rows.len();
        for (code, sequence) in rows.iter() {
            dataset.rows.push(Row {
                movement: slot,
                t_us: i64::from(*sequence) * 2000,
                frame: LoggedFrame::Codes(RawFrame {
                    hall: [*code, 200, -300],
                    capacitive: [40, 50, 60],
                    sequence: *sequence,
                    time_us: 0,
                }),
                signal_m: [0.0; 3],
                vertical: [0.0; 3],
                reference: [0.0; 3],
            });
        }
        dataset.movements.push(Movement {
            log: 0,
            index: 7 + slot as i64,
            rows: start..dataset.rows.len(),
        });
    }
    dataset
}

const SATURATED: i32 = 32767;

#[test]
fn a_saturated_row_is_held_for_so_many_ticks_and_never_into_the_next_movement() {
    let (decoder, good) = (decoder(), 1000);
    let bad = SATURATED;
    let dataset = dataset(&[
        &[(good, 0), (bad, 1), (bad, 2), (good, 3)],
        &[(bad, 0), (good, 1)],
    ]);
    let rows = decode(&dataset, &decoder, OnInvalid::Hold { ticks: 1 });
    let fault = Status::HALL_A.with(Status::PLANAR_INVALID);
    let statuses: Vec<_> = rows.iter().map(|row| row.reading.status).collect();
    assert_eq!(
        statuses,
        [
            Status::GOOD,
            fault.with(Status::PLANAR_HELD),
            fault,
            Status::GOOD,
            fault,
            Status::GOOD
        ]
    );
    assert_eq!(rows[1].reading.pose.planar, rows[0].reading.pose.planar);
    assert_eq!(rows[2].reading.pose.planar, PlanarPose::ZERO);
    assert_eq!((rows[0].movement, rows[4].movement), (7, 8));
    let counts = StatusCounts::of(&rows);
    assert_eq!((counts.rows, counts.good), (6, 3));
    let named: Vec<_> = counts.named().collect();
    assert_eq!(
        named,
        [
            ("Hall code A bad", 3),
            ("planar pose invalid", 3),
            ("planar pose held", 1)
        ]
    );
}

#[test]
fn without_hold_the_rows_are_the_decoders_own() {
    let decoder = decoder();
    let dataset = dataset(&[&[(-32767, 0), (5, 1), (SATURATED, 2), (32766, 4)]]);
    let rows = decode(&dataset, &decoder, OnInvalid::Zero);
    for (row, pose) in dataset.rows.iter().zip(&rows) {
        let reading = row.frame.decode(&decoder, &PlanarPose::ZERO);
        assert_eq!(pose.reading.pose, reading.pose);
        let missed = pose.reading.status.any(Status::FRAMES_MISSED);
        assert_eq!(missed, row.frame.sequence() == 4, "the gap shows");
    }
}

#[test]
fn a_vertical_pose_in_si_units_decodes_like_the_codes_that_it_came_from() {
    let decoder = decoder();
    let coded = dataset(&[&[(1000, 0), (SATURATED, 1), (2000, 2)]]);
    let mut known = coded.clone();
    for row in &mut known.rows {
        let vertical = row.frame.decode(&decoder, &PlanarPose::ZERO).pose.vertical;
        row.frame = LoggedFrame::HallCodes {
            hall: row.frame.hall(),
            vertical,
            sequence: row.frame.sequence(),
            time_us: 0,
        };
    }
    for on_invalid in [OnInvalid::Zero, OnInvalid::Hold { ticks: 3 }] {
        let want = decode(&coded, &decoder, on_invalid);
        assert_eq!(decode(&known, &decoder, on_invalid), want);
    }
}

#[test]
fn fields_are_positional_where_that_is_short() {
    let written = |word: f32| {
        let [x, y, z] = [word, 0.0, 0.0].map(f32::to_bits);
        let text = to_text(&[row([x, y, z, 0, 0, 0], 0, 0, 0)]);
        let text = String::from_utf8(text).expect("ASCII");
        let cell = text.lines().nth(1).and_then(|line| line.split(',').nth(2));
        cell.expect("a cell").to_owned()
    };
    assert_eq!(written(0.0), "0");
    assert_eq!(written(-0.0), "-0");
    assert_eq!(written(1.0), "1000000");
    assert_eq!(written(1000.0), "1e9");
    assert_eq!(written(-0.015625), "-15625");
    assert_eq!(written(0.001), "1000.00005");
    assert_eq!(written(1e-6), "0.999999997");
    assert_eq!(written(2f32.powi(-26)), "0.0149011612");
    assert_eq!(written(-2f32.powi(-40)), "-9.09494702e-7");
}

fn row(words: [u32; 6], status: u32, movement: i64, t_us: i64) -> PoseRow {
    let [x, y, rz, z, rx, ry] = words.map(f32::from_bits);
    PoseRow {
        movement,
        t_us,
        reading: Reading {
            pose: Pose {
                planar: PlanarPose::from_array([x, y, rz]),
                vertical: VerticalPose::from_array([z, rx, ry]),
            },
            status: Status::from_bits(status),
        },
    }
}

fn words(row: &PoseRow) -> Vec<u32> {
    let pose = row.reading.pose;
    let all = pose
        .planar
        .to_array()
        .into_iter()
        .chain(pose.vertical.to_array());
    all.map(f32::to_bits).collect()
}

/// The log that ships with the program, decoded into a file: its bytes and the counts.
fn decoded_file(on_invalid: OnInvalid, format: PoseFormat) -> (Vec<u8>, StatusCounts) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let stage = crate::input::stage::Stage::from_file(&data.join("stage.toml")).expect("sound");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("pose");
    let out = crate::output::streamed_file::StreamedFile::create(&path).expect("writable");
    let settings = DecodeSettings {
        decoder: &decoder(),
        on_invalid,
        posterior: None,
        format,
    };
    let log = data.join("paper.csv.gz");
    let decoded = decode_log::<Box<dyn std::error::Error>>(&log, &stage, &settings, out, || Ok(()));
    let (counts, end) = decoded.expect("sound");
    assert_eq!((end.skipped_rows, end.warnings), (0, Vec::new()));
    (std::fs::read(&path).expect("written"), counts)
}

#[test]
fn a_log_is_decoded_piece_by_piece_as_it_is_in_memory() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let stage = crate::input::stage::Stage::from_file(&data.join("stage.toml")).expect("sound");
    let logs = [data.join("paper.csv.gz")];
    let reading = crate::input::log::read(&logs, &stage, &crate::input::log::ReadOptions::DECODE)
        .expect("sound");
    for on_invalid in [OnInvalid::Zero, OnInvalid::Hold { ticks: 2 }] {
        let rows = decode(&reading.dataset, &decoder(), on_invalid);
        let (text, counts) = decoded_file(on_invalid, PoseFormat::Csv);
        assert!(text == to_text(&rows));
        assert_eq!(counts, StatusCounts::of(&rows));
        let (array, _) = decoded_file(on_invalid, PoseFormat::Npy);
        let header = npy::header(rows.len(), false);
        assert_eq!(header.len() % 64, 0);
        let (start, records) = array.split_at(header.len());
        assert!(start == header && start.starts_with(b"\x93NUMPY\x01\x00"));
        assert_eq!(
            usize::from(start[8]) + 256 * usize::from(start[9]) + 10,
            start.len()
        );
        assert!(String::from_utf8_lossy(start).contains("'shape': (57000,)"));
        let (records, rest) = records.as_chunks::<44>();
        assert_eq!((records.len(), rest.len()), (rows.len(), 0));
        for (record, row) in records.iter().zip(&rows) {
            let ([movement, t_us], _) = record[..16].as_chunks::<8>() else {
                panic!("two numbers of 8 bytes");
            };
            assert_eq!(i64::from_le_bytes(*movement), row.movement);
            assert_eq!(i64::from_le_bytes(*t_us), row.t_us);
            let (found, _) = record[16..].as_chunks::<4>();
            let found: Vec<u32> = found.iter().map(|word| u32::from_le_bytes(*word)).collect();
            assert_eq!(found[..6], words(row));
            assert_eq!(found[6], row.reading.status.bits());
        }
    }
}

/// Finite words: any of them, and those of a stage's range more often.
fn word() -> impl Strategy<Value = u32> {
    let any = any::<u32>().prop_filter("finite", |bits| f32::from_bits(*bits).is_finite());
    prop_oneof![any, (-1e-3f32..1e-3).prop_map(f32::to_bits)]
}

#[test]
fn every_row_of_the_log_that_ships_with_the_program_is_restored() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let stage = crate::input::stage::Stage::from_file(&data.join("stage.toml")).expect("sound");
    let logs = [data.join("paper.csv.gz")];
    let reading = crate::input::log::read(&logs, &stage, &crate::input::log::ReadOptions::DECODE)
        .expect("sound");
    let rows = decode(&reading.dataset, &decoder(), OnInvalid::Zero);
    let text = String::from_utf8(to_text(&rows)).expect("ASCII");
    let read = parse(&text, Path::new("x")).expect("own text");
    assert_eq!(read.len(), 57_000);
    for (read, written) in read.iter().zip(&rows) {
        assert_eq!(words(read), words(written));
        assert_eq!(read, written);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn reading_scaling_and_rounding_restores_every_word(words_in in prop::array::uniform6(word()), status: u32,
                                                        movement: i64, t_us: i64) {
        let written = row(words_in, status, movement, t_us);
        let text = to_text(&[written]);
        let read = parse(core::str::from_utf8(&text).expect("ASCII"), Path::new("x")).expect("own text");
        prop_assert_eq!(read.len(), 1);
        prop_assert_eq!(words(&read[0]), words_in.to_vec());
        prop_assert_eq!((read[0].movement, read[0].t_us, read[0].reading.status.bits()), (movement, t_us, status));
    }

    #[test]
    fn no_text_makes_the_reader_panic(tail in "[-0-9a-z,.\n]{0,200}") {
        let _ = parse(&format!("{HEADER}\n{tail}"), Path::new("x"));
        let _ = parse(&tail, Path::new("x"));
    }
}

#[test]
fn what_is_not_a_pose_file_is_refused_with_its_place() {
    let refused = |body: &str| parse(body, Path::new("p.csv")).expect_err("refused");
    let error = refused("movement,t_us\n");
    assert!(matches!(error, PoseFileError::NoHeader { .. }), "{error}");
    let error = refused(&format!("{HEADER}\n0,0,0,0,0,0,0,0,0\n0,0,0\n"));
    assert!(
        matches!(
            error,
            PoseFileError::CellCount {
                line: 3,
                found: 3,
                ..
            }
        ),
        "{error}"
    );
    for bad in ["NaN", "1e60", "", "x"] {
        let error = refused(&format!("{HEADER}\n0,0,0,0,{bad},0,0,0,0\n"));
        let at = matches!(
            error,
            PoseFileError::BadCell {
                line: 2,
                column: 5,
                name: "rz_urad",
                ..
            }
        );
        assert!(at, "{error}");
    }
}
