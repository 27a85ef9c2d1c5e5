//! The cost of recording: every topic at 10 kHz through the real recorder, beside a raw write of the same
//! bytes.
//!
//!     cargo bench --bench recorder
//!
//! A thread with the real time of a run plays the messages of a run under virtual time again and again, at the pace of the
//! clock.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, ensure};
use hdrhistogram::Histogram;
use masseter_machine::SystemRoot;
use masseter_model::geometry::Mechanism;
use masseter_recording::{Reader, Recorded, Recorder, Scene};
use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::lifecycle::Start;
use masseter_runtime::messages::codes::Source;
use masseter_runtime::messages::{Command as CommandMessage, Event, FrameTap, Reading, State, Truth};
use masseter_runtime::named::Declared;
use masseter_runtime::realtime::Cycle;
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_runtime::transport::{FramePublisher, Node, Publisher, ScratchDomain};
use masseter_scenario::Scenario;
use rustix::process::{Pid, Signal, kill_process};

const MASSETER: &str = env!("CARGO_BIN_EXE_masseter");
const RATE_HZ: u64 = 10_000;
const SECONDS: u64 = 10;

fn main() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let cycles = cycles_of_a_run(&folder.path().join("run"))?;
    let recording = folder.path().join("recording.mcap");
    // On a thread of its own: the real time that it asks for ends with it.
    std::thread::scope(|scope| {
        let publisher = scope.spawn(|| through_the_recorder(&cycles, folder.path(), &recording));
        publisher.join().expect("measuring does not panic")
    })?;
    in_process(&cycles, &folder.path().join("again.mcap"))?;
    raw(&cycles, &folder.path().join("raw"))?;
    Ok(())
}

/// The messages of each cycle of ten seconds of chewing.
fn cycles_of_a_run(out: &Path) -> anyhow::Result<Vec<Vec<Recorded>>> {
    let status = Command::new(MASSETER)
        .args(["run", "--clock", "virtual", "--out"])
        .arg(out)
        .stdout(Stdio::null())
        .status()?;
    ensure!(status.success(), "the run under virtual time failed");
    let mut reader = Reader::open(&out.join("recording.mcap"))?;
    let mut cycles: Vec<Vec<Recorded>> = vec![Vec::new()];
    while let Some(message) = reader.next_message()? {
        if matches!(message, Recorded::Reading(_)) {
            cycles.push(Vec::new());
        }
        cycles.last_mut().expect("there is one from the start").push(message);
    }
    // The drives boot in the first cycles; those of the motion are alike.
    Ok(cycles.split_off(1500))
}

/// The messages of a cycle, as a loop that has just computed them has them.
#[derive(Default)]
struct AtHand {
    frames: Vec<FrameTap>,
    others: Vec<Recorded>,
}

impl AtHand {
    fn take(&mut self, cycle: &[Recorded]) {
        self.frames.clear();
        self.others.clear();
        for message in cycle {
            match message {
                Recorded::Frame(frame) => self.frames.push(*frame),
                other => self.others.push(*other),
            }
        }
    }
}

struct Publishers {
    command: Publisher<CommandMessage>,
    reading: Publisher<Reading>,
    state: Publisher<State>,
    truth: Publisher<Truth>,
    frame: FramePublisher,
    /// The controller's, and the plant's.
    events: [Publisher<Event>; 2],
}

impl Publishers {
    fn open(node: &Node) -> anyhow::Result<Self> {
        Ok(Self {
            command: Publisher::open(node)?,
            reading: Publisher::open(node)?,
            state: Publisher::open(node)?,
            truth: Publisher::open(node)?,
            frame: FramePublisher::open(node)?,
            events: [Publisher::open(node)?, Publisher::open(node)?],
        })
    }

    fn publish_cycle(&mut self, AtHand { frames, others }: &AtHand) -> anyhow::Result<()> {
        others.iter().try_for_each(|message| self.publish(message))?;
        Ok(self.frame.publish_by(clock::now_ns, frames.iter().copied())?)
    }

