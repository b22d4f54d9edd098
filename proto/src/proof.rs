//! The proofs that a peer on another machine holds a token, and that a worker belongs to a machine.
//! The layouts never change, like those of the handshake.

use crate::ProtoError;

/// Bytes of a token's name.
pub const TOKEN_ID_BYTES: usize = 8;

/// Bytes of a machine's public key (Ed25519).
pub const MACHINE_KEY_BYTES: usize = 32;

/// Server to a worker, or to a peer on another machine: random bytes that were never sent before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Challenge(pub [u8; 32]);

/// The answer to a challenge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Proof {
    /// The token's name.
    pub token: [u8; TOKEN_ID_BYTES],
    /// HMAC-SHA256 over the challenge and the hello's payload, with the token's secret.
    pub mac: [u8; 32],
}

/// A worker's answer to a challenge: its machine, and the proof that it has the machine's key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MachineProof {
    /// The machine's public key.
    pub key: [u8; MACHINE_KEY_BYTES],
    /// The Ed25519 signature of [`machine_statement`] by that key.
    pub signature: [u8; 64],
}

/// Returns what a worker signs. `fingerprint` is the SHA-256 of the server's certificate, or zeros
/// without encryption. So one server cannot use a worker's answer at another one.
pub fn machine_statement(challenge: &Challenge, fingerprint: &[u8; 32], hello: &[u8]) -> Vec<u8> {
    [&b"holodeck machine"[..], &challenge.0, fingerprint, hello].concat()
}

impl Challenge {
    /// Returns the payload.
    pub fn encode(&self) -> Vec<u8> {
        self.0.to_vec()
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// If the payload has a wrong length.
    pub fn decode(bytes: &[u8]) -> Result<Challenge, ProtoError> {
        exactly::<32>("challenge", bytes).map(Challenge)
    }
}

impl Proof {
    /// Returns the payload: the token's name, then the code.
    pub fn encode(&self) -> Vec<u8> {
        [&self.token[..], &self.mac].concat()
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// If the payload has a wrong length.
    pub fn decode(bytes: &[u8]) -> Result<Proof, ProtoError> {
        let (token, mac) = bytes.split_at(bytes.len().min(TOKEN_ID_BYTES));
        Ok(Proof { token: exactly("token", token)?, mac: exactly("proof", mac)? })
    }
}

impl MachineProof {
    /// Returns the payload: the key, then the signature.
    pub fn encode(&self) -> Vec<u8> {
        [&self.key[..], &self.signature].concat()
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// If the payload has a wrong length.
    pub fn decode(bytes: &[u8]) -> Result<MachineProof, ProtoError> {
        let (key, signature) = bytes.split_at(bytes.len().min(MACHINE_KEY_BYTES));
        let key = exactly("machine's key", key)?;
        Ok(MachineProof { key, signature: exactly("machine's signature", signature)? })
    }
}

fn exactly<const N: usize>(what: &'static str, bytes: &[u8]) -> Result<[u8; N], ProtoError> {
    match bytes.len().checked_sub(N) {
        Some(0) | None => bytes.try_into().map_err(|_| ProtoError::Truncated {
            what,
            needed: N as u64,
            found: bytes.len() as u64,
        }),
        Some(more) => Err(ProtoError::Trailing(more)),
    }
}
