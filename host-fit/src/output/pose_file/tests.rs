use super::*;
use hallstage_input::dataset::Dataset;
use hallstage_input::watch::Watch;
use proptest::prelude::*;
use runtime::{
    AnyDecoder, MotionCorrection, OnInvalid, PlanarPose, Pose, PoseTracker, Status, VerticalPose,
};
use std::path::Path;

/// Runs the decoder over all rows as a controller would.
fn decode(dataset: &Dataset, decoder: &AnyDecoder, on_invalid: OnInvalid) -> Vec<PoseRow> {
    let mut tracker = PoseTracker::new(decoder, on_invalid);
    let mut poses = Vec::with_capacity(dataset.rows.len());
    for movement in &dataset.movements {
        tracker.forget();
        for row in &dataset.rows[movement.rows.clone()] {
            let frame = &row.frame;
            poses.push(PoseRow {
                movement: movement.index,
                t_us: row.t_us,
                reading: tracker.tick_with(frame.sequence(), |zero| frame.decode(decoder, zero)),
            });
        }
    }
    poses
}

fn to_text(rows: &[PoseRow]) -> Vec<u8> {
    let mut bytes = text::header(0);
    rows.iter().for_each(|row| text::line(&mut bytes, row, &[]));
    bytes
}

fn counted(rows: &[PoseRow]) -> StatusCounts {
    let mut counts = StatusCounts::default();
    rows.iter().for_each(|row| counts.add(row.reading.status));
    counts
}

/// The words and status of every line, as a reader of the file restores them.
fn parse(text: &[u8]) -> Vec<PoseRow> {
    let text = core::str::from_utf8(text).expect("ASCII");
    let row_of = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let words = [2, 3, 4, 5, 6, 7].map(|k: usize| {
            let micro: f64 = cells[k].parse().expect("a number");
            ((micro * 1e-6) as f32).to_bits()
        });
        let whole = |k: usize| cells[k].parse::<i64>().expect("a whole number");
        row(
            words,
            cells[8].parse().expect("a status"),
            whole(0),
            whole(1),
        )
    };
    assert_eq!(text.lines().next(), Some(HEADER));
    text.lines().skip(1).map(row_of).collect()
}

fn decoder() -> AnyDecoder {
    let blob = include_bytes!("../../../../runtime/examples/stage.bin");
    let set = runtime::ParameterSet::from_bytes(blob).expect("sound");
    set.decoder()
}

