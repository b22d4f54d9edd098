//! Joining strings: the address of a server, and the secrets by which both sides prove their
//! identity. A server prints its string.
//!
//! Between machines, the string is `holodeck://HOST:PORT/FINGERPRINT/TOKEN`. The fingerprint is the
//! SHA-256 of the server's certificate, and the token is a name and a secret. Both are base64 for
//! URLs. On one machine, `HOST:PORT` is enough.

use std::{fmt, net::SocketAddr, str::FromStr};

use base64::{Engine, engine::general_purpose::URL_SAFE_NO_PAD};
use holo_proto::{hello::Role, proof::TOKEN_ID_BYTES};

use crate::{MachineId, NetError, loopback};

/// The beginning of a joining string.
const SCHEME: &str = "holodeck://";

/// Bytes of a token's secret.
pub(crate) const SECRET_BYTES: usize = 32;

/// The rights of a token's holder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rights {
    /// Everything: trace, view, and request the server's status.
    Admin,
    /// Trace and view; the server traces for the holder. The string that a server prints has these
    /// rights.
    Member,
    /// Trace.
    Worker,
    /// View; the server traces for the holder.
    Display,
    /// View stored samples, and samples that are traced for others.
    ReadOnly,
}

impl Rights {
    /// All rights, by name.
    const ALL: [(&'static str, Rights); 5] = [
        ("admin", Rights::Admin),
        ("member", Rights::Member),
        ("worker", Rights::Worker),
        ("display", Rights::Display),
        ("read-only", Rights::ReadOnly),
    ];

    /// Returns true if a peer with these rights may have this role.
    pub fn permits(self, role: Role) -> bool {
        match role {
            Role::Worker => matches!(self, Rights::Admin | Rights::Member | Rights::Worker),
            Role::Display => self != Rights::Worker,
            Role::Admin => self == Rights::Admin,
        }
    }
}

impl fmt::Display for Rights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Rights::ALL.iter().find(|(_, rights)| rights == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}

impl FromStr for Rights {
    type Err = String;

    fn from_str(text: &str) -> Result<Rights, String> {
        let found = Rights::ALL.iter().find(|(name, _)| *name == text);
        found.map(|(_, rights)| *rights).ok_or_else(|| {
            format!("`{text}` is no role; write admin, member, worker, display or read-only")
        })
    }
}

/// The rights of a peer, and their origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Access {
    /// The peer's rights.
    pub rights: Rights,
    /// The name of the peer's token; `None` on this machine.
    pub token: Option<String>,
    /// The machine that a worker has proven to belong to; `None` for other roles.
    pub machine: Option<MachineId>,
}

impl Access {
    /// Returns the access of a peer on the server's machine: all rights.
    pub fn of_this_machine(machine: Option<MachineId>) -> Access {
        Access { rights: Rights::Admin, token: None, machine }
    }
}

/// A token: a name and a secret.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Token {
    pub(crate) id: [u8; TOKEN_ID_BYTES],
    pub(crate) secret: [u8; SECRET_BYTES],
}

impl Token {
    /// Returns the token's name, for people.
    pub fn name(&self) -> String {
        URL_SAFE_NO_PAD.encode(self.id)
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&URL_SAFE_NO_PAD.encode([&self.id[..], &self.secret].concat()))
    }
}

impl FromStr for Token {
    type Err = NetError;

    fn from_str(text: &str) -> Result<Token, NetError> {
        let bytes = URL_SAFE_NO_PAD.decode(text).map_err(|_| NetError::Invitation("token"))?;
        let token = bytes
            .split_first_chunk()
            .and_then(|(id, secret)| Some(Token { id: *id, secret: secret.try_into().ok()? }));
        token.ok_or(NetError::Invitation("token"))
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Token({})", self.name())
    }
}

/// An invitation to a server on another machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Invitation {
    /// `HOST:PORT`.
    pub address: String,
    /// SHA-256 of the server's certificate.
    pub fingerprint: [u8; 32],
    /// The token of the invited peer.
    pub token: Token,
}

impl fmt::Display for Invitation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fingerprint = URL_SAFE_NO_PAD.encode(self.fingerprint);
        write!(f, "{SCHEME}{}/{fingerprint}/{}", self.address, self.token)
    }
}

