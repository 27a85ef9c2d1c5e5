//! Instructions of a solve, counted by Valgrind: `cargo bench -p masseter-controller --bench instructions`.
//!
//! Runs itself under Valgrind twice per work, with different numbers of calls; the difference is free of start and
//! preparation. Unlike times, the counts do not depend on the load of the machine.

mod workloads;

use std::env;
use std::error::Error;
use std::process::Command;

use workloads::{CYCLES, WORKS};

/// Argument of the process whose instructions are counted, followed by the work's name and the number of calls.
const COUNTED: &str = "--counted";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().collect();
    match &arguments[1..] {
        [counted, name, calls] if counted == COUNTED => run(name, calls.parse()?),
        // `cargo test --all-targets` runs benches without this argument.
        arguments if arguments.iter().any(|argument| argument == "--bench") => tell_all(),
        _ => Ok(()),
    }
}

fn run(name: &str, calls: u32) -> Result<(), Box<dyn Error>> {
    let work = WORKS.iter().find(|work| work.name == name).ok_or("no such work")?;
    let mut call = (work.start)();
    for _ in 0..calls {
        call();
    }
    Ok(())
}

fn tell_all() -> Result<(), Box<dyn Error>> {
    println!("{:48}{:>24}", "work", "instructions a call");
    for work in WORKS {
        let [once, twice] = [CYCLES, 2 * CYCLES].map(|calls| counted(work.name, calls));
        println!("{:48}{:>24}", work.name, (twice? - once?) / u64::from(CYCLES));
    }
    Ok(())
}

/// Instructions of a process that makes this many calls.
fn counted(name: &str, calls: u32) -> Result<u64, Box<dyn Error>> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(env::current_exe()?)
        .args([COUNTED, name, &calls.to_string()])
        .output()
        .map_err(|error| format!("valgrind does not start ({error}); install the package valgrind"))?;
    let told = String::from_utf8_lossy(&output.stderr);
    let count = told.lines().find_map(|line| line.split_once("Collected :"));
    let (_, count) = count.filter(|_| output.status.success()).ok_or_else(|| told.to_string())?;
    Ok(count.trim().parse()?)
}
