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

/// Locks an interface: the right to be its master, until the socket is dropped.
pub(super) fn lock(interface: &str) -> Result<UnixDatagram, PlantError> {
    let name = SocketAddr::from_abstract_name(format!("masseter-master-{interface}"));
    name.and_then(|name| UnixDatagram::bind_addr(&name)).map_err(|error| {
        let interface = interface.to_owned();
        match error.kind() {
            ErrorKind::AddrInUse => PlantError::MasterHere(interface),
            _ => OpenError::Os { interface, errno: error.raw_os_error().unwrap_or_default() }.into(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_has_one_master_until_it_is_gone() {
        let interface = format!("test{}", std::process::id());
        let first = lock(&interface).unwrap();
        let refused = lock(&interface).unwrap_err();
        assert_eq!(refused, PlantError::MasterHere(interface.clone()));
        assert!(lock(&format!("{interface}b")).is_ok());
        drop(first);
        assert!(lock(&interface).is_ok());
    }
}
