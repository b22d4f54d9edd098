//! A machine's own key. A worker proves with it which machine it belongs to, whatever its name.
//!
//! The key is made at the machine's first join, and stays in a file that only its owner can read.
//! The file is named after the host, because several machines may share a home folder.

use std::{
    fmt, fs, io,
    path::{Path, PathBuf},
};

use base64::{Engine, engine::general_purpose::URL_SAFE_NO_PAD};
use holo_proto::proof::{Challenge, MACHINE_KEY_BYTES, MachineProof, machine_statement};
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair, UnparsedPublicKey};

use crate::{
    NetError,
    private_files::{config_folder, random, write_once},
};

/// Bytes of a machine's secret: the seed of an Ed25519 key.
const SEED_BYTES: usize = 32;

/// The public key of a machine, by which servers know it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MachineId(pub [u8; MACHINE_KEY_BYTES]);

impl fmt::Display for MachineId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&URL_SAFE_NO_PAD.encode(self.0))
    }
}

/// The secret key of a machine.
pub struct MachineKey(Ed25519KeyPair);

impl MachineKey {
    /// Reads a host's key in a folder. If there is none, makes one.
    ///
    /// # Errors
    /// [`NetError::Identity`] if it cannot be read or written, or is damaged.
    pub fn open(folder: &Path, host: &str) -> Result<MachineKey, NetError> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
        let host: String = host.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
        let path = folder.join(format!("{host}.key"));
        let fail = |error: String| NetError::Identity(path.clone(), error);
        if !path.exists() {
            let made = fs::create_dir_all(folder).and_then(|()| write_once(&path, &seed()?));
            made.map_err(|error| fail(error.to_string()))?;
        }
        let seed = fs::read(&path).map_err(|error| fail(error.to_string()))?;
        let seed: [u8; SEED_BYTES] =
            seed.try_into().map_err(|_| fail("the machine's key is damaged: remove it".into()))?;
        MachineKey::of_secret(&seed).map_err(|error| fail(error.to_string()))
    }

    /// Makes the key of a machine that no server knows, and that is forgotten with this value.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn new() -> io::Result<MachineKey> {
        MachineKey::of_secret(&seed()?)
    }

    /// Returns the key of this secret.
    ///
    /// # Errors
    /// If the secret cannot be used.
    pub fn of_secret(secret: &[u8; SEED_BYTES]) -> io::Result<MachineKey> {
        let key = Ed25519KeyPair::from_seed_unchecked(secret);
        key.map(MachineKey).map_err(|error| io::Error::other(error.to_string()))
    }

    /// Returns the folder of the keys of the user's machines, if the user has a home.
    pub fn users_folder() -> Option<PathBuf> {
        Some(config_folder()?.join("holodeck/machines"))
    }

    /// Returns the public key.
    pub fn id(&self) -> MachineId {
        let mut id = [0; MACHINE_KEY_BYTES];
        // An Ed25519 key has this length.
        id.copy_from_slice(self.0.public_key().as_ref());
        MachineId(id)
    }

    /// Answers the challenge of a server with this certificate.
    pub(crate) fn prove(
        &self,
        challenge: &Challenge,
        fingerprint: &[u8; 32],
        hello: &[u8],
    ) -> MachineProof {
        let signed = self.0.sign(&machine_statement(challenge, fingerprint, hello));
        let mut signature = [0; 64];
        // So has its signature.
        signature.copy_from_slice(signed.as_ref());
        MachineProof { key: self.id().0, signature }
    }
}

/// Returns the machine that a proof is of, if the proof is right.
pub(crate) fn proven(
    proof: &MachineProof,
    challenge: &Challenge,
    fingerprint: &[u8; 32],
    hello: &[u8],
) -> Option<MachineId> {
    let key = UnparsedPublicKey::new(&ED25519, &proof.key);
    key.verify(&machine_statement(challenge, fingerprint, hello), &proof.signature).ok()?;
    Some(MachineId(proof.key))
}

fn seed() -> io::Result<[u8; SEED_BYTES]> {
    random()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_machine_keeps_its_key_and_hosts_that_share_a_folder_have_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("new/machines");
        let open = |host: &str| MachineKey::open(&place, host);
        let first = open("farm-7.example").unwrap().id();
        assert_eq!(open("farm-7.example").unwrap().id(), first);
        assert_ne!(open("farm-8.example").unwrap().id(), first);
        let odd = open("../../odd").unwrap().id();
        assert_eq!(open("../../odd").unwrap().id(), odd);
        let names: Vec<_> = fs::read_dir(&place).unwrap().map(|entry| entry.unwrap()).collect();
        assert_eq!(names.len(), 3, "nothing is left over, and nothing is outside");
        for entry in &names {
            assert_eq!(entry.metadata().unwrap().permissions().mode() & 0o077, 0);
        }
        fs::write(place.join("farm-7_example.key"), b"short").unwrap();
        let Err(NetError::Identity(at, reason)) = open("farm-7.example") else { panic!() };
        assert!(at.ends_with("farm-7_example.key") && reason.contains("damaged"), "{reason}");
    }

    #[test]
    fn processes_that_start_together_agree_on_a_key() {
        let folder = tempfile::tempdir().unwrap();
        let open = || MachineKey::open(folder.path(), "host").unwrap().id();
        let ids: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..8).map(|_| scope.spawn(open)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
    }

    #[test]
    fn a_proof_holds_for_its_key_challenge_server_and_hello_alone() {
        let key = MachineKey::new().unwrap();
        let (challenge, server, hello) = (Challenge([7; 32]), [8; 32], b"hello");
        let good = key.prove(&challenge, &server, hello);
        assert_eq!(proven(&good, &challenge, &server, hello), Some(key.id()));
        assert_eq!(proven(&good, &Challenge([6; 32]), &server, hello), None, "replayed");
        assert_eq!(proven(&good, &challenge, &[0; 32], hello), None, "passed on by a server");
        assert_eq!(proven(&good, &challenge, &server, b"hullo"), None);
        let other = MachineKey::new().unwrap().id().0;
        let borrowed = MachineProof { key: other, ..good };
        assert_eq!(proven(&borrowed, &challenge, &server, hello), None, "another's key");
    }
}