#[test]
fn a_saturated_row_is_held_for_so_many_ticks_and_never_into_the_next_movement() {
    let (good, bad) = (1000, 32767);
    let rows = [(7, 0, good), (7, 1, bad), (7, 2, bad), (7, 3, good)];
    let mut log =
        "movement,t_us,cap1_cnt,cap2_cnt,cap3_cnt,hall_a_cnt,hall_b_cnt,hall_c_cnt\n".to_owned();
    for (movement, tick, code) in rows.into_iter().chain([(8, 0, bad), (8, 1, good)]) {
        log += &format!("{movement},{},40,50,60,{code},200,-300\n", 2000 * tick);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv");
    std::fs::write(&path, log).expect("written");
    let hold = OnInvalid::Hold { ticks: 1 };
    let (text, counts) = decoded_file(&path, hold, PoseFormat::Csv);
    let rows = parse(&text);
    // Out of range too, which counts for nothing where there is no pose.
    let fault = Status::HALL_A
        .with(Status::PLANAR_INVALID)
        .with(Status::PLANAR_EXTRAPOLATED);
    let held = fault.with(Status::PLANAR_HELD);
    let statuses: Vec<_> = rows.iter().map(|row| row.reading.status).collect();
    let sound = Status::GOOD;
    assert_eq!(statuses, [sound, held, fault, sound, fault, sound]);
    assert_eq!(rows[1].reading.pose.planar, rows[0].reading.pose.planar);
    assert_eq!(rows[2].reading.pose.planar, PlanarPose::ZERO);
    assert_eq!((rows[0].movement, rows[4].movement), (7, 8));
    assert_eq!((counts.rows, counts.good), (6, 3));
    let named: Vec<_> = counts.named().collect();
    let want = [
        ("Hall code A bad", 3),
        ("planar pose invalid", 3),
        ("planar pose held", 1),
    ];
    assert_eq!(named, want);
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

/// A log decoded into a file: its bytes and the counts.
fn decoded_file(log: &Path, on_invalid: OnInvalid, format: PoseFormat) -> (Vec<u8>, StatusCounts) {
    decoded_with(log, &settings(&decoder(), on_invalid, format))
}

fn settings(decoder: &AnyDecoder, on_invalid: OnInvalid, format: PoseFormat) -> DecodeSettings<'_> {
    DecodeSettings {
        decoder,
        on_invalid,
        correction: None,
        known: None,
        format,
        watch: Watch::NONE,
    }
}

fn decoded_with(log: &Path, settings: &DecodeSettings<'_>) -> (Vec<u8>, StatusCounts) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let stage = hallstage_input::stage::Stage::from_file(&data.join("stage.toml")).expect("sound");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("pose");
    let out = crate::output::Output::create(&path).expect("writable");
    let decoded = decode_log::<Box<dyn std::error::Error>>(log, &stage, settings, out);
    let (counts, end) = decoded.expect("sound");
    assert_eq!((end.skipped_rows, end.warnings), (0, Vec::new()));
    (std::fs::read(&path).expect("written"), counts)
}

#[test]
fn a_log_is_decoded_piece_by_piece_as_it_is_in_memory() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    let stage = hallstage_input::stage::Stage::from_file(&data.join("stage.toml")).expect("sound");
    let logs = [data.join("paper.csv.gz")];
    let reading =
        hallstage_input::log::read(&logs, &stage, &hallstage_input::log::ReadOptions::DECODE)
            .expect("sound");
    for on_invalid in [OnInvalid::Zero, OnInvalid::Hold { ticks: 2 }] {
        let rows = decode(&reading.dataset, &decoder(), on_invalid);
        let (text, counts) = decoded_file(&logs[0], on_invalid, PoseFormat::Csv);
        assert!(text == to_text(&rows));
        let read = parse(&text);
        assert!(read == rows && read.iter().map(words).eq(rows.iter().map(words)));
        assert_eq!(counts, counted(&rows));
        let (array, _) = decoded_file(&logs[0], on_invalid, PoseFormat::Npy);
        let header = npy::header(rows.len(), 0);
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

#[test]
fn a_log_with_the_commanded_pose_is_corrected_at_every_row() {
    // One sine at 5 Hz: X commanded by 1 um, Z measured by 5000 codes. Rows wait in pieces.
    let (amplitude, per_s, rows) = (1e-6, 10.0 * std::f64::consts::PI, 9000);
    let mut log = "movement,t_us,cap1_cnt,cap2_cnt,cap3_cnt,hall_a_cnt,hall_b_cnt,hall_c_cnt,cmd_x_m,cmd_y_m,cmd_rz_rad\n".to_owned();
    for row in 0..rows {
        let t_s = 2e-3 * f64::from(row);
        let sine = (per_s * t_s).sin();
        // One row has a gap at the rail, which is no motion.
        let gap = if row == 777 {
            32767.0
        } else {
            (5000.0 * sine).round()
        };
        let x_m = amplitude * sine;
        log += &format!(
            "0,{},{gap},{gap},{gap},1000,200,-300,{x_m:e},0,0\n",
            2000 * row
        );
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv");
    std::fs::write(&path, log).expect("written");
    let mut correction = MotionCorrection::default();
    correction.velocity_s[0][0] = 0.1;
    [
        correction.acceleration_s2[1][0],
        correction.acceleration_s2[2][3],
    ] = [0.01; 2];
    let decoder = decoder();
    let planar = |correction| {
        let settings = DecodeSettings {
            correction,
            ..settings(&decoder, OnInvalid::Zero, PoseFormat::Csv)
        };
        let poses = parse(&decoded_with(&path, &settings).0);
        poses
            .into_iter()
            .map(|row| row.reading.pose.planar)
            .collect::<Vec<_>>()
    };
    let (corrected, plain) = (planar(Some(&correction)), planar(None));
    assert_eq!([corrected.len(), plain.len()], [rows as usize; 2]);
    let z_m = 5000.0 * hallstage_input::shipped::stage().capacitive.m_per_count;
    let per_s2 = per_s * per_s;
    let largest = [
        0.1 * amplitude * per_s,
        0.01 * amplitude * per_s2,
        0.01 * z_m * per_s2,
    ];
    for (row, (corrected, plain)) in corrected.iter().zip(&plain).enumerate() {
        // At the ends of the log one side is missing.
        if !(20..rows as usize - 20).contains(&row) || (776..=778).contains(&row) {
            continue;
        }
        let added = [
            corrected.x_m - plain.x_m,
            corrected.y_m - plain.y_m,
            corrected.rz_rad - plain.rz_rad,
        ];
        let phase = per_s * 2e-3 * row as f64;
        let parts = [phase.cos(), -phase.sin(), -phase.sin()];
        for axis in 0..3 {
            let off = f64::from(added[axis]) / largest[axis] - parts[axis];
            assert!(off.abs() < 0.02, "{row}: {added:?} {largest:?} {parts:?}");
        }
    }
}

/// Finite words, most of them within the range of a stage.
fn word() -> impl Strategy<Value = u32> {
    let any = any::<u32>().prop_filter("finite", |bits| f32::from_bits(*bits).is_finite());
    prop_oneof![any, (-1e-3f32..1e-3).prop_map(f32::to_bits)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn reading_scaling_and_rounding_restores_every_word(words_in in prop::array::uniform6(word()), status: u32,
                                                        movement: i64, t_us: i64) {
        let written = row(words_in, status, movement, t_us);
        let read = parse(&to_text(&[written]));
        prop_assert_eq!(read.len(), 1);
        prop_assert_eq!(words(&read[0]), words_in.to_vec());
        prop_assert_eq!((read[0].movement, read[0].t_us, read[0].reading.status.bits()), (movement, t_us, status));
    }
}
