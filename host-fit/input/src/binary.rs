//! Files that are not text: recognised by their first bytes, each with the way to CSV.

/// Number of bytes at the start of a file that are searched for binary data.
pub(super) const PROBE_BYTES: usize = 64 * 1024;

/// File formats by their first bytes, each with its name and a remedy.
const FORMATS: [(&[u8], &str); 17] = [
    (
        b"PK\x03\x04",
        "a zip archive, as Excel (.xlsx), OpenDocument (.ods) and NumPy (.npz) files are; export it as CSV",
    ),
    (
        b"\xd0\xcf\x11\xe0",
        "an old Excel workbook (.xls); export it as CSV",
    ),
    (
        b"\x93NUMPY",
        "a NumPy array (.npy); load it in Python and write a CSV with the columns' names in its first line",
    ),
    (
        b"MATLAB 5.0",
        "a MATLAB file (.mat); write a CSV in MATLAB with writetable",
    ),
    (
        b"MATLAB 7.3",
        "a MATLAB file (.mat, version 7.3); write a CSV in MATLAB with writetable",
    ),
    (
        b"\x89HDF\r\n\x1a\n",
        "an HDF5 file (.h5, .hdf5); write its table as CSV, in Python with h5py or pandas",
    ),
    (
        b"TDSm",
        "a LabVIEW file (.tdms); export it as CSV, in LabVIEW or in Python with nptdms",
    ),
    (
        b"PAR1",
        "a Parquet file; write it as CSV, in Python with pandas.read_parquet and to_csv",
    ),
    (
        b"ARROW1",
        "an Arrow or Feather file; write it as CSV, in Python with pandas.read_feather and to_csv",
    ),
    (
        b"SQLite format 3",
        "an SQLite database; export its table as CSV",
    ),
    (b"%PDF", "a PDF; name the CSV log itself"),
    (b"\x28\xb5\x2f\xfd", "zstd data; decompress it first"),
    (b"\xfd7zXZ", "xz data; decompress it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it first"),
    (b"BZh", "bzip2 data; decompress it first"),
    (b"\x1f\x8b", "gzip inside gzip; decompress it once"),
    (b"\x7fELF", "a program; name a CSV or CSV.gz log"),
];

/// The offset of the first byte that no text has, and the probable format; `None` for text.
pub(super) fn in_text(bytes: &[u8]) -> Option<(usize, &'static str)> {
    let start = bytes.get(..PROBE_BYTES).unwrap_or(bytes);
    let control = |byte: &u8| matches!(*byte, 0..=8 | 14..=31 | 127);
    let offset = start.iter().position(control)?;
    let known = FORMATS.iter().find(|(magic, _)| bytes.starts_with(magic));
    let unknown = "binary data; name a CSV or CSV.gz log";
    Some((offset, known.map_or(unknown, |(_, format)| format)))
}
