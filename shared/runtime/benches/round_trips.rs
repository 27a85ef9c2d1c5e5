//! A command to another process and a reading back. Both processes poll:
//! `cargo bench -p masseter-runtime --bench round_trips`.
//!
//! The bench compares the rig's transport with bare iceoryx2 and the same messages, and with a polled Unix socket (128
//! bytes). The lower bound is one cache line that two threads on the same cores write in turn. The channels take turns,
//! because a machine changes its speed from second to second: the ratio within a round counts. The bench does not
//! measure a wait for a socket in the kernel, which takes about fifty times as long.

use std::error::Error;
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::{Child, Command as Program, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::{env, thread};

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::messages::{Command, Message, Reading};
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_runtime::transport::{Domain, Node, Publisher, ScratchDomain, Subscriber, Topic};
use rustix::process::{Signal, set_parent_process_death_signal};

type Failable<T> = Result<T, Box<dyn Error + Send + Sync>>;

const ROUNDS: usize = 5;
/// Round trips per round; few enough that real-time throttling never stops the polling threads.
const ROUND_TRIPS: u64 = 20_000;
/// Round trips before the measurement.
const WARM_UP: u64 = 1_000;
const LAST: u64 = WARM_UP + ROUND_TRIPS;
/// Longest wait for an answer, ns. A longer wait ends the bench.
const TIMEOUT_NS: u64 = 10 * SECOND_NS;
/// Cores of the asking and of the answering side.
const CORES: [usize; 2] = [0, 1];
/// SCHED_FIFO priority, as in a run.
const PRIORITY: u8 = 80;
/// Bytes of a message on the socket; it begins with its number.
const SOCKET_BYTES: usize = 128;

/// The channels for the numbers; the bench compares the first with the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Channel {
    Rig,
    Iceoryx2,
    Socket,
    CacheLine,
}

impl Channel {
    const ALL: [Self; 4] = [Self::Rig, Self::Iceoryx2, Self::Socket, Self::CacheLine];

    fn name(self) -> &'static str {
        match self {
            Self::Rig => "masseter",
            Self::Iceoryx2 => "bare iceoryx2",
            Self::Socket => "Unix socket",
            Self::CacheLine => "cache line",
        }
    }

    fn open<Sent: Numbered, Got: Numbered>(self, domain: &Domain, socket: UnixStream) -> Failable<Ends> {
        match self {
            Self::Rig => rig_ends::<Sent, Got>(&Node::join(domain)?),
            Self::Iceoryx2 => bare_ends::<Sent, Got>(&Node::join(domain)?),
            Self::Socket => socket_ends(socket),
            Self::CacheLine => Err("threads exchange a cache line, not processes".into()),
        }
    }

    /// The round trips of one round, ns, sorted. The other process starts from an ordinary thread. From a real-time
    /// thread it inherits core and priority, and gets no time while that thread polls.
    fn measure(self) -> Failable<Vec<u64>> {
        if self == Self::CacheLine {
            return on_a_cache_line();
        }
        let domain = ScratchDomain::claim("bench")?;
        let (own, peer) = UnixStream::pair()?;
        let _peer = Peer::start(self, domain.id(), OwnedFd::from(peer).into())?;
        on_core(CORES[0], || {
            let Ends { send, receive } = self.open::<Command, Reading>(&domain, own)?;
            timed(send, receive)
        })
    }
}

/// The ends of a channel in one process.
struct Ends {
    send: Box<dyn FnMut(u64) -> Failable<()>>,
    receive: Box<dyn FnMut() -> Failable<Option<u64>>>,
}

/// A message that can carry the number of a round trip.
trait Numbered: Topic {
    fn number(&self) -> u64;
    fn set_number(&mut self, number: u64);
}

impl Numbered for Command {
    fn number(&self) -> u64 {
        self.cycle
    }
    fn set_number(&mut self, number: u64) {
        self.cycle = number;
    }
}

