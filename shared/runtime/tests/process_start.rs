//! A process started by hand. Alone in its file, since `init` installs signal handlers for the whole process.

use masseter_runtime::lifecycle::{ProcessArguments, ProcessError};

#[test]
fn a_process_checks_its_scenario() {
    let scenario = std::env::temp_dir().join(format!("masseter-standstill-{}.toml", std::process::id()));
    std::fs::write(&scenario, "rate_hz = 0").unwrap();
    let process_arguments =
        ProcessArguments { scenario: scenario.clone(), domain: "nowhere".to_owned(), lockstep: None };
    let refused = process_arguments.init();
    std::fs::remove_file(scenario).unwrap();
    let Err(ProcessError::Scenario(error)) = refused else { panic!("{refused:?}") };
    assert!(error.to_string().contains("rate_hz = 0: use 10 to 20000 Hz"), "{error}");
}
