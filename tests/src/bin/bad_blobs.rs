//! Writes parameter blobs that a target must refuse: cut short, of another stage, unusable.

use runtime::blob::MAX_BYTES;
use runtime::model::Probes;
use runtime::parameters::Text;
use runtime::{BlobError, ParameterSet};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    tests::exit("bad_blobs", write_all(&arguments))
}

fn write_all(arguments: &[PathBuf]) -> Result<bool, Box<dyn Error>> {
    let [good, folder] = arguments else {
        return Err("use: bad_blobs params.bin FOLDER".into());
    };
    let blob = std::fs::read(good)?;
    let set = ParameterSet::from_bytes(&blob)?;
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes);
    write("good.bin", &blob)?;
    // Power was lost: the rest of the sector is erased.
    let mut cut = blob.clone();
    if let Some(lost) = cut.get_mut(blob.len() * 2 / 3..) {
        lost.fill(0xff);
    }
    cut.resize(16 * 1024, 0xff);
    write("cut.bin", &cut)?;
    let changed = |change: &dyn Fn(&mut ParameterSet)| -> Result<Vec<u8>, BlobError> {
        let mut changed = set.clone();
        change(&mut changed);
        let mut buffer = [0; MAX_BYTES];
        Ok(changed.to_bytes(&mut buffer)?.to_vec())
    };
    let other = Text::try_from("another stage")?;
    write("other.bin", &changed(&|set| set.serial = other.clone())?)?;
    write(
        "nan.bin",
        &changed(&|set| {
            if let Probes::Linear(probes) = &mut set.probes {
                probes[1].per_z_m = f32::NAN;
            }
        })?,
    )?;
    Ok(true)
}
