//! A connection that cannot be made. Alone in its file: the limit that refuses it is the whole process's.

use masseter_shared::messages::Event;
use masseter_shared::transport::{Domain, Node};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

#[test]
fn a_connection_that_is_refused_is_told_of() {
    let domain = Domain::named(&format!("test-connections-{}", std::process::id())).unwrap();
    let claim = domain.claim().unwrap();
    {
        let node = Node::join(&domain).unwrap();
        let outlet = node.outlet::<Event>().unwrap();
        let _inlet = node.inlet::<Event>().unwrap();
        let before = getrlimit(Resource::Nofile);
        setrlimit(Resource::Nofile, Rlimit { current: Some(0), ..before }).unwrap();
        let refused = outlet.connect();
        setrlimit(Resource::Nofile, before).unwrap();
        let told = refused.unwrap_err().to_string();
        assert!(told.contains("connecting 'event' failed") && told.contains("masseter doctor"), "{told}");
    }
    drop(claim);
    domain.sweep().unwrap();
}