impl FromStr for Invitation {
    type Err = NetError;

    fn from_str(text: &str) -> Result<Invitation, NetError> {
        let rest = text.trim().strip_prefix(SCHEME).ok_or(NetError::Invitation("beginning"))?;
        let mut parts = rest.split('/');
        let (Some(address), Some(fingerprint), Some(token), None) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(NetError::Invitation("number of parts"));
        };
        let port = address.rsplit_once(':').and_then(|(_, port)| port.parse::<u16>().ok());
        if port.is_none() {
            return Err(NetError::Invitation("address"));
        }
        let fingerprint = URL_SAFE_NO_PAD.decode(fingerprint).ok();
        let fingerprint = fingerprint.and_then(|bytes| bytes.try_into().ok());
        Ok(Invitation {
            address: address.to_owned(),
            fingerprint: fingerprint.ok_or(NetError::Invitation("fingerprint"))?,
            token: token.parse()?,
        })
    }
}

/// A server to connect to.
#[derive(Clone, Debug)]
pub enum Destination {
    /// A server on this machine.
    Loopback(SocketAddr),
    /// A server on another machine, by invitation.
    Invited(Box<Invitation>),
}

impl Destination {
    /// Parses `HOST:PORT` of this machine, or a joining string.
    ///
    /// # Errors
    /// As [`loopback`]; [`NetError::Invitation`] for a joining string that is damaged.
    pub fn parse(text: &str) -> Result<Destination, NetError> {
        if text.trim().starts_with(SCHEME) {
            return Ok(Destination::Invited(Box::new(text.parse()?)));
        }
        loopback(text).map(Destination::Loopback)
    }
}

impl From<SocketAddr> for Destination {
    fn from(address: SocketAddr) -> Destination {
        Destination::Loopback(address)
    }
}

impl fmt::Display for Destination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Destination::Loopback(address) => address.fmt(f),
            Destination::Invited(invitation) => f.write_str(&invitation.address),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invitation_survives_its_text_form_and_damage_names_the_wrong_part() {
        let token = Token { id: *b"12345678", secret: [0xfe; 32] };
        let invitation =
            Invitation { address: "[fe80::1]:7070".into(), fingerprint: [0xab; 32], token };
        let text = invitation.to_string();
        assert_eq!(text.parse::<Invitation>().unwrap(), invitation);
        assert_eq!(format!(" {text}\n").parse::<Invitation>().unwrap(), invitation, "pasted");
        assert!(!format!("{invitation:?}").contains("7v7"), "a secret is not printed by chance");
        for (damaged, part) in [
            (text.replace("holodeck:", "http:"), "beginning"),
            (text[..text.len() - 1].to_owned(), "token"),
            (text.replace(":7070", ""), "address"),
            (text.replace("/q6ur", "/q6u"), "fingerprint"),
            (format!("{text}/"), "number of parts"),
        ] {
            let error = damaged.parse::<Invitation>().unwrap_err();
            assert!(matches!(error, NetError::Invitation(found) if found == part), "{error}");
        }
        assert!(matches!(Destination::parse(&text), Ok(Destination::Invited(_))));
        assert!(matches!(Destination::parse("127.0.0.1:1"), Ok(Destination::Loopback(_))));
        assert!(matches!(Destination::parse("192.0.2.1:1"), Err(NetError::NotLoopback(_))));
    }

    #[test]
    fn rights_permit_roles() {
        let allowed = |rights: Rights| {
            [Role::Worker, Role::Display, Role::Admin].map(|role| rights.permits(role))
        };
        assert_eq!(allowed(Rights::Admin), [true, true, true]);
        assert_eq!(allowed(Rights::Member), [true, true, false]);
        assert_eq!(allowed(Rights::Worker), [true, false, false]);
        assert_eq!(allowed(Rights::Display), [false, true, false]);
        assert_eq!(allowed(Rights::ReadOnly), [false, true, false]);
        for (name, rights) in Rights::ALL {
            assert_eq!((rights.to_string().as_str(), name.parse()), (name, Ok(rights)));
        }
        assert!("root".parse::<Rights>().is_err());
    }
}
