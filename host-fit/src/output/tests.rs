use super::record_file::RecordFile;
use super::*;

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let name = |entry: std::io::Result<fs::DirEntry>| {
        let name = entry.expect("an entry").file_name();
        name.to_string_lossy().into_owned()
    };
    let mut names: Vec<_> = entries.map(name).collect();
    names.sort();
    names
}

#[test]
fn a_file_is_written_whole_and_replaced_whole_and_leaves_nothing_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("params.bin");
    check_writable(&path).expect("writable");
    assert!(names(folder.path()).is_empty(), "the check leaves nothing");
    write_atomically(&path, b"first, and longer").expect("written");
    write_atomically(&path, b"second").expect("replaced");
    assert_eq!(fs::read(&path).expect("readable"), b"second");
    assert_eq!(names(folder.path()), ["params.bin"]);
}

#[test]
fn a_target_that_cannot_be_is_named_with_its_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("file"), b"old").expect("written");
    for (path, reason) in [
        (folder.path().into(), "is a folder"),
        (at("new/"), "is a folder"),
        (at("missing/params.bin"), "the folder does not exist"),
        ("".into(), "the name of the output is empty"),
        (
            at("file/params.bin"),
            if cfg!(unix) {
                "below a file"
            } else {
                "another"
            },
        ),
    ] {
        let error = write_atomically(&path, b"new").expect_err("refused");
        assert!(error.to_string().contains(reason), "{error}");
    }
    assert_eq!(names(folder.path()), ["file"]);
}

#[test]
fn a_read_only_file_stays_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("params.bin");
    fs::write(&path, b"old").expect("written");
    let writable = fs::metadata(&path).expect("there").permissions();
    let mut locked = writable.clone();
    locked.set_readonly(true);
    fs::set_permissions(&path, locked).expect("set");
    let error = write_atomically(&path, b"new").expect_err("refused");
    assert!(
        error.to_string().contains("no permission to write"),
        "{error}"
    );
    assert_eq!(fs::read(&path).expect("readable"), b"old");
    fs::set_permissions(&path, writable).expect("set");
}

#[cfg(unix)]
#[test]
fn permissions_are_those_of_a_new_file_or_of_the_file_replaced() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().expect("a folder");
    let mode = |path: &Path| fs::metadata(path).expect("there").permissions().mode();
    let (ordinary, ours) = (folder.path().join("a"), folder.path().join("b"));
    fs::write(&ordinary, b"").expect("written");
    write_atomically(&ours, b"").expect("written");
    assert_eq!(mode(&ours), mode(&ordinary));
    fs::set_permissions(&ours, fs::Permissions::from_mode(0o640)).expect("set");
    write_atomically(&ours, b"again").expect("replaced");
    assert_eq!(mode(&ours) & 0o777, 0o640);
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_not_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, link) = (folder.path().join("file"), folder.path().join("link"));
    fs::write(&file, b"old").expect("written");
    std::os::unix::fs::symlink(&file, &link).expect("linked");
    write_atomically(&link, b"new").expect("written");
    assert_eq!(fs::read(&file).expect("readable"), b"new");
    assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
}

#[test]
fn a_record_is_in_its_file_before_it_is_finished_and_never_replaces_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bus.log");
    let lines = |path: &Path| {
        let text = fs::read_to_string(path).expect("readable");
        assert!(text.is_empty() || text.ends_with('\n'), "{text}");
        text.lines().count()
    };
    let mut record = RecordFile::create(&path).expect("writable");
    (0..20_000).for_each(|k| record.line(k).expect("written"));
    assert!((10_000..20_000).contains(&lines(&path)), "most are there");
    record.flush().expect("written");
    assert_eq!(lines(&path), 20_000);
    drop(record);
    let again = RecordFile::create(&path).expect_err("there");
    assert!(again.to_string().contains("exists already"), "{again}");
    assert_eq!(lines(&path), 20_000);
    let missing = RecordFile::create(&folder.path().join("missing/bus.log"));
    let missing = missing.expect_err("no folder").to_string();
    assert!(missing.contains("the folder does not exist"), "{missing}");
    let other = RecordFile::create(&folder.path().join("other.log")).expect("writable");
    other.discard();
    assert_eq!(names(folder.path()), ["bus.log"]);
}

#[test]
fn a_blob_has_the_numbers_of_the_one_that_it_replaces_and_of_the_one_that_it_comes_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("params.bin");
    let set = include_bytes!("../../../runtime/examples/field.bin");
    let set = runtime::ParameterSet::from_bytes(set).expect("sound");
    let mut outputs = Outputs::default();
    let known = posterior_file::tests::known();
    posterior_file::add_calibration(&mut outputs, &path, &set, Some(&known)).expect("added");
    outputs.commit().expect("written");
    let numbers = |set: &runtime::ParameterSet, before: &[&str]| {
        let before: Vec<String> = before.iter().map(|of| (*of).to_owned()).collect();
        let mut warnings = Vec::new();
        let found = kept::certificates(&path, set, &before, &mut warnings);
        assert!(warnings.is_empty());
        (found.own, found.before.join(" "))
    };
    let given = |own: &str, before: &str| (own.to_owned(), before.to_owned());
    assert_eq!(numbers(&set, &["6"]), given("7", "6"));
    let mut other = set;
    other.created = "2026-11-26".try_into().expect("short");
    assert_eq!(numbers(&other, &["6", "8"]), given("", "6 7 8"));
    other.serial = "OTHER".try_into().expect("short");
    assert_eq!(numbers(&other, &["8"]), given("", "8"));
}
