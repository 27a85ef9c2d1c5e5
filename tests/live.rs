//! Runs that are watched while they go on: what watchers see, and that their recordings stay complete.

use std::collections::{BTreeMap, HashSet};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, ChildStderr, ExitStatus, Stdio};
use std::thread;

use crate::common::{Cores, LENIENT, Workspace, assert_played, has_event, masseter, stderr, stdout};
use masseter_recording::{CDR_LITTLE_ENDIAN, Reader, Topic};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::error::{Error, ProtocolError::ResetWithoutClosingHandshake};
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

/// Opcode, subscription and time, before the message itself.
const MESSAGE_HEAD: usize = 13;

/// A run that is shown on a free port.
struct Shown {
    run: Child,
    errors: BufReader<ChildStderr>,
    url: String,
    address: String,
}

impl Shown {
    fn start(cores: &Cores, workspace: &Workspace) -> Self {
        let mut run = workspace.start(cores, &["--live=127.0.0.1:0"]);
        let mut errors = BufReader::new(run.stderr.take().unwrap());
        let mut line = String::new();
        while !line.starts_with("live on ") {
            line.clear();
            assert!(errors.read_line(&mut line).unwrap() > 0, "the run ended before it was shown");
        }
        let url = line.split_whitespace().nth(2).unwrap().to_owned();
        let address = url.split('/').nth(2).unwrap().to_owned();
        Self { run, errors, url, address }
    }

    /// Waits for the end of the run; returns how it ended, and what it said.
    fn finish(mut self) -> (ExitStatus, String) {
        let errors = thread::spawn(move || {
            let mut said = String::new();
            self.errors.read_to_string(&mut said).unwrap();
            said
        });
        let output = self.run.wait_with_output().unwrap();
        (output.status, stdout(&output) + &errors.join().unwrap())
    }
}

/// A client that has received the list of channels.
struct Watcher {
    socket: WebSocket<TcpStream>,
    info: Value,
    channels: Vec<Value>,
}

impl Watcher {
    fn connect(shown: &Shown, protocol: &'static str) -> Self {
        let mut request = shown.url.as_str().into_client_request().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static(protocol));
        let stream = TcpStream::connect(&shown.address).unwrap();
        let (mut socket, _) = tungstenite::client(request, stream).unwrap();
        let info = text(&mut socket);
        let mut advertised = text(&mut socket);
        assert_eq!(advertised["op"], "advertise");
        let Value::Array(channels) = advertised["channels"].take() else { panic!("{advertised}") };
        Self { socket, info, channels }
    }

    /// Subscribes to every channel; its subscription is the channel's id and a hundred.
    fn subscribe_to_all(&mut self) {
        let ids = self.channels.iter().map(|channel| channel["id"].as_u64().unwrap());
        let wanted: Vec<_> = ids.map(|id| json!({"id": id + 100, "channelId": id})).collect();
        self.ask(&json!({"op": "subscribe", "subscriptions": wanted}));
    }

    fn ask(&mut self, request: &Value) {
        self.socket.send(Message::Text(request.to_string().into())).unwrap();
    }

    /// Every message of every topic, until the server says goodbye or gives this client up; whether it has.
    fn watch(mut self) -> (BTreeMap<String, Vec<Vec<u8>>>, bool) {
        let mut seen: BTreeMap<String, Vec<Vec<u8>>> = BTreeMap::new();
        loop {
            match self.socket.read() {
                Ok(Message::Binary(data)) => {
                    assert_eq!(data[0], 1);
                    let id = u32::from_le_bytes(data[1..5].try_into().unwrap()) - 100;
                    let channel = self.channels.iter().find(|channel| channel["id"] == id).unwrap();
                    let topic = channel["topic"].as_str().unwrap();
                    seen.entry(topic.to_owned()).or_default().push(data[MESSAGE_HEAD..].to_vec());
                }
                Ok(Message::Close(_)) => return (seen, false),
                Err(Error::Io(_) | Error::Protocol(ResetWithoutClosingHandshake)) => return (seen, true),
                other => panic!("{other:?}"),
            }
        }
    }
}

fn text(socket: &mut WebSocket<TcpStream>) -> Value {
    serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap()
}