impl Numbered for Reading {
    fn number(&self) -> u64 {
        self.cycle
    }
    fn set_number(&mut self, number: u64) {
        self.cycle = number;
    }
}

fn rig_ends<Sent: Numbered, Got: Numbered>(node: &Node) -> Failable<Ends> {
    let mut publisher: Publisher<Sent> = Publisher::open(node)?;
    let subscriber: Subscriber<Got> = Subscriber::of_newest(node)?;
    Ok(Ends {
        send: Box::new(move |number| {
            Ok(publisher.publish_by(clock::now_ns, |message| message.set_number(number))?)
        }),
        receive: Box::new(move || Ok(subscriber.receive()?.map(|message| message.number()))),
    })
}

fn bare_ends<Sent: Numbered, Got: Numbered>(node: &Node) -> Failable<Ends> {
    let publisher = bare_topic::<Sent>(node)?
        .publisher_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()?;
    let subscriber = bare_topic::<Got>(node)?.subscriber_builder().create()?;
    Ok(Ends {
        send: Box::new(move |number| {
            let mut sample = publisher.loan()?;
            sample.payload_mut().set_number(number);
            sample.send()?;
            Ok(())
        }),
        receive: Box::new(move || Ok(subscriber.receive()?.map(|sample| sample.payload().number()))),
    })
}

/// A topic with iceoryx2's defaults, except that it never blocks the sender.
fn bare_topic<M: Message>(node: &Node) -> Failable<PortFactory<ipc::Service, M, ()>> {
    let builder = node.iceoryx().service_builder(&M::TOPIC.try_into()?).publish_subscribe::<M>();
    Ok(builder.enable_safe_overflow(true).open_or_create()?)
}

/// Polled without blocking.
fn socket_ends(mut input: UnixStream) -> Failable<Ends> {
    input.set_nonblocking(true)?;
    let mut output = input.try_clone()?;
    let mut message = [0; SOCKET_BYTES];
    Ok(Ends {
        send: Box::new(move |number| {
            message[..8].copy_from_slice(&number.to_ne_bytes());
            // At most one message is under way, so the socket always has room.
            let taken = output.write(&message)?;
            if taken == SOCKET_BYTES { Ok(()) } else { Err("the socket took only part of a message".into()) }
        }),
        receive: Box::new(move || match input.read(&mut message) {
            Ok(SOCKET_BYTES) => Ok(message.first_chunk().map(|number| u64::from_ne_bytes(*number))),
            Ok(_) => Err("the other side has gone".into()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(None),
            Err(error) => Err(error.into()),
        }),
    })
}

/// Times the way of every number to the other side and back; sorted, ns.
fn timed(
    mut send: impl FnMut(u64) -> Failable<()>,
    mut receive: impl FnMut() -> Failable<Option<u64>>,
) -> Failable<Vec<u64>> {
    let mut taken_ns = Vec::with_capacity(ROUND_TRIPS as usize);
    for number in 1..=LAST {
        let from_ns = clock::now_ns();
        send(number)?;
        let answer = poll(&mut receive)?;
        let round_trip_ns = clock::now_ns() - from_ns;
        assert_eq!(answer, number, "the answer has the number of the question");
        if number > WARM_UP {
            taken_ns.push(round_trip_ns);
        }
    }
    taken_ns.sort_unstable();
    Ok(taken_ns)
}

/// Polls for the next number; reads the clock once in 10,000 attempts.
fn poll(receive: &mut impl FnMut() -> Failable<Option<u64>>) -> Failable<u64> {
    let mut give_up_ns = None;
    loop {
        for _ in 0..10_000 {
            if let Some(number) = receive()? {
                return Ok(number);
            }
            std::hint::spin_loop();
        }
        let now_ns = clock::now_ns();
        if now_ns > *give_up_ns.get_or_insert(now_ns + TIMEOUT_NS) {
            return Err("the other side of the channel does not answer".into());
        }
    }
}

/// Alone on its cache line and on the line that the processor fetches with it.
#[repr(align(128))]
struct Line(AtomicU64);

/// One thread writes odd numbers, the other answers with the even ones.
fn on_a_cache_line() -> Failable<Vec<u64>> {
    let line = &Line(AtomicU64::new(0));
    let write = |value| line.0.store(value, Ordering::Release);
    let read = |parity| {
        let value = line.0.load(Ordering::Acquire);
        Ok((value % 2 == parity).then_some(value.div_ceil(2)))
    };
    thread::scope(|scope| {
        scope.spawn(move || {
            realtime_on(CORES[1]);
            for _ in 1..=LAST {
                // The other side fails for the same reason, and returns the error.
                let Ok(number) = poll(&mut || read(1)) else { break };
                write(2 * number);
            }
        });
        on_core(CORES[0], || {
            let ask = |number| {
                write(2 * number - 1);
                Ok(())
            };
            timed(ask, || read(0))
        })
    })
}

fn realtime_on(core: usize) {
    obtain(SchedulingRequest { core: Some(core), fifo_priority: Some(PRIORITY), locked_memory: true });
}

fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let thread = scope.spawn(|| {
            realtime_on(core);
            work()
        });
        thread.join().expect("measuring does not panic")
    })
}

