//! Poses as an array of NumPy's format 1.0: `numpy.load` gives a structured array, a record per row.
//!
//! ```text
//! movement  <i8   number of the movement        z_m      <f4   the decoder's words, bit for bit
//! t_us      <i8   time within the log           rx_rad   <f4
//! x_m       <f4   the decoder's words           ry_rad   <f4
//! y_m       <f4                                 status   <u4   the bit mask of the status
//! rz_rad    <f4
//! ```
//!
//! With uncertainties a record ends with `u_x_m`, `u_y_m`, `u_rz_rad`, and with a budget `uc_x_m`, `uc_y_m`, `uc_rz_rad`,
//! `<f4`.

use super::PoseRow;

const FIELDS: &str = "('movement', '<i8'), ('t_us', '<i8'), ('x_m', '<f4'), ('y_m', '<f4'), ('rz_rad', '<f4'), \
     ('z_m', '<f4'), ('rx_rad', '<f4'), ('ry_rad', '<f4'), ('status', '<u4')";
const UNCERTAINTIES: [&str; 6] = [
    "u_x_m",
    "u_y_m",
    "u_rz_rad",
    "uc_x_m",
    "uc_y_m",
    "uc_rz_rad",
];

/// Magic, version, and length of what follows.
const START_BYTES: usize = 10;

/// The header, as long for any number of rows: a multiple of 64 bytes.
pub(super) fn header(rows: usize, uncertainties: usize) -> Vec<u8> {
    let names = UNCERTAINTIES[..uncertainties].iter();
    let uncertainties: String = names.map(|name| format!(", ('{name}', '<f4')")).collect();
    let shape = format!("({rows},)");
    let described = format!(
        "{{'descr': [{FIELDS}{uncertainties}], 'fortran_order': False, 'shape': {shape:<24}, }}"
    );
    let bytes = (START_BYTES + described.len() + 1).next_multiple_of(64);
    // Far below 2^16.
    let length = (bytes - START_BYTES) as u16;
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend(length.to_le_bytes());
    header.extend(described.bytes());
    header.resize(bytes - 1, b' ');
    header.push(b'\n');
    header
}

/// Adds the record of a row.
pub(super) fn record(bytes: &mut Vec<u8>, row: &PoseRow, uncertainties: &[f64]) {
    bytes.extend(row.movement.to_le_bytes());
    bytes.extend(row.t_us.to_le_bytes());
    let planar = row.reading.pose.planar.to_array();
    let vertical = row.reading.pose.vertical.to_array();
    for word in planar.into_iter().chain(vertical) {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(row.reading.status.bits().to_le_bytes());
    for u in uncertainties {
        bytes.extend((*u as f32).to_le_bytes());
    }
}
