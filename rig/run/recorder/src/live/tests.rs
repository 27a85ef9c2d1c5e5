use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_recording::{Channel, MachineInfo, Topic};
use masseter_runtime::clock;
use masseter_runtime::messages::State;
use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::{JawConfig, Scenario};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::*;

fn server() -> LiveServer {
    let scene = Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default());
    let listener = listen_on("127.0.0.1:0".parse().unwrap()).unwrap();
    let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
    let manifest = Manifest::new("0.1.0", Scenario::default(), 1.0, "rt", machine);
    LiveServer::start(listener, manifest, scene, Declared::default(), Domain::named("test").unwrap()).unwrap()
}

/// A client whose subscription to the controller's state the server has received.
fn client_of(server: &LiveServer) -> WebSocket<TcpStream> {
    let mut request = server.url().into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("foxglove.sdk.v1"));
    let (mut socket, _) = tungstenite::client(request, TcpStream::connect(server.address).unwrap()).unwrap();
    let channel = Channel::Topic(Topic::State).place();
    let request = format!(r#"{{"op": "subscribe", "subscriptions": [{{"id": 1, "channelId": {channel}}}]}}"#);
    socket.send(Message::Text(request.into())).unwrap();
    let is_subscribed = || server.clients.connected().iter().any(Client::is_subscribed);
    assert!(comes_true(is_subscribed), "the subscription did not arrive");
    socket
}

