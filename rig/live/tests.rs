use std::net::TcpStream;
use std::time::Duration;

use masseter_shared::clock;
use masseter_shared::config::JawConfig;
use masseter_shared::geometry::{Mechanism, MechanismConfig};
use masseter_shared::messages::State;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::*;
use masseter_recording::Channel;

fn live() -> Live {
    let scene = Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default());
    Live::start("127.0.0.1:0".parse().unwrap(), scene, "test").unwrap()
}

/// A watcher of the controller's state that has been heard.
fn watcher_of(live: &Live) -> WebSocket<TcpStream> {
    let mut request = live.url().into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("foxglove.sdk.v1"));
    let (mut socket, _) = tungstenite::client(request, TcpStream::connect(live.address).unwrap()).unwrap();
    let channel = Channel::Topic(Topic::State).place();
    let ask = format!(r#"{{"op": "subscribe", "subscriptions": [{{"id": 1, "channelId": {channel}}}]}}"#);
    socket.send(Message::Text(ask.into())).unwrap();
    let is_heard = || live.shared.wanted.load(Ordering::Relaxed) > 0;
    assert!(comes_true(is_heard), "the subscription was not heard");
    socket
}

/// Whether it comes true within a time far longer than that takes.
fn comes_true(is_so: impl Fn() -> bool) -> bool {
    (0..10_000).any(|_| {
        clock::sleep(Duration::from_millis(1));
        is_so()
    })
}

/// Offers messages until there is no room for more; returns how many were offered.
fn offer_until_one_is_dropped(live: &Live) -> u64 {
    let mut offered = 0;
    while live.watched().dropped == 0 {
        assert!(offered < 1_000_000, "there is room for everything");
        for _ in 0..1000 {
            offered += 1;
            live.offer(&Recorded::State(State { seq: offered, ..Default::default() }), offered);
        }
        clock::sleep(Duration::from_millis(10));
    }
    offered
}

#[test]
fn a_watcher_that_reads_in_the_end_gets_everything_but_what_was_counted() {
    let live = live();
    let mut watcher = watcher_of(&live);
    let offered = offer_until_one_is_dropped(&live);
    let reading = thread::spawn(move || {
        let mut seen = 0;
        loop {
            match watcher.read() {
                Ok(Message::Binary(_)) => seen += 1,
                Ok(Message::Text(_)) => {}
                Ok(Message::Close(_)) => return seen,
                other => panic!("{other:?} behind {seen} messages"),
            }
        }
    });
    let missed = live.finish();
    assert_eq!(missed.cut_off, 0);
    assert_eq!(reading.join().unwrap() + missed.dropped, offered);
}

#[test]
fn a_watcher_that_never_reads_is_told_of_and_not_waited_for() {
    let live = live();
    let _watcher = watcher_of(&live);
    offer_until_one_is_dropped(&live);
    assert_eq!(live.finish().cut_off, 1);
}
