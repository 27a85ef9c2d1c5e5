use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use masseter_recording::{Channel, Topic};
use masseter_shared::clock;
use masseter_shared::config::JawConfig;
use masseter_shared::geometry::{Mechanism, MechanismConfig};
use masseter_shared::messages::State;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::*;

fn server() -> FoxgloveServer {
    let scene = Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default());
    let listener = Listener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    FoxgloveServer::start(listener, scene, Declared::default(), Domain::named("test").unwrap()).unwrap()
}

/// A client whose subscription to the controller's state the server has received.
fn client_of(server: &FoxgloveServer) -> WebSocket<TcpStream> {
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
fn answer_to(server: &FoxgloveServer, path: &str, headers: &str) -> String {
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

#[test]
fn connections_without_the_secret_lock_nobody_out_and_end() {
    let server = server();
    let mut slow: Vec<_> =
        (0..3 * MAX_NEWCOMERS).map(|_| TcpStream::connect(server.address).unwrap()).collect();
    let clients: Vec<_> = (0..MAX_CLIENTS).map(|_| client_of(&server)).collect();
    assert!(comes_true(|| server.counts().connected == MAX_CLIENTS));
    // Bytes now and then buy no time.
    for _ in 0..7 {
        for stream in &mut slow {
            // It fails once the server has closed the connection.
            let _ = stream.write_all(b"G");
        }
        clock::sleep(Duration::from_secs(1));
    }
    for stream in &mut slow {
        assert!(!matches!(stream.read(&mut [0]), Ok(1..)), "no byte was for it");
    }
    assert_eq!(server.counts().connected, MAX_CLIENTS);
    drop(clients);
}

/// Whether the condition comes true within a generous time.
fn comes_true(is_so: impl Fn() -> bool) -> bool {
    (0..10_000).any(|_| {
        clock::sleep(Duration::from_millis(1));
        is_so()
    })
}

/// Offers messages until one is dropped; returns how many were offered.
fn offer_until_one_is_dropped(server: &FoxgloveServer) -> u64 {
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
    let losses = server.finish();
    assert_eq!(losses.cut_off, 0);
    assert_eq!(reading.join().unwrap() + losses.dropped, offered);
}

#[test]
fn a_client_that_never_reads_is_counted_and_delays_no_end() {
    let server = server();
    let _client = client_of(&server);
    offer_until_one_is_dropped(&server);
    assert_eq!(server.finish().cut_off, 1);
}
