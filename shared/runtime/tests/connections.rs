//! Failed connections. Alone in its file: the limit that causes the failures holds for the whole process.

use masseter_runtime::clock;
use masseter_runtime::messages::Event;
use masseter_runtime::transport::{
    FramePublisher, FrameSubscriber, Node, Publisher, ScratchDomain, Subscriber, TransportError,
};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// The error of `connect` when no file may be opened.
fn refused<T>(connect: impl FnOnce() -> Result<T, TransportError>) -> String {
    let before = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: Some(0), ..before }).unwrap();
    let result = connect();
    setrlimit(Resource::Nofile, before).unwrap();
    result.err().map_or_else(String::new, |error| error.to_string())
}

fn assert_tells(told: &str, topic: &str) {
    assert!(
        told.contains(&format!("connecting '{topic}' failed")) && told.contains("masseter doctor"),
        "{told}"
    );
}

#[test]
fn a_refused_connection_is_reported() {
    let domain = ScratchDomain::claim("test-connections").unwrap();
    {
        let node = Node::join(&domain).unwrap();
        let publisher = Publisher::<Event>::open(&node).unwrap();
        let _inlet = Subscriber::<Event>::open(&node).unwrap();
        assert_tells(&refused(|| publisher.connect()), "event");
    }
    {
        let node = Node::join(&domain).unwrap();
        let subscriber = Subscriber::<Event>::open(&node).unwrap();
        let mut publisher = Publisher::<Event>::open(&node).unwrap();
        assert_tells(&refused(|| subscriber.receive()), "event");
        publisher.publish_by(clock::now_ns, |_| {}).unwrap();
        assert_tells(&subscriber.receive().unwrap_err().to_string(), "event");
    }
    {
        let node = Node::join(&domain).unwrap();
        let subscriber = FrameSubscriber::open(&node).unwrap();
        let _outlet = FramePublisher::open(&node).unwrap();
        assert_tells(&refused(|| subscriber.receive()), "frame");
    }
}
