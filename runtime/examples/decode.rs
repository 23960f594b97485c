//! Decodes one frame with the parameters of a file, as `host-fit` writes them.
//!
//! `cargo run -p runtime --example decode -- runtime/examples/stage.bin 1200 900 700 300 -200 100`:
//! the blob, Hall codes A, B, C, capacitive codes 1, 2, 3.

use runtime::{Decode, ParameterSet, PlanarPose, RawFrame};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .ok_or("use: decode params.bin A B C G1 G2 G3")?;
    let codes = arguments
        .map(|code| code.parse())
        .collect::<Result<Vec<i32>, _>>()?;
    let &[a, b, c, g1, g2, g3] = codes.as_slice() else {
        return Err("six codes are needed: Hall A, B, C, capacitive 1, 2, 3".into());
    };

    let set = ParameterSet::from_bytes(&std::fs::read(path)?)?;
    println!("stage {:?}, {}", set.serial.as_str(), set.model);
    let decoder = set.decoder();
    let frame = RawFrame::new([a, b, c], [g1, g2, g3], 0, 0);
    let reading = decoder.decode(&frame, &PlanarPose::ZERO);

    match reading.planar() {
        Some(q) => println!(
            "X {:.3} um, Y {:.3} um, Rz {:.3} urad",
            q.x_m * 1e6,
            q.y_m * 1e6,
            q.rz_rad * 1e6
        ),
        None => println!("X, Y, Rz: invalid"),
    }
    match reading.vertical() {
        Some(v) => println!(
            "Z {:.3} um, Rx {:.3} urad, Ry {:.3} urad",
            v.z_m * 1e6,
            v.rx_rad * 1e6,
            v.ry_rad * 1e6
        ),
        None => println!("Z, Rx, Ry: invalid"),
    }
    println!("status {}", reading.status.bits());
    for name in reading.status.names() {
        println!("  {name}");
    }
    Ok(())
}
