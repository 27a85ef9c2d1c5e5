//! The CAN link seen from outside: the plan, the measurements of a run beside it, and the served drives.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::common::{MASSETER, Workspace, check, masseter, stdout, wait_until};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

#[test]
fn one_bus_at_a_kilohertz_is_refused_with_its_table() {
    let workspace = Workspace::new("[can]\nbuses = [[0, 1, 2, 3, 4, 5]]");
    let scenario = workspace.file("scenario.toml");
    let output = masseter(&["can", "plan", scenario.to_str().unwrap(), "--rate-hz", "1000"]);
    let table = stdout(&output);
    assert_eq!(output.status.code(), Some(2), "{table}");
    assert!(table.contains("a cycle of 1000.0 µs takes 1555.0 µs at worst"), "{table}");
    assert!(table.contains("too late"), "{table}");
    assert!(table.contains("refused: bus 0 does not fit; the highest rate_hz that fits is "), "{table}");
}

#[test]
fn two_buses_at_a_kilohertz_are_accepted_and_every_message_has_a_bound() {
    let output = masseter(&["can", "plan", "--format", "json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(plan["fits"], true);
    let buses = plan["buses"].as_array().unwrap();
    assert_eq!(buses.len(), 2);
    for message in buses.iter().flat_map(|bus| bus["messages"].as_array().unwrap()) {
        let (response_ns, deadline_ns) = (message["response_ns"].as_u64(), message["deadline_ns"].as_u64());
        assert!(response_ns.is_some() && response_ns <= deadline_ns, "{message}");
    }
}

#[test]
fn the_rate_that_a_plan_promises_is_one_that_fits() {
    let plan = |rate_hz: &str| masseter(&["can", "plan", "--format", "json", "--rate-hz", rate_hz]);
    let promised: Value = serde_json::from_slice(&plan("500").stdout).unwrap();
    let max_rate_hz = promised["max_rate_hz"].as_u64().unwrap();
    assert_eq!(plan(&max_rate_hz.to_string()).status.code(), Some(0));
    assert_eq!(plan(&(max_rate_hz + 1).to_string()).status.code(), Some(2));
    let of_buses = promised["buses"].as_array().unwrap().iter().map(|bus| bus["max_rate_hz"].as_u64());
    assert_eq!(of_buses.min(), Some(Some(max_rate_hz)));
    let table = masseter(&["can", "plan"]);
    assert!(stdout(&table).ends_with(&format!("fits; the highest rate_hz that fits is {max_rate_hz}\n")));
}

#[test]
fn the_plan_says_which_queue_an_interface_has_and_bounds_emergencies_and_sdo_behind_either() {
    for (scenario, queue, words) in [
        ("", "priority", "the queue of the master's interface is by priority"),
        (
            "[can]\ninterfaces = ['can0', 'can1']",
            "fifo",
            "the queue of the master's interface is in order (FIFO)",
        ),
    ] {
        let workspace = Workspace::new(scenario);
        let scenario = workspace.file("scenario.toml");
        let plan = |more: &[&str]| masseter(&[&["can", "plan", scenario.to_str().unwrap()], more].concat());
        let table = plan(&[]);
        assert_eq!(table.status.code(), Some(0), "{}", stdout(&table));
        assert_eq!(stdout(&table).matches(words).count(), 2, "{}", stdout(&table));
        let plan: Value = serde_json::from_slice(&plan(&["--format", "json"]).stdout).unwrap();
        assert_eq!(plan["queue"], queue);
        let rows = plan["buses"][0]["queued"].as_array().unwrap();
        for name in ["SYNC", "EMCY 1", "SDO request 1", "SDO response 1", "heartbeat 127"] {
            let row =
                rows.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("{name}: {rows:?}"));
            let bounds = ["priority_with_emergencies_ns", "fifo_with_emergencies_ns"];
            assert!(bounds.iter().all(|bound| row[bound].is_u64()), "{row}");
        }
    }
}

#[test]
fn every_message_of_a_run_arrives_within_the_bound_of_its_plan() {
    for scenario in
        ["duration_s = 2.0", "rate_hz = 500\nduration_s = 1.0\n[can]\nbuses = [[0, 1, 2, 3, 4, 5]]"]
    {
        let workspace = Workspace::new(scenario);
        let output = workspace.run_virtual(&["--verbose"]);
        assert_eq!(output.status.code(), Some(0), "{scenario}: {}", stdout(&output));
        let summary = workspace.summary();
        let judged = check(&summary, "bus response");
        assert_eq!(judged["result"], "passed", "{judged}");
        for message in summary["figures"]["bus_response"]["messages"].as_array().unwrap() {
            assert!(message["frames"].as_u64() > Some(0), "{message}");
            let (max_ns, bound_ns) = (message["max_ns"].as_u64(), message["bound_ns"].as_u64());
            assert!(max_ns <= bound_ns || message["message"] == "other", "{message}");
        }
        assert!(stdout(&output).contains("response, µs"), "{}", stdout(&output));
    }
}

#[test]
fn a_disturbed_bus_is_not_held_against_bounds_that_assume_none() {
    let fault = "[[faults]]\nkind = 'corrupt'\nbus = 0\nfrom_s = 0.5\nprobability = 0.01";
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{fault}"));
    let output = workspace.run_virtual(&[]);
    let summary = workspace.summary();
    assert_eq!(check(&summary, "bus response")["result"], "not_judged", "{}", stdout(&output));
    assert!(stdout(&output).contains("skip bus response"), "{}", stdout(&output));
}

/// A percent of the frames may go wrong; a node that is gone, or that talks without end, stops the rig for good.
#[test]
fn every_fault_of_a_bus_is_borne_or_stops_the_rig_safely_with_its_cause() {
    let now_and_then = "probability = 0.01";
    let cases = [
        ("corrupt", now_and_then, None),
        ("lose", now_and_then, None),
        ("duplicate", now_and_then, None),
        ("delay", "size = \"300 us\"\nprobability = 0.01", None),
        ("babble", "node = 2", Some("process_data_lost")),
        ("disconnect", "node = 2", Some("process_data_lost")),
        ("bus_off", "node = 2", Some("process_data_lost")),
        ("disconnect", "node = 127", Some("process_data_lost")),
        ("bus_off", "node = 127", Some("bus_off")),
    ];
    for (kind, which, stopped_by) in cases {
        let fault = format!("[[faults]]\nkind = '{kind}'\nbus = 0\nfrom_s = 1.5\n{which}");
        let workspace = Workspace::new(&format!("duration_s = 1.0\n{fault}"));
        let output = workspace.run_virtual(&[]);
        let expected = if stopped_by.is_some() { 5 } else { 0 };
        assert_eq!(output.status.code(), Some(expected), "{fault}: {}", stdout(&output));
        let summary = workspace.summary();
        let events = summary["figures"]["events"].as_array().unwrap();
        let first_fault = events.iter().find(|event| event["kind"] == "fault");
        assert_eq!(
            first_fault.and_then(|event| event["cause"].as_str()),
            stopped_by,
            "{fault}: {first_fault:?}"
        );
        assert!(events.iter().any(|event| event["cause"] == "fault_injected"), "{fault}");
    }
}

/// At the fastest moment of the default motion, for any time.
#[test]
fn a_drive_that_misses_its_targets_is_noticed_within_few_cycles() {
    for cycles in [2, 4, 10, 80] {
        let until_s = 3.25 + f64::from(cycles) * 1e-3;
        let fault = format!(
            "[[faults]]\nkind = 'lose'\nbus = 1\nnode = 4\nid = 0x204\nfrom_s = 3.25\nuntil_s = {until_s}"
        );
        let workspace = Workspace::new(&format!("duration_s = 4.0\n{fault}"));
        let output = workspace.run_virtual(&[]);
        assert_eq!(output.status.code(), Some(5), "{fault}: {}", stdout(&output));
        let summary = workspace.summary();
        let events = summary["figures"]["events"].as_array().unwrap();
        let time_ns = |event: Option<&Value>| event.unwrap()["time_ns"].as_u64().unwrap();
        let with_cause = |cause: &str| events.iter().find(|event| event["cause"] == cause);
        // The controller may notice in the same cycle.
        let latency_ns = time_ns(with_cause("following_error")) - time_ns(with_cause("fault_injected"));
        assert!(latency_ns < 3_100_000, "{latency_ns} ns");
    }
}

#[test]
fn a_run_whose_declared_fault_never_acts_is_untested() {
    let never = "[[faults]]\nkind = 'disconnect'\nbus = 0\nnode = 1\nfrom_s = 1000.0";
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{never}"));
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
    let summary = workspace.summary();
    let faults = check(&summary, "faults");
    assert_eq!((&summary["verdict"]["word"], &faults["result"]), (&"UNTESTED".into(), &"untested".into()));
    let finding = faults["finding"].as_str().unwrap();
    assert!(
        finding.starts_with("0 of 1 declared faults acted, number 1 at 1000 s, after the run's end at "),
        "{finding}"
    );
}

#[test]
fn a_run_passes_on_a_bus_where_frames_come_twice_now_and_then_from_the_first_on() {
    let workspace = Workspace::new(
        "duration_s = 1.0\n[[faults]]\nkind = 'duplicate'\nbus = 0\nfrom_s = 0\nprobability = 0.01",
    );
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
}

/// A server on a port that the system chose, ended with the test.
struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn start(workspace: &Workspace) -> Self {
        let mut child = Command::new(MASSETER)
            .args(["can", "serve", "--listen", "127.0.0.1:0"])
            .arg(workspace.file("scenario.toml"))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
        let announced = lines.find(|line| line.contains("socketcand protocol on ")).unwrap();
        let address = announced.split(" on ").nth(1).unwrap().split(';').next().unwrap().to_owned();
        Self { child, address }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended by itself, which the test has noticed then.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads until `text` has come.
fn expect(stream: &mut TcpStream, text: &str) -> String {
    let (mut heard, mut bytes) = (String::new(), [0; 4096]);
    while !heard.contains(text) {
        let count = stream.read(&mut bytes).unwrap_or_else(|error| panic!("{text:?} in {heard:?}: {error}"));
        assert!(count > 0, "closed before {text:?}: {heard:?}");
        heard += std::str::from_utf8(&bytes[..count]).unwrap();
    }
    heard
}

#[test]
fn idle_clients_of_a_full_bus_give_way_and_busy_ones_stay() {
    let server = Server::start(&Workspace::new(""));
    let open = || {
        let mut stream = server.connect();
        stream.write_all(b"< open can0 >").unwrap();
        expect(&mut stream, "< ok >");
        stream
    };
    let mut placed: Vec<_> = (0..8).map(|_| open()).collect();
    placed[0].write_all(b"< echo >").unwrap();
    expect(&mut placed[0], "< echo >");
    let newcomer = open();
    expect(&mut placed[1], "another client takes its place");
    placed.remove(1);
    placed.push(newcomer);
    for stream in &mut placed {
        stream.write_all(b"< echo >").unwrap();
        expect(stream, "< echo >");
    }
}

#[test]
fn silent_and_idle_clients_lock_nobody_out_and_lose_their_places() {
    let server = Server::start(&Workspace::new(""));
    let mut silent: Vec<_> = (0..100).map(|_| server.connect()).collect();
    let idle = (0..33).map(|_| {
        let mut stream = server.connect();
        stream.write_all(b"< echo >").unwrap();
        stream
    });
    let mut idle: Vec<_> = idle.collect();
    expect(&mut idle[0], "others take its place");
    let mut newcomer = server.connect();
    newcomer.write_all(b"< open can0 >").unwrap();
    expect(&mut newcomer, "< ok >");
    for stream in &mut silent {
        // What came is the greeting, and then the end.
        let mut heard = String::new();
        stream.read_to_string(&mut heard).unwrap();
        assert_eq!(heard, "< hi >");
    }
    expect(&mut idle[32], "opened no bus within 5 s");
    newcomer.write_all(b"< echo >").unwrap();
    expect(&mut newcomer, "< echo >");
}

/// A web page can make a browser send this to any port of this machine.
#[test]
fn a_request_of_a_browser_opens_no_bus() {
    let server = Server::start(&Workspace::new(""));
    let mut stream = TcpStream::connect(&server.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let body = "< open can0 >< rawmode >< send 0 2 80 0 >";
    let request = format!("POST / HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/plain\r\n\r\n{body}");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    // The server may reset the connection, since it reads no further.
    let _ = stream.read_to_string(&mut answer);
    assert!(!answer.contains("< ok >"), "{answer}");
}

#[test]
fn a_server_whose_standard_error_is_full_serves_and_ends() {
    // Taken again at once: the server cannot say which port it has.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (_reader, mut pipe) = io::pipe().unwrap();
    rustix::io::ioctl_fionbio(&pipe, true).unwrap();
    while pipe.write(&[b'.'; 4096]).is_ok() {}
    rustix::io::ioctl_fionbio(&pipe, false).unwrap();
    let mut serve = Command::new(MASSETER);
    serve.args(["can", "serve", "--listen", &address.to_string()]).stderr(pipe);
    let mut server = Server { child: serve.spawn().unwrap(), address: address.to_string() };
    wait_until("it listens", || TcpStream::connect(&server.address).is_ok());
    let mut stream = TcpStream::connect(&server.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.write_all(b"< open can0 >").unwrap();
    expect(&mut stream, "< ok >");
    stream.write_all(b"no request >").unwrap();
    expect(&mut stream, "< error text outside");
    kill_process(Pid::from_child(&server.child), Signal::TERM).unwrap();
    wait_until("it ends", || server.child.try_wait().unwrap().is_some());
}

#[test]
fn a_request_that_cannot_be_served_is_an_error_and_keeps_the_connection() {
    let server = Server::start(&Workspace::new(""));
    let mut stream = TcpStream::connect(&server.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    expect(&mut stream, "< hi >");
    for (request, answer) in [
        ("< statistics 1000 >", "< error unknown command"),
        ("< send 0 0 >", "< error open a bus first >"),
        ("< send 800 0 >", "< error identifier"),
        ("< open can0 >", "< ok >"),
    ] {
        stream.write_all(request.as_bytes()).unwrap();
        expect(&mut stream, answer);
    }
    stream.write_all(b"no request >").unwrap();
    expect(&mut stream, "< error text outside");
}

#[test]
fn a_foreign_tool_reads_an_object_of_a_drive_on_two_buses_and_on_one() {
    for scenario in ["", "rate_hz = 500\n[can]\nbuses = [[0, 1, 2, 3, 4, 5]]"] {
        let server = Server::start(&Workspace::new(scenario));
        let mut stream = TcpStream::connect(&server.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        expect(&mut stream, "< hi >");
        stream.write_all(b"< open can0 >").unwrap();
        expect(&mut stream, "< ok >");
        stream.write_all(b"< rawmode >").unwrap();
        expect(&mut stream, "< ok >");
        // The drive answers SDO only after its boot-up message.
        expect(&mut stream, "< frame 701 ");
        // Upload of 1000, the device type, from node 1: a servo drive is 0002_0192h.
        stream.write_all(b"< send 601 8 40 0 10 0 0 0 0 0 >").unwrap();
        expect(&mut stream, "4300100092010200");
    }
}