    fn publish(&mut self, message: &Recorded) -> anyhow::Result<()> {
        match message {
            Recorded::Command(message) => {
                self.command.publish_by(clock::now_ns, |place| *place = *message)?;
            }
            Recorded::Reading(message) => {
                self.reading.publish_by(clock::now_ns, |place| *place = *message)?;
            }
            Recorded::State(message) => self.state.publish_by(clock::now_ns, |place| *place = *message)?,
            Recorded::Truth(message) => self.truth.publish_by(clock::now_ns, |place| *place = *message)?,
            // Those of a cycle travel together, and the recorder has this topic from nobody.
            // There is no signal, no parameter and no contact.
            Recorded::Frame(_)
            | Recorded::Machine(_)
            | Recorded::Signals(_)
            | Recorded::Parameters(_)
            | Recorded::Contact(_) => {}
            Recorded::Event(message) => {
                let is_of_controller = message.source == Source::Controller.code();
                self.events[usize::from(!is_of_controller)]
                    .publish_by(clock::now_ns, |place| *place = *message)?;
            }
        }
        Ok(())
    }
}

fn through_the_recorder(cycles: &[Vec<Recorded>], folder: &Path, recording: &Path) -> anyhow::Result<()> {
    let scenario = folder.join("scenario.toml");
    fs::write(&scenario, Scenario::default().to_toml())?;
    let domain = ScratchDomain::claim("bench")?;
    {
        let node = Node::join(&domain)?;
        let mut publishers = Publishers::open(&node)?;
        let mut recorder = start_recorder(&scenario, domain.id(), recording)?;
        let Played { sent, publishing, skipped, took_s } = play(cycles, &mut publishers)?;
        let machine = SystemRoot::of_this_machine();
        let cpu_s = machine.cpu_time_ns(recorder.id()) as f64 / SECOND_NS as f64;
        let memory_kib = peak_memory_kib(&machine, &recorder)?;
        kill_process(Pid::from_child(&recorder), Signal::TERM)?;
        let status = recorder.wait()?;
        ensure!(status.success(), "the recorder ended with {status}");
        let bytes = fs::metadata(recording)?.len();
        let played = RATE_HZ * SECONDS;
        println!(
            "{played} cycles at {RATE_HZ} Hz in {took_s:.2} s, {skipped} deadlines skipped, {sent} messages"
        );
        let [median_ns, p99_ns] = [0.5, 0.99].map(|quantile| publishing.value_at_quantile(quantile));
        println!("  publishing       {median_ns:8} ns a message, median of the cycles (p99 {p99_ns})");
        println!("  recorder           {:8.1} % of a core", cpu_s / took_s * 100.0);
        println!("  recorder's memory  {:8.1} MB at its peak", memory_kib as f64 / 1024.0);
        println!("  recording        {:8.0} bytes a cycle", bytes as f64 / played as f64);
    }
    let proof = Command::new(MASSETER).args(["recording", "verify"]).arg(recording).output()?;
    print!("{}", String::from_utf8_lossy(&proof.stdout));
    ensure!(proof.status.success(), "the recording is not whole: {}", String::from_utf8_lossy(&proof.stderr));
    Ok(())
}

fn start_recorder(scenario: &Path, domain: &str, recording: &Path) -> anyhow::Result<Child> {
    let mut recorder = Command::new(MASSETER)
        .args(["recorder", "--quiet", "--motion-s", "1", "--domain", domain, "--scenario"])
        .arg(scenario)
        .arg("--recording")
        .arg(recording)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut ready = String::new();
    BufReader::new(recorder.stdout.as_mut().context("its output is piped")?).read_line(&mut ready)?;
    let input = recorder.stdin.as_mut().context("its input is piped")?;
    writeln!(
        input,
        "{}",
        serde_json::to_string(&Start {
            epoch_ns: clock::now_ns(),
            loops: [std::process::id(); 2],
            declared: Declared::default()
        })?
    )?;
    Ok(recorder)
}

