//! Addresses: loopback only, until connections are encrypted.

use std::net::{SocketAddr, ToSocketAddrs};

use crate::NetError;

/// Resolves `HOST:PORT` to a loopback address.
///
/// # Errors
/// [`NetError::Address`] if it does not parse or resolve; [`NetError::NotLoopback`] for an address
/// of another machine.
pub fn loopback(text: &str) -> Result<SocketAddr, NetError> {
    let bad = || NetError::Address(text.to_owned());
    let addresses: Vec<SocketAddr> = text.to_socket_addrs().map_err(|_| bad())?.collect();
    let first = *addresses.first().ok_or_else(bad)?;
    addresses
        .into_iter()
        .find(|address| address.ip().is_loopback())
        .ok_or(NetError::NotLoopback(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_is_served() {
        assert_eq!(loopback("127.0.0.1:7070").unwrap().port(), 7070);
        assert!(loopback("[::1]:1").unwrap().ip().is_loopback());
        assert!(matches!(loopback("192.0.2.1:80"), Err(NetError::NotLoopback(_))));
        assert!(matches!(loopback("0.0.0.0:80"), Err(NetError::NotLoopback(_))));
        for bad in ["", "7070", "127.0.0.1", "127.0.0.1:70700"] {
            assert!(matches!(loopback(bad), Err(NetError::Address(_))), "{bad}");
        }
    }
}
