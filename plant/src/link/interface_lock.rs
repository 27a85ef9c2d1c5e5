//! One master an interface: two masters would stop each other's drives.
//!
//! The lock is a name among the abstract sockets. Abstract sockets belong to a network namespace, as interfaces do, and
//! end with their process. The lock does not exclude masters of other programs or other computers; the master notices
//! those by their frames.

use std::io::ErrorKind;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

use masseter_can::OpenError;

use crate::error::PlantError;

/// The right to be master on an interface, until it is dropped.
#[derive(Debug)]
pub(super) struct InterfaceLock {
    _name: UnixDatagram,
}

impl InterfaceLock {
    /// Locks an interface.
    pub(super) fn take(interface: &str) -> Result<Self, PlantError> {
        let name = SocketAddr::from_abstract_name(format!("masseter-master-{interface}"));
        match name.and_then(|name| UnixDatagram::bind_addr(&name)) {
            Ok(name) => Ok(Self { _name: name }),
            Err(error) => {
                let (interface, errno) = (interface.to_owned(), error.raw_os_error().unwrap_or_default());
                Err(match error.kind() {
                    ErrorKind::AddrInUse => PlantError::MasterHere(interface),
                    _ => OpenError::Os { interface, errno }.into(),
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_has_one_master_until_it_is_gone() {
        let interface = format!("test{}", std::process::id());
        let first = InterfaceLock::take(&interface).unwrap();
        let refused = InterfaceLock::take(&interface).unwrap_err();
        assert_eq!(refused, PlantError::MasterHere(interface.clone()));
        assert!(InterfaceLock::take(&format!("{interface}b")).is_ok());
        drop(first);
        assert!(InterfaceLock::take(&interface).is_ok());
    }
}
