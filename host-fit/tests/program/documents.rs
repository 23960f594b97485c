//! What the documents name exists: commands and options of the program, targets of cargo, scripts, links.
//! `tests/examples` runs the commands of the guide and the first ones of the front page; those elsewhere are
//! examples, and are checked here by name.

use crate::common::{Bench, stdout};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A Markdown file.
struct Document {
    /// From the top of the repository.
    path: PathBuf,
    text: String,
}

/// What documents may name.
struct Existing {
    top: PathBuf,
    /// Help of the program by command; of the program itself without one.
    help: BTreeMap<String, String>,
    /// Folder of each package, and the names of its targets.
    packages: BTreeMap<String, (PathBuf, Vec<String>)>,
}

fn top() -> PathBuf {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    crate_folder.parent().expect("the top").to_owned()
}

/// All documents, but those of builds.
fn documents() -> Vec<Document> {
    let mut found = Vec::new();
    let mut folders = vec![top()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let is_left_out =
                name.starts_with("target") || (name.starts_with('.') && name != ".github");
            if path.is_dir() && !is_left_out {
                folders.push(path);
            } else if name.ends_with(".md") {
                let text = std::fs::read_to_string(&path).expect("text");
                let path = path.strip_prefix(top()).expect("inside").to_owned();
                found.push(Document { path, text });
            }
        }
    }
    assert!(found.len() > 10, "{}", found.len());
    found
}

impl Existing {
    fn new() -> Self {
        let bench = Bench::new();
        let all = stdout(&bench.good("--help"));
        let names = all.lines().filter_map(|line| line.strip_prefix("  "));
        let names = names.filter_map(|line| line.split_whitespace().next());
        let mut help = BTreeMap::new();
        for name in names.filter(|name| name.chars().all(|c| c.is_ascii_lowercase() || c == '-')) {
            let output = bench.run(&format!("{name} --help"));
            if output.status.success() && !name.starts_with('-') {
                help.insert(name.to_owned(), stdout(&output));
            }
        }
        assert!(help.len() > 15, "{:?}", help.keys());
        help.insert(String::new(), all);
        let metadata = Command::new(env!("CARGO"))
            .args([
                "metadata",
                "--no-deps",
                "--offline",
                "--format-version",
                "1",
            ])
            .current_dir(top())
            .output()
            .expect("cargo runs");
        let metadata: Value = serde_json::from_slice(&metadata.stdout).expect("JSON");
        let text = |value: &Value| value.as_str().expect("a text").to_owned();
        let package = |package: &Value| {
            let targets = package["targets"].as_array().expect("targets");
            let targets = targets.iter().map(|target| text(&target["name"])).collect();
            let manifest = PathBuf::from(text(&package["manifest_path"]));
            let folder = manifest.parent().expect("a folder").to_owned();
            (text(&package["name"]), (folder, targets))
        };
        let packages = metadata["packages"].as_array().expect("packages");
        Self {
            top: top(),
            help,
            packages: packages.iter().map(package).collect(),
        }
    }

    /// What is wrong with a command; `folders` are those that its paths may count from.
    fn fault(&self, command: &str, folders: &[PathBuf]) -> Option<String> {
        let words: Vec<&str> = command
            .split_whitespace()
            .skip_while(|word| word.contains('=') && !word.starts_with('-'))
            .collect();
        let (program, arguments) = words.split_first()?;
        match *program {
            "host-fit" => self.fault_of_program(arguments),
            "cargo" => self.fault_of_cargo(arguments),
            script if script.contains('/') && !script.starts_with('/') => {
                let is_there = folders.iter().any(|folder| folder.join(script).exists());
                (!is_there).then(|| format!("no file {script}"))
            }
            _ => None,
        }
    }

    fn fault_of_program(&self, arguments: &[&str]) -> Option<String> {
        let command = arguments.first().filter(|word| !word.starts_with('-'));
        // The name of any command stands in capitals.
        let command = command.filter(|word| **word != "COMMAND").unwrap_or(&"");
        let Some(help) = self.help.get(*command) else {
            return Some(format!("no command {command}"));
        };
        let options = arguments.iter().filter(|word| word.starts_with("--"));
        let names = options.filter_map(|option| option.split('=').next());
        let is_known = |name: &str| {
            let mut words = help.split(|c: char| !(c.is_alphanumeric() || c == '-'));
            words.any(|word| word == name)
        };
        let unknown = { names }.find(|name| !is_known(name));
        unknown.map(|name| format!("no option {name} of {command}"))
    }