/// The first line that the server answers to a handshake with these headers.
fn answer_to(server: &LiveServer, path: &str, headers: &str) -> String {
    let mut stream = TcpStream::connect(server.address).unwrap();
    let request = format!(
        "GET {path} HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n{headers}\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line).unwrap();
    line
}

/// The answer to a browser that asks for this path of this host.
fn page_at(server: &LiveServer, path: &str, host: &str) -> String {
    let mut stream = TcpStream::connect(server.address).unwrap();
    stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn a_browser_with_the_secret_gets_the_page_and_no_other_one_does() {
    let server = server();
    let path = format!("/{}", server.secret);
    let page = page_at(&server, &path, "127.0.0.1");
    assert!(page.starts_with("HTTP/1.1 200") && page.trim_end().ends_with("</html>"));
    assert!(page.contains(r#""life":"live""#));
    for (path, host) in [("/", "127.0.0.1"), (&*path, "evil.example")] {
        let answer = page_at(&server, path, host);
        assert!(answer.starts_with("HTTP/1.1 403") && !answer.contains("<html"), "{answer}");
    }
}

#[test]
fn a_page_gets_what_has_changed_since_it_was_made() {
    let server = server();
    assert!(page_at(&server, &format!("/{}", server.secret), "127.0.0.1").contains(r#""number":1"#));
    let url = format!("{}?after=1", server.url());
    let mut request = url.into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("masseter.page.v1"));
    let stream = TcpStream::connect(server.address).unwrap();
    let (mut socket, _) = tungstenite::client(request, stream).unwrap();
    let running = ControllerState::Running.code();
    for cycle in 1..=2000 {
        let times = (cycle * 1_000_000, cycle * 1_000_000 + 1000);
        let state = State {
            seq: cycle,
            cycle,
            due_ns: times.0,
            woke_ns: times.1,
            controller_state: running,
            ..State::default()
        };
        server.offer(&Recorded::State(state), times.1);
    }
    let mut comes = |parts: [&str; 2]| {
        (0..40).any(|_| {
            let message = socket.read().unwrap();
            parts.iter().all(|part| message.to_text().unwrap().contains(part))
        })
    };
    assert!(
        comes([r#""state":"running""#, r#"["controller wake-up","2000""#]),
        "state and table stay as they were"
    );
}

#[test]
fn a_client_without_the_secret_or_of_another_site_is_forbidden() {
    let server = server();
    let host = "Host: 127.0.0.1\r\n";
    let evil = format!("{host}Origin: https://evil.example\r\n");
    let path = format!("/{}", server.secret);
    for (path, headers) in [("/", host), (&path, &evil), (&path, "Host: evil.example\r\n")] {
        let answer = answer_to(&server, path, headers);
        assert!(answer.starts_with("HTTP/1.1 403"), "{path} {headers}: {answer}");
    }
    assert!(answer_to(&server, &path, host).starts_with("HTTP/1.1 101"));
}

/// Threads and resident memory of this process, in MB.
fn held() -> (usize, usize) {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let number = |key| {
        let line = status.lines().find_map(|line| line.strip_prefix(key)).unwrap();
        line.split_whitespace().next().unwrap().parse::<usize>().unwrap()
    };
    (number("Threads:"), number("VmRSS:") / 1024)
}

#[test]
fn connections_without_the_secret_lock_nobody_out_and_hold_nothing() {
    let server = server();
    let clients: Vec<_> = (0..MAX_CLIENTS - 1).map(|_| client_of(&server)).collect();
    let (_, megabytes) = held();
    let connect = || TcpStream::connect(server.address).unwrap();
    // Other tests of this process have clients too, but fewer than a hundred.
    let (threads, _) = held();
    for _ in 0..314 {
        connect().write_all(b"G").unwrap();
    }
    let mut slow: Vec<_> = (0..3 * MAX_NEWCOMERS).map(|_| connect()).collect();
    for _ in 0..100 {
        slow.push(connect());
        answer_to(&server, "/", "Host: 127.0.0.1\r\n");
    }
    assert!(held().0 < threads + 100 && held().1 < megabytes + 100, "{:?}", held());
    // An honest client is served among them, while bytes now and then buy no time.
    let _last = client_of(&server);
    assert!(comes_true(|| server.counts().connected == MAX_CLIENTS));
    for _ in 0..30 {
        for stream in &mut slow {
            // It fails once the server has closed the connection.
            let _ = stream.write_all(b"G");
        }
        clock::sleep(Duration::from_millis(100));
    }
    for stream in &mut slow {
        assert!(!matches!(stream.read(&mut [0]), Ok(1..)), "no byte was for it");
    }
    assert_eq!(server.counts().connected, MAX_CLIENTS);
    drop(clients);
}

#[test]
fn one_client_more_than_there_is_room_for_is_told_so() {
    let server = server();
    let _clients: Vec<_> = (0..MAX_CLIENTS).map(|_| client_of(&server)).collect();
    let path = format!("/{}", server.secret);
    assert!(answer_to(&server, &path, "Host: 127.0.0.1\r\n").starts_with("HTTP/1.1 503"));
}

#[test]
fn a_client_that_never_answers_the_close_keeps_no_place() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let _client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (stream, _) = listener.accept().unwrap();
    stream.set_read_timeout(Some(INTERVAL)).unwrap();
    let closing = thread::spawn(|| Socket::new(stream, Vec::new()).close_after_all());
    assert!(comes_true(|| closing.is_finished()), "the server still waits for the client");
    assert!(closing.join().unwrap().is_err());
}

/// Whether the condition comes true within a generous time.
fn comes_true(is_so: impl Fn() -> bool) -> bool {
    (0..10_000).any(|_| {
        clock::sleep(Duration::from_millis(1));
        is_so()
    })
}

/// Offers messages until one is dropped; returns how many were offered.
fn offer_until_one_is_dropped(server: &LiveServer) -> u64 {
    let mut offered = 0;
    while server.counts().dropped == 0 {
        assert!(offered < 1_000_000, "there is room for everything");
        for _ in 0..1000 {
            offered += 1;
            server.offer(&Recorded::State(State { seq: offered, ..Default::default() }), offered);
        }
        clock::sleep(Duration::from_millis(10));
    }
    offered
}

#[test]
fn a_client_that_reads_in_the_end_gets_everything_but_the_counted_drops() {
    let server = server();
    let mut client = client_of(&server);
    let offered = offer_until_one_is_dropped(&server);
    let reading = thread::spawn(move || {
        let mut received = 0;
        loop {
            match client.read() {
                Ok(Message::Binary(_)) => received += 1,
                Ok(Message::Text(_)) => {}
                Ok(Message::Close(_)) => return received,
                other => panic!("{other:?} behind {received} messages"),
            }
        }
    });
    let losses = server.close_within(Duration::from_secs(10));
    assert_eq!(losses.cut_off, 0);
    assert_eq!(reading.join().unwrap() + losses.dropped, offered);
}

#[test]
fn a_client_that_never_reads_is_counted_and_delays_no_end() {
    let server = server();
    let _client = client_of(&server);
    offer_until_one_is_dropped(&server);
    assert_eq!(server.close().cut_off, 1);
}