/// This executable as the other side; killed when dropped.
struct Peer(Child);

impl Peer {
    /// Waits until its end of the channel is open.
    fn start(channel: Channel, domain: &str, socket: Stdio) -> Failable<Self> {
        let mut program = Program::new(env::current_exe()?);
        program.args(["--answer", channel.name(), domain]).stdin(socket).stdout(Stdio::piped());
        let mut peer = Self(program.spawn()?);
        peer.0.stdout.as_mut().expect("standard output is piped").read_exact(&mut [0])?;
        Ok(peer)
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The process may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Sends every number back, until the process is killed or the channel closes. The socket is standard input.
fn answer(channel: &str, domain: &str) -> Failable<()> {
    set_parent_process_death_signal(Some(Signal::KILL))?;
    realtime_on(CORES[1]);
    let channel = Channel::ALL.into_iter().find(|known| known.name() == channel).ok_or("no such channel")?;
    let socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let Ends { mut send, mut receive } = channel.open::<Reading, Command>(&Domain::named(domain)?, socket)?;
    io::stdout().write_all(b"\n")?;
    io::stdout().flush()?;
    loop {
        send(poll(&mut receive)?)?;
    }
}

/// A value of every round as text: median (least–most).
fn spread(mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    format!("{:.2} ({:.2}–{:.2})", values[values.len() / 2], values[0], values[values.len() - 1])
}

fn main() -> Failable<()> {
    let arguments: Vec<String> = env::args().collect();
    if let [_, mode, channel, domain] = &arguments[..]
        && mode == "--answer"
    {
        return answer(channel, domain);
    }
    let mut rounds = [const { Vec::new() }; Channel::ALL.len()];
    for round in 0..ROUNDS {
        for turn in 0..Channel::ALL.len() {
            let at = (round + turn) % Channel::ALL.len();
            rounds[at].push(Channel::ALL[at].measure()?);
        }
    }
    let quantile = |round: &[u64], share: f64| round[(round.len() as f64 * share) as usize] as f64 / 1000.0;
    println!("round trip, µs: median (least–most) of {ROUNDS} rounds");
    for (channel, own) in Channel::ALL.iter().zip(&rounds) {
        let [p50, p99] =
            [0.5, 0.99].map(|share| spread(own.iter().map(|round| quantile(round, share)).collect()));
        let pairs = rounds[0].iter().zip(own);
        let ratio = spread(pairs.map(|(rig, own)| quantile(rig, 0.5) / quantile(own, 0.5)).collect());
        println!("{:<14} p50 {p50}, p99 {p99}; masseter takes {ratio} times as long", channel.name());
    }
    Ok(())
}
