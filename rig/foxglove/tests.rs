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
    FoxgloveServer::start("127.0.0.1:0".parse().unwrap(), scene, "test").unwrap()
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