/// Every message on every topic of a workspace's recording.
fn recorded(workspace: &Workspace) -> BTreeMap<String, HashSet<Vec<u8>>> {
    let mut reader = Reader::open(&workspace.run_folder().join("recording.mcap")).unwrap();
    let mut recorded: BTreeMap<String, HashSet<Vec<u8>>> = BTreeMap::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        // Live, each frame is a message of its own.
        for frame in entry.messages().unwrap().iter().filter(|message| message.topic() == Topic::Frame) {
            let bytes = [&CDR_LITTLE_ENDIAN, frame.body()].concat();
            recorded.entry(Topic::Frame.name().to_owned()).or_default().insert(bytes);
        }
        let topic = entry.channel.unwrap().topic.clone();
        recorded.entry(topic).or_default().insert(entry.data);
    }
    recorded
}

#[test]
fn a_watcher_sees_the_channels_and_messages_of_the_recording() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 3.0\n{LENIENT}"));
    let shown = Shown::start(&cores, &workspace);
    let mut watcher = Watcher::connect(&shown, "foxglove.sdk.v1, foxglove.websocket.v1");
    assert_eq!(watcher.info["op"], "serverInfo");
    assert_eq!(watcher.info["capabilities"], json!(["parameters", "parametersSubscribe"]));
    watcher.subscribe_to_all();
    let (seen, is_given_up) = watcher.watch();
    let (status, said) = shown.finish();
    assert_played(&workspace.run_folder(), status, &said);
    assert!(!is_given_up || said.contains("did not read to the end"), "{said}");

    let recorded = recorded(&workspace);
    for topic in ["command", "reading", "state", "truth", "frame"] {
        let seen = &seen[topic];
        assert!(seen.len() > 1000, "{} messages on {topic}", seen.len());
        assert!(seen.iter().all(|message| recorded[topic].contains(message)), "{topic}");
    }
    assert!(seen["/tf"].len() > 100 && seen["/scene"].len() > 50);
}

#[test]
fn a_watcher_sets_a_parameter_and_another_one_sees_the_change() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 3.0\n{LENIENT}"));
    let shown = Shown::start(&cores, &workspace);
    let mut onlooker = Watcher::connect(&shown, "foxglove.sdk.v1");
    let mut setter = Watcher::connect(&shown, "foxglove.sdk.v1");
    let gain = |value: f64| json!({"name": "integral_gain_per_s", "value": value, "type": "float64"});
    onlooker.ask(&json!({"op": "subscribeParameterUpdates", "parameterNames": ["integral_gain_per_s"]}));
    // The answer to a later request shows that the subscription holds.
    onlooker.ask(&json!({"op": "getParameters", "parameterNames": ["integral_gain_per_s"], "id": "0"}));
    while text(&mut onlooker.socket)["id"] != "0" {}
    setter.ask(&json!({"op": "getParameters", "parameterNames": ["integral_gain_per_s"], "id": "1"}));
    assert_eq!(
        text(&mut setter.socket),
        json!({"op": "parameterValues", "parameters": [gain(5.0)], "id": "1"})
    );
    setter.ask(&json!({"op": "setParameters", "parameters": [gain(8.0)], "id": "2"}));
    assert_eq!(
        text(&mut setter.socket),
        json!({"op": "parameterValues", "parameters": [gain(8.0)], "id": "2"})
    );
    while text(&mut onlooker.socket)["parameters"][0] != gain(8.0) {}
    // A refused value is replaced on the client's screen, with the reason.
    setter.ask(&json!({"op": "setParameters", "parameters": [gain(-1.0)]}));
    assert_eq!(text(&mut setter.socket), json!({"op": "parameterValues", "parameters": [gain(8.0)]}));
    let refusal = text(&mut setter.socket);
    assert!(
        refusal["op"] == "status" && refusal["message"].as_str().unwrap().contains("0 to 500"),
        "{refusal}"
    );
    drop([onlooker, setter]);
    let (status, said) = shown.finish();
    assert_played(&workspace.run_folder(), status, &said);
    assert!(has_event(&workspace.summary(), "notice", "parameter_set"));
}

#[test]
fn messages_for_a_watcher_that_does_not_read_are_counted_and_the_recording_is_complete() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 6.0\n{LENIENT}"));
    let shown = Shown::start(&cores, &workspace);
    let mut watcher = Watcher::connect(&shown, "foxglove.websocket.v1");
    watcher.subscribe_to_all();
    let (status, said) = shown.finish();
    assert_played(&workspace.run_folder(), status, &said);
    assert!(said.contains("messages not shown live"), "{said}");
    let proof = masseter(&["recording", "verify", workspace.run_folder().to_str().unwrap()]);
    assert_eq!(proof.status.code(), Some(0), "{}", stdout(&proof));
}

