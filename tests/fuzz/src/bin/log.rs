//! A log, plain or gzip: what `decode`, `eval`, `fit` and `check` take or refuse.

#![no_main]

use fuzz::Folder;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static FOLDER: LazyLock<Folder> = LazyLock::new(Folder::new);

fn run(command: &str, output: &str) -> bool {
    let done = FOLDER.run(&command.split(' ').collect::<Vec<_>>(), output);
    FOLDER.remove(output);
    done
}

fuzz_target!(|log: &[u8]| {
    FOLDER.write("log", log);
    run(
        "fit @log --stage @stage.toml --out @fit.bin --model 30 --solver lm --bad-rows skip --threads 1",
        "fit.bin",
    );
    if run(
        "decode @params.bin @log --stage @stage.toml --out @pose.csv --hold 3",
        "pose.csv",
    ) {
        run("eval @params.bin @log --stage @stage.toml", "");
    }
});