/// The published messages.
struct Played {
    /// Messages.
    sent: u64,
    /// How long one took, cycle by cycle, ns.
    publishing: Histogram<u64>,
    /// Deadlines that passed before their cycle could be published: it came one later, and all others with it.
    skipped: u64,
    took_s: f64,
}

/// Publishes a cycle at a time by the clock.
fn play(cycles: &[Vec<Recorded>], publishers: &mut Publishers) -> anyhow::Result<Played> {
    let realtime = Scenario::default().realtime;
    let request = SchedulingRequest {
        core: Some(realtime.cores[0]),
        fifo_priority: Some(realtime.priority),
        locked_memory: realtime.lock_memory,
    };
    for refusal in obtain(request).refusals {
        println!("  {refusal}");
    }
    let period_ns = SECOND_NS / RATE_HZ;
    let from_ns = clock::now_ns();
    let mut pace = Cycle::new(from_ns + period_ns, period_ns);
    let (mut sent, mut skipped, mut publishing) = (0, 0, Histogram::new(3)?);
    let mut at_hand = AtHand::default();
    for cycle in cycles.iter().cycle().take((RATE_HZ * SECONDS) as usize) {
        at_hand.take(cycle);
        let wake = pace.wait();
        publishers.publish_cycle(&at_hand)?;
        let messages = cycle.len().max(1) as u64;
        publishing.record((clock::now_ns() - wake.woke_ns) / messages)?;
        sent += cycle.len() as u64;
        skipped = wake.skipped;
    }
    Ok(Played { sent, publishing, skipped, took_s: (clock::now_ns() - from_ns) as f64 / SECOND_NS as f64 })
}

/// The most memory that a process had resident, KiB.
fn peak_memory_kib(machine: &SystemRoot, process: &Child) -> anyhow::Result<u64> {
    let status = machine.text(&format!("proc/{}/status", process.id())).context("the recorder runs")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).context("VmHWM is told")?;
    Ok(line.trim().trim_end_matches(" kB").parse()?)
}

fn in_process(cycles: &[Vec<Recorded>], path: &Path) -> anyhow::Result<()> {
    let scenario = Scenario::default();
    let scene = Scene::new(&Mechanism::new(&scenario.mechanism)?, &scenario.jaw);
    let mut recorder = Recorder::create(path, scene)?;
    let from_ns = clock::now_ns();
    let mut messages = 0;
    for (number, message) in cycles.iter().flatten().enumerate() {
        recorder.record(message, number as u64)?;
        messages += 1;
    }
    recorder.finish()?;
    report("recorded", cycles.len(), messages, clock::now_ns() - from_ns, fs::metadata(path)?.len());
    Ok(())
}

/// The same messages' bytes, one behind the other, as a file takes them.
fn raw(cycles: &[Vec<Recorded>], path: &Path) -> anyhow::Result<()> {
    let mut bytes = Vec::new();
    for message in cycles.iter().flatten() {
        bytes.extend_from_slice(message.body());
    }
    let messages = cycles.iter().map(Vec::len).sum::<usize>() as u64;
    let mut file = File::create_new(path)?;
    let from_ns = clock::now_ns();
    for part in bytes.chunks(1 << 20) {
        file.write_all(part)?;
    }
    file.sync_data()?;
    report("raw write", cycles.len(), messages, clock::now_ns() - from_ns, bytes.len() as u64);
    Ok(())
}

fn report(what: &str, cycles: usize, messages: u64, took_ns: u64, bytes: u64) {
    println!(
        "  {what:<16} {:8.0} ns a message, {:8.0} bytes a cycle",
        took_ns as f64 / messages as f64,
        bytes as f64 / cycles as f64
    );
}