    fn fault_of_cargo(&self, arguments: &[&str]) -> Option<String> {
        let own = arguments.split(|word| *word == "--").next()?;
        let after = |names: &[&str]| {
            let at = own.iter().position(|word| names.contains(word))?;
            own.get(at + 1).copied()
        };
        let name = after(&["-p", "--package"]);
        let package = match name {
            None => None,
            Some(name) => match self.packages.get(name) {
                Some(package) => Some(package),
                None => return Some(format!("no package {name}")),
            },
        };
        for kind in ["--bench", "--example", "--test", "--bin"] {
            let target = after(&[kind]).map(|name| name.trim_matches('\''));
            let mut packages = self.packages.values();
            let is_there = |target: &str| match package {
                Some((_, targets)) => targets.iter().any(|name| name == target),
                None => packages.any(|(_, targets)| targets.iter().any(|name| name == target)),
            };
            if let Some(target) =
                target.filter(|name| !name.contains('*') && !name.contains("NAME"))
                && !{ is_there }(target)
            {
                return Some(format!("no target {target}"));
            }
        }
        if let (Some("run"), Some("host-fit")) = (own.first().copied(), name)
            && !own.contains(&"--example")
        {
            let at = arguments.iter().position(|word| *word == "--")?;
            return self.fault_of_program(&arguments[at + 1..]);
        }
        let (Some((folder, _)), Some(filter)) = (package, after(&["--lib"])) else {
            return None;
        };
        let mut modules = filter.split("::");
        let missing = modules.find(|module| !filter.starts_with('-') && !has(folder, module));
        missing.map(|module| format!("no module {module} in {}", name.unwrap_or_default()))
    }

    /// Where a link leads nowhere.
    fn fault_of_link(&self, document: &Document, target: &str) -> Option<String> {
        if target.contains("://") {
            return None;
        }
        let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
        let beside = document.path.parent().unwrap_or(Path::new(""));
        let file = match path {
            "" => self.top.join(&document.path),
            path => self.top.join(beside).join(path),
        };
        if !file.exists() {
            return Some(format!("no file {path}"));
        }
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        let is_heading = |line: &str| line.starts_with('#') && slug(line) == anchor;
        let is_there = anchor.is_empty() || text.lines().any(is_heading);
        (!is_there).then(|| format!("no heading {target}"))
    }
}

/// Whether a file or folder of a crate is called like this, or holds a module of this name.
fn has(folder: &Path, name: &str) -> bool {
    let entries = std::fs::read_dir(folder.join("src")).or_else(|_| std::fs::read_dir(folder));
    entries.expect("a folder").any(|entry| {
        let path = entry.expect("an entry").path();
        let is_it = path.file_stem().is_some_and(|stem| stem == name);
        is_it || (path.is_dir() && has(&path, name))
    })
}

/// The anchor of a heading.
fn slug(heading: &str) -> String {
    let title = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = title
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().replace(' ', "-")
}

/// The commands of the blocks that are marked `sh`, each with its folder, and those in the text.
fn commands(document: &Document) -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    let (mut block, mut folder) = (None, PathBuf::new());
    for line in document.text.replace("\\\n", " ").lines() {
        if let Some(language) = line.strip_prefix("```") {
            block = block.is_none().then(|| language.to_owned());
            folder = PathBuf::new();
        } else if block.as_deref() == Some("sh") {
            let line = line.split(" #").next().unwrap_or_default();
            let parts = line.split("&&").flat_map(|part| part.split(['|', ';']));
            for part in parts.map(str::trim).filter(|part| !part.starts_with('#')) {
                if let Some(inside) = part.strip_prefix("cd ") {
                    folder.push(inside);
                }
                found.push((part.to_owned(), folder.clone()));
            }
        } else if block.is_none() {
            let spans = line.split('`').skip(1).step_by(2);
            let is_command = |span: &&str| {
                let start = ["host-fit ", "cargo ", "tests/"];
                start.iter().any(|start| span.starts_with(start)) && !span.contains('*')
            };
            found.extend(
                spans
                    .filter(is_command)
                    .map(|span| (span.to_owned(), PathBuf::new())),
            );
        }
    }
    found
}

#[test]
fn what_documents_name_exists() {
    let known = Existing::new();
    let mut faults = Vec::new();
    let mut count = 0;
    for document in documents() {
        let beside = document.path.parent().unwrap_or(Path::new(""));
        for (command, folder) in commands(&document) {
            let folders = [&folder, &beside.join(&folder)].map(|folder| known.top.join(folder));
            count += 1;
            let fault = known.fault(&command, &folders);
            faults.extend(fault.map(|fault| (document.path.clone(), command, fault)));
        }
        for link in document.text.split("](").skip(1) {
            let target = link.split([')', ' ']).next().unwrap_or_default();
            let fault = known.fault_of_link(&document, target);
            faults.extend(fault.map(|fault| (document.path.clone(), target.to_owned(), fault)));
        }
    }
    assert!(count > 100, "{count}");
    assert!(faults.is_empty(), "{faults:#?}");
}