#[test]
fn clients_that_misbehave_or_vanish_disturb_neither_the_recording_nor_other_watchers() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 3.0\n{LENIENT}"));
    let shown = Shown::start(&cores, &workspace);
    let _silent = TcpStream::connect(&shown.address).unwrap();
    let mut browser = TcpStream::connect(&shown.address).unwrap();
    browser.write_all(b"GET / HTTP/1.1\r\nHost: here\r\n\r\n").unwrap();
    let mut deserter = Watcher::connect(&shown, "foxglove.sdk.v1");
    deserter.subscribe_to_all();
    deserter.socket.read().unwrap();
    // What it has not read makes the kernel reset the connection, as the death of its process would.
    drop(deserter);
    let mut chatter = Watcher::connect(&shown, "foxglove.sdk.v1");
    for words in [
        "chat",
        r#"{"op": "getParameters"}"#,
        r#"{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}"#,
    ] {
        chatter.socket.send(Message::Text(words.into())).unwrap();
        assert_eq!(text(&mut chatter.socket)["op"], "status", "{words}");
    }
    chatter.subscribe_to_all();
    let (seen, is_given_up) = chatter.watch();
    assert!(seen["state"].len() > 500);
    let (status, said) = shown.finish();
    assert_played(&workspace.run_folder(), status, &said);
    assert!(!is_given_up || said.contains("did not read to the end"), "{said}");
    let proof = masseter(&["recording", "verify", workspace.run_folder().to_str().unwrap()]);
    assert_eq!(proof.status.code(), Some(0), "{}", stdout(&proof));
}

#[test]
fn a_client_that_sends_without_end_delays_neither_the_recording_nor_the_end() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let shown = Shown::start(&cores, &workspace);
    let mut flooder = Watcher::connect(&shown, "foxglove.sdk.v1");
    // The beginning of a text, and then nothing but its empty continuation.
    flooder.socket.get_mut().write_all(&[0x01, 0x80, 0, 0, 0, 0]).unwrap();
    let flood = [0x00, 0x80, 0, 0, 0, 0].repeat(1 << 16);
    let flooding = thread::spawn(move || while flooder.socket.get_mut().write_all(&flood).is_ok() {});
    let (status, said) = shown.finish();
    assert_played(&workspace.run_folder(), status, &said);
    let proof = masseter(&["recording", "verify", workspace.run_folder().to_str().unwrap()]);
    assert_eq!(proof.status.code(), Some(0), "{}", stdout(&proof));
    flooding.join().unwrap();
}

#[test]
fn a_paused_reader_of_the_progress_costs_no_message_and_delays_no_end() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 12.0\n{LENIENT}"));
    let (errors, mut filler) = io::pipe().unwrap();
    let mut command = workspace.command(&cores, &[]);
    let run = command.stdout(Stdio::piped()).stderr(filler.try_clone().unwrap()).spawn().unwrap();
    let mut errors = BufReader::new(errors);
    let mut line = String::new();
    while !line.contains("motion") {
        line.clear();
        assert!(errors.read_line(&mut line).unwrap() > 0, "the run ended before it was under way");
    }
    // From now on the pipe is full, also when the next line of the progress is due.
    let filling = thread::spawn(move || filler.write_all(&b".".repeat(1 << 20)));
    let output = run.wait_with_output().unwrap();
    drop(errors);
    assert!(filling.join().unwrap().is_err());
    assert_played(&workspace.run_folder(), output.status, &stdout(&output));
    let proof = masseter(&["recording", "verify", workspace.run_folder().to_str().unwrap()]);
    assert_eq!(proof.status.code(), Some(0), "{}", stdout(&proof));
}

#[test]
fn a_live_view_that_cannot_be_served_is_refused_before_the_run_starts() {
    let cores = Cores::take();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("--live={}", taken.local_addr().unwrap());
    let cases: [(&[&str], &str); 2] = [
        (&[&port], "choose another with --live=PORT"),
        (&["--live=somewhere"], "give a port, or an IP address and a port"),
    ];
    for (arguments, words) in cases {
        let workspace = Workspace::new("");
        let output = workspace.run(&cores, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(words), "{arguments:?}: {}", stderr(&output));
        assert!(!workspace.run_folder().exists());
    }
}
