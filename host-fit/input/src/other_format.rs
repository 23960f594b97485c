//! Files that are no table of numbers: recognised by their first bytes, each with the way to one.

/// Number of bytes at the start of a file that are searched for binary data.
pub(super) const PROBE_BYTES: usize = 64 * 1024;

/// Binary formats by their first bytes, each with its name and a remedy.
const BINARY: [(&[u8], &str); 19] = [
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
    (
        b"MDF ",
        "a measurement of ASAM MDF (.mf4); a record of the CAN bus becomes one that host-fit join reads by `python -m can.logconvert record.mf4 record.log`, another one CSV in Python with asammdf",
    ),
    (
        b"LOGG",
        "a record of the CAN bus by Vector (.blf); `python -m can.logconvert record.blf record.log` makes one that host-fit join reads",
    ),
    (b"%PDF", "a PDF; name the CSV log itself"),
    (b"\x28\xb5\x2f\xfd", "zstd data; decompress it first"),
    (b"\xfd7zXZ", "xz data; decompress it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it first"),
    (b"BZh", "bzip2 data; decompress it first"),
    (b"\x1f\x8b", "gzip inside gzip; decompress it once"),
    (b"\x7fELF", "a program; name a CSV or CSV.gz log"),
];

/// Text formats by their first bytes, as the binary ones.
const TEXT: [(&[u8], &str); 7] = [
    (
        b"(",
        "a record of the CAN bus by candump; host-fit join joins it with the reference to a log",
    ),
    (
        b"date ",
        "a record of the CAN bus by Vector (.asc); `python -m can.logconvert record.asc record.log` makes one that host-fit join reads",
    ),
    (
        b";$FILEVERSION",
        "a record of the CAN bus by PEAK (.trc); `python -m can.logconvert record.trc record.log` makes one that host-fit join reads",
    ),
    (
        b"Time Stamp,ID,",
        "a record of the CAN bus by SavvyCAN (GVRET); save it as candump log for host-fit join",
    ),
    (b"{", "JSON; write its numbers as CSV"),
    (b"[{", "JSON; write its numbers as CSV"),
    (b"<", "XML or HTML; write its numbers as CSV"),
];

/// The format of a text with this first line, where it is no table.
pub fn in_text(line: &[u8]) -> Option<&'static str> {
    let known = TEXT
        .iter()
        .find(|(start, _)| line.trim_ascii().starts_with(start));
    known.map(|(_, format)| *format)
}

/// The offset of the first byte that no text has, and the probable format; `None` for text.
pub(super) fn in_binary(bytes: &[u8]) -> Option<(usize, &'static str)> {
    let start = bytes.get(..PROBE_BYTES).unwrap_or(bytes);
    let control = |byte: &u8| matches!(*byte, 0..=8 | 14..=31 | 127);
    let offset = start.iter().position(control)?;
    let known = BINARY.iter().find(|(magic, _)| bytes.starts_with(magic));
    let unknown = "binary data; name a CSV or CSV.gz log";
    Some((offset, known.map_or(unknown, |(_, format)| format)))
}
