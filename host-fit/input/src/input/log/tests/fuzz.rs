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
        check(read_bytes(bytes, Path::new("log"), stage(), &options))?;
    }
    Ok(())
}

/// Movements cover the rows, one after the other, forwards in time, with finite numbers.
fn check(reading: Result<LogReading, LogError>) -> Result<(), TestCaseError> {
    match reading {
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
    Ok(())
}

proptest! {
    #[test]
    fn odd_headers_and_rows_of_units_never_panic(
        names in prop::collection::vec("(ifm_|hall |cap_|time|t|x|y|z|movement|Rz)?[xyabc123]{0,2}(_nm|_V| ?\\[[\u{b5}\u{3bc}unm]{1,2}(m|s|rad|V)\\]|/um|\\(s\\)|[(\\[/\\])])?", 1..13),
        units in "[-,;munsVrad\u{b5}\\[\\]() ]{0,40}", rows in "[-0-9,;.:TZ\t\n]{0,200}", separator in "[,;\t]",
    ) {
        let header = names.join(&separator);
        read_all_ways(format!("{header}\n{units}\n{rows}\n").as_bytes())?;
        let bare = LOG.replace("movement,", "");
        read_all_ways(bare.replacen("t_us", &names[0], 1).as_bytes())?;
        let utf16: Vec<u8> = format!("{header}\n{rows}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        read_all_ways(&utf16)?;
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
}
