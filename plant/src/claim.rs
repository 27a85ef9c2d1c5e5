//! One master an interface: two would take each other for a second master, and stop each other's drives.
//!
//! A claim is a name among the abstract sockets. These belong to a network namespace, as interfaces do, and go with
//! their process, however it ends. Masters of other programs and of other computers do not know of it; they are noticed
//! by what they send.

use std::io::ErrorKind;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

use masseter_can::OpenError;

use crate::error::PlantError;

/// The right to be master on an interface.
#[derive(Debug)]
pub(crate) struct Claim {
    _name: UnixDatagram,
}

impl Claim {
    /// Claims an interface.
    pub(crate) fn on(interface: &str) -> Result<Self, PlantError> {
        let name = SocketAddr::from_abstract_name(format!("masseter-master-{interface}"));
        match name.and_then(|name| UnixDatagram::bind_addr(&name)) {
            Ok(name) => Ok(Self { _name: name }),
            Err(error) => {
                let (interface, errno) = (interface.to_owned(), error.raw_os_error().unwrap_or_default());
                Err(match error.kind() {
                    ErrorKind::AddrInUse => PlantError::MasterHere { interface },
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
        let first = Claim::on(&interface).unwrap();
        let refused = Claim::on(&interface).unwrap_err();
        assert_eq!(refused, PlantError::MasterHere { interface: interface.clone() });
        assert!(Claim::on(&format!("{interface}b")).is_ok());
        drop(first);
        assert!(Claim::on(&interface).is_ok());
    }
}
