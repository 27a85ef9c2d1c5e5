//! The `masseter` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    masseter::main()
}
