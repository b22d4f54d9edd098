//! The handshake: a peer introduces itself, and the server accepts or refuses it. Its layout is the
//! same in all versions of the protocol.

use crate::{PROTOCOL_VERSION, ProtoError};

/// The first bytes of a hello and of its answer.
pub const MAGIC: [u8; 8] = *b"HOLODECK";
/// Longest name or reason, bytes: a line of text.
pub const MAX_TEXT_BYTES: usize = 512;

/// The role of a process that connects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Role {
    /// Traces packets: `rtworker`.
    Worker = 1,
    /// Shows pictures: `holoview`.
    Display = 2,
    /// Requests reports on the server's state: `holodeck status`.
    Admin = 3,
}

/// The first message of a peer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Its protocol version.
    pub version: u16,
    /// Its role.
    pub role: Role,
    /// The peer's name for people: host and process. Decoding replaces control characters by
    /// spaces, as in all texts.
    pub name: String,
}

/// The server's answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Accepted. A [`crate::control::Control::Welcome`] follows.
    Accepted,
    /// Refused, with the reason for people. The server then closes the connection.
    Refused(String),
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    let mut end = text.len().min(MAX_TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    // At most 512, so it fits `u16`.
    out.extend_from_slice(&(end as u16).to_le_bytes());
    out.extend_from_slice(&text.as_bytes()[..end]);
}

fn take_text(bytes: &[u8]) -> Result<String, ProtoError> {
    let (length, text) = bytes.split_first_chunk::<2>().ok_or(ProtoError::Truncated {
        what: "text",
        needed: 2,
        found: bytes.len() as u64,
    })?;
    let length = usize::from(u16::from_le_bytes(*length));
    if length > MAX_TEXT_BYTES {
        return Err(ProtoError::TooMany {
            what: "text bytes",
            found: length as u64,
            limit: MAX_TEXT_BYTES as u64,
        });
    }
    if text.len() < length {
        return Err(ProtoError::Truncated {
            what: "text",
            needed: length as u64,
            found: text.len() as u64,
        });
    }
    // Bytes after the text are ignored, so that later versions can add some.
    Ok(crate::printable(&String::from_utf8_lossy(&text[..length])))
}

fn take_magic(bytes: &[u8]) -> Result<(u16, u8, &[u8]), ProtoError> {
    let (magic, rest) = bytes.split_first_chunk::<8>().ok_or(ProtoError::NotHolodeck)?;
    if *magic != MAGIC {
        return Err(ProtoError::NotHolodeck);
    }
    match rest {
        [v0, v1, byte, 0, text @ ..] => Ok((u16::from_le_bytes([*v0, *v1]), *byte, text)),
        _ => Err(ProtoError::NotHolodeck),
    }
}

impl Hello {
    /// Returns a hello of this program's version.
    pub fn new(role: Role, name: impl Into<String>) -> Hello {
        Hello { version: PROTOCOL_VERSION, role, name: name.into() }
    }

    /// Returns the hello's bytes: 8 of magic, version `u16`, role `u8`, 0, name length `u16`, name.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        out.extend_from_slice(&self.version.to_le_bytes());
        out.extend_from_slice(&[self.role as u8, 0]);
        put_text(&mut out, &self.name);
        out
    }

    /// Parses a hello of any version. [`Hello::check_version`] compares the version.
    ///
    /// # Errors
    /// [`ProtoError::NotHolodeck`], [`ProtoError::Role`], or a bad name.
    pub fn decode(bytes: &[u8]) -> Result<Hello, ProtoError> {
        let (version, role, text) = take_magic(bytes)?;
        let role = match role {
            1 => Role::Worker,
            2 => Role::Display,
            3 => Role::Admin,
            other => return Err(ProtoError::Role(other)),
        };
        Ok(Hello { version, role, name: take_text(text)? })
    }

    /// Checks that the other side has this program's version.
    ///
    /// # Errors
    /// [`ProtoError::Version`].
    pub fn check_version(&self) -> Result<(), ProtoError> {
        check_version(self.version)
    }
}

fn check_version(theirs: u16) -> Result<(), ProtoError> {
    if theirs == PROTOCOL_VERSION {
        Ok(())
    } else {
        Err(ProtoError::Version { ours: PROTOCOL_VERSION, theirs })
    }
}

impl Answer {
    /// Returns the answer's bytes: 8 of magic, version `u16`, 1 accepted or 0 refused, 0, reason
    /// length `u16`, reason.
    pub fn encode(&self) -> Vec<u8> {
        let (accepted, reason) = match self {
            Answer::Accepted => (1, ""),
            Answer::Refused(reason) => (0, reason.as_str()),
        };
        let mut out = MAGIC.to_vec();
        out.extend_from_slice(&PROTOCOL_VERSION.to_le_bytes());
        out.extend_from_slice(&[accepted, 0]);
        put_text(&mut out, reason);
        out
    }

    /// Parses an answer. An acceptance by a server of another version is an error.
    ///
    /// # Errors
    /// [`ProtoError::NotHolodeck`], [`ProtoError::Version`], or a bad text.
    pub fn decode(bytes: &[u8]) -> Result<Answer, ProtoError> {
        let (version, accepted, text) = take_magic(bytes)?;
        let reason = take_text(text)?;
        match accepted {
            0 => Ok(Answer::Refused(reason)),
            _ => {
                // Later versions may define other answers; this one has none.
                check_version(version)?;
                if accepted == 1 { Ok(Answer::Accepted) } else { Err(ProtoError::NotHolodeck) }
            }
        }
    }
}
