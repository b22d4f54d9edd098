//! Parses and finds addresses: of this machine, and of others, which are for encrypted connections
//! only.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};

use crate::NetError;

/// Addresses that no machine has. Every machine connected to the outside has a route to them.
const DOCUMENTATION_V4: Ipv4Addr = Ipv4Addr::new(192, 0, 2, 1);
const DOCUMENTATION_V6: Ipv6Addr = Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1);

/// Resolves `HOST:PORT` to a loopback address.
///
/// # Errors
/// [`NetError::Address`] if it does not parse or resolve; [`NetError::NotLoopback`] for an address
/// of another machine.
pub fn loopback(text: &str) -> Result<SocketAddr, NetError> {
    let address = any_address(text)?;
    if address.ip().is_loopback() { Ok(address) } else { Err(NetError::NotLoopback(address)) }
}

/// Resolves `HOST:PORT`: to a loopback address if there is one, otherwise to the first.
///
/// # Errors
/// [`NetError::Address`] if it does not parse or resolve.
pub fn any_address(text: &str) -> Result<SocketAddr, NetError> {
    let bad = || NetError::Address(text.to_owned());
    let addresses: Vec<SocketAddr> = text.to_socket_addrs().map_err(|_| bad())?.collect();
    let first = *addresses.first().ok_or_else(bad)?;
    Ok(addresses.into_iter().find(|address| address.ip().is_loopback()).unwrap_or(first))
}

/// Returns the address at which other machines reach a server that listens at `address`. If the
/// server listens at every address, this is the machine's source address towards the outside. In an
/// isolated network, it is the machine's first address in that network.
pub fn seen_from_outside(address: SocketAddr) -> SocketAddr {
    if !address.ip().is_unspecified() {
        return address;
    }
    let ip = own_address_on_the_way_out(address).or_else(|| first_own_address(address));
    SocketAddr::new(ip.unwrap_or(Ipv4Addr::LOCALHOST.into()), address.port())
}

/// Returns this machine's source address towards the outside, of the same family as `address`.
fn own_address_on_the_way_out(address: SocketAddr) -> Option<IpAddr> {
    let (any, outside): (SocketAddr, SocketAddr) = match address {
        SocketAddr::V4(_) => ((Ipv4Addr::UNSPECIFIED, 0).into(), (DOCUMENTATION_V4, 9).into()),
        SocketAddr::V6(_) => ((Ipv6Addr::UNSPECIFIED, 0).into(), (DOCUMENTATION_V6, 9).into()),
    };
    // Connecting a UDP socket sends nothing. The system only chooses a route.
    let socket = UdpSocket::bind(any).ok()?;
    socket.connect(outside).ok()?;
    Some(socket.local_addr().ok()?.ip())
}

/// Returns the first address of this machine that others can reach, of the same family as
/// `address`.
fn first_own_address(address: SocketAddr) -> Option<IpAddr> {
    let interfaces = if_addrs::get_if_addrs().ok()?;
    let reachable =
        interfaces.iter().filter(|found| !found.is_loopback() && !found.is_link_local());
    reachable.map(|found| found.ip()).find(|ip| ip.is_ipv4() == address.is_ipv4())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invitation_names_an_address_that_can_be_reached() {
        let given: SocketAddr = "198.51.100.7:7070".parse().unwrap();
        assert_eq!(seen_from_outside(given), given);
        let own = seen_from_outside("0.0.0.0:7070".parse().unwrap());
        assert!(!own.ip().is_unspecified() && own.port() == 7070, "{own}");
    }

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
