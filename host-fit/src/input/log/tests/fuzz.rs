use super::*;
use proptest::prelude::*;

/// Reads in every way; the answer does not matter, but a refusal must name a remedy.
fn read_all_ways(bytes: &[u8]) -> Result<(), TestCaseError> {
    for options in [
        ReadOptions::default(),
        ReadOptions::DECODE,
        ReadOptions {
            bad_rows: BadRows::Skip,
            ..ReadOptions::default()
        },
    ] {
        match read_bytes(bytes, Path::new("log"), stage(), &options) {
            Ok(LogReading { dataset, .. }) => {
                let covered: usize = dataset.movements.iter().map(|m| m.rows.len()).sum();
                prop_assert_eq!(covered, dataset.rows.len());
                for (slot, movement) in dataset.movements.iter().enumerate() {
                    let rows = &dataset.rows[movement.rows.clone()];
                    prop_assert!(rows.iter().all(|row| row.movement == slot));
                    prop_assert!(rows.windows(2).all(|pair| pair[0].t_us < pair[1].t_us));
                }
                let finite = |row: &Row| {
                    [row.signal_m, row.vertical, row.reference]
                        .concat()
                        .iter()
                        .all(|x| x.is_finite())
                };
                prop_assert!(dataset.rows.iter().all(finite));
            }
            Err(error) => prop_assert!(error.to_string().contains("; "), "{}", error),
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read_all_ways(&bytes)?;
        read_all_ways(&[&[0x1f, 0x8b], bytes.as_slice()].concat())?;
        read_all_ways(&gzip(&bytes))?;
    }

    #[test]
    fn random_text_never_panics(text in "[-0-9a-z.,;\t\"#\r\n _]{0,300}") {
        read_all_ways(text.as_bytes())?;
        let header = LOG.lines().next().unwrap_or_default();
        read_all_ways(format!("{header}\n{text}").as_bytes())?;
    }

    #[test]
    fn mutated_logs_never_panic(changes in prop::collection::vec((0..LOG.len(), 0..6usize, prop::collection::vec(any::<u8>(), 0..6)), 1..6)) {
        let mut bytes = LOG.as_bytes().to_vec();
        for (at, cut, paste) in changes {
            let at = at.min(bytes.len());
            let end = (at + cut).min(bytes.len());
            bytes.splice(at..end, paste);
        }
        read_all_ways(&bytes)?;
        let packed = gzip(LOG.as_bytes());
        let cut: Vec<u8> = packed.iter().zip(&bytes).map(|(a, b)| a ^ (b & 0x11 & (b >> 3))).collect();
        read_all_ways(&cut)?;
    }

    #[test]
    fn cells_swapped_for_others_never_panic(line in 1..7usize, column in 0..11usize,
                                            cell in prop_oneof!["-?[0-9]{1,25}", "-?[0-9]{1,3}(\\.[0-9]{0,3})?(e-?[0-9]{1,3})?", "nan|inf||\"|#", any::<i64>().prop_map(|n| n.to_string())]) {
        let mut lines: Vec<Vec<String>> = LOG.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
        lines[line][column] = cell;
        let text: String = lines.iter().map(|line| line.join(",") + "\n").collect();
        read_all_ways(text.as_bytes())?;
    }
}
