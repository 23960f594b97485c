//! `host-fit`: the command line. See [`host_fit::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    host_fit::cli::main()
}
