//! A server's identity for other machines: its certificate, and the tokens that it accepts. Both
//! are files in a folder that only their owner can read.

use std::{
    fmt, fs, io,
    net::IpAddr,
    path::{Path, PathBuf},
    sync::Arc,
};

use base64::{Engine, engine::general_purpose::URL_SAFE_NO_PAD};
use ring::{digest, hmac};
use tokio::net::TcpStream;
use tokio_rustls::{
    TlsAcceptor,
    rustls::{
        ServerConfig,
        crypto::ring::default_provider,
        pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer, pem::PemObject},
        version::TLS13,
    },
};

use crate::private_files::{config_folder, random, write};
use crate::{NetError, Rights, Token, page_certificate};

/// A connection that a server has encrypted.
pub type EncryptedStream = tokio_rustls::server::TlsStream<TcpStream>;

/// File name of a generated certificate.
const CERTIFICATE: &str = "certificate.der";

/// A server's certificate and tokens.
#[derive(Clone)]
pub struct Identity {
    folder: PathBuf,
    certificate: CertificateDer<'static>,
    acceptor: TlsAcceptor,
}

impl Identity {
    /// Opens the identity in a folder. If the folder has none, makes a certificate and a token with
    /// all rights.
    ///
    /// # Errors
    /// [`NetError::Identity`] if it cannot be read, written or used.
    pub fn open(folder: &Path) -> Result<Identity, NetError> {
        let fail = |error: io::Error| NetError::Identity(folder.to_owned(), error.to_string());
        let (certificate, key) = (folder.join(CERTIFICATE), folder.join("key.der"));
        if !certificate.exists() {
            make_tokens(folder).and_then(|()| make_certificate(folder)).map_err(fail)?;
        }
        let certificate = CertificateDer::from(fs::read(certificate).map_err(fail)?);
        let key = PrivatePkcs8KeyDer::from(fs::read(key).map_err(fail)?);
        Identity::new(folder, vec![certificate], key.into())
            .map_err(|error| NetError::Identity(folder.to_owned(), error))
    }

    /// Opens the identity in a folder for a page at an address, with a certificate that browsers
    /// take: for the names by which the page is reached, and for 397 days. It is renewed when they
    /// change, or when it ends within 30 days.
    ///
    /// # Errors
    /// As [`Identity::open`].
    pub fn for_page(folder: &Path, address: IpAddr) -> Result<Identity, NetError> {
        // Makes the folder and its tokens.
        Identity::open(folder)?;
        let fail = |error: io::Error| NetError::Identity(folder.to_owned(), error.to_string());
        let names = page_certificate::names(address);
        page_certificate::renew(folder, &names, page_certificate::today(), write).map_err(fail)?;
        let read = |name: &str| fs::read(folder.join(name)).map_err(fail);
        let certificate = CertificateDer::from(read(page_certificate::CERTIFICATE)?);
        let key = PrivatePkcs8KeyDer::from(read(page_certificate::KEY)?);
        Identity::new(folder, vec![certificate], key.into())
            .map_err(|error| NetError::Identity(folder.to_owned(), error))
    }

    /// Opens the identity in a folder; `None` if there is none.
    ///
    /// # Errors
    /// As [`Identity::open`].
    pub fn existing(folder: &Path) -> Result<Option<Identity>, NetError> {
        folder.join(CERTIFICATE).exists().then(|| Identity::open(folder)).transpose()
    }

    /// Opens an identity with the owner's certificate. `certificate` is a PEM file of the
    /// certificate, optionally followed by those that sign it. `key` is a PEM file of its key. The
    /// tokens are in `folder`. If there are no tokens, one with all rights is made.
    ///
    /// # Errors
    /// [`NetError::Identity`] if a file cannot be read, written or used, or the key is not the
    /// certificate's.
    pub fn with_certificate(
        folder: &Path,
        certificate: &Path,
        key: &Path,
    ) -> Result<Identity, NetError> {
        let fail = |path: &Path, error: String| NetError::Identity(path.to_owned(), error);
        let chain = CertificateDer::pem_file_iter(certificate).and_then(Iterator::collect);
        let chain: Vec<_> = chain.map_err(|error| fail(certificate, error.to_string()))?;
        let secret = PrivateKeyDer::from_pem_file(key);
        let secret = secret.map_err(|error| fail(key, error.to_string()))?;
        if !folder.join("tokens").exists() {
            make_tokens(folder).map_err(|error| fail(folder, error.to_string()))?;
        }
        Identity::new(folder, chain, secret).map_err(|error| fail(certificate, error))
    }

    /// Returns the identity of a certificate and its key. `chain` is the certificate, followed by
    /// those that sign it. The error says why they cannot be used.
    fn new(
        folder: &Path,
        chain: Vec<CertificateDer<'static>>,
        key: PrivateKeyDer<'static>,
    ) -> Result<Identity, String> {
        let certificate = chain.first().ok_or("it holds no certificate")?.clone();
        let config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_protocol_versions(&[&TLS13])
            .map(|builder| builder.with_no_client_auth())
            .and_then(|builder| builder.with_single_cert(chain, key))
            .map_err(|error| error.to_string())?;
        let acceptor = TlsAcceptor::from(Arc::new(config));
        Ok(Identity { folder: folder.to_owned(), certificate, acceptor })
    }

    /// Returns the folder of the user's own identity, if the user has a home.
    pub fn users_folder() -> Option<PathBuf> {
        let config = config_folder();
        Some(config?.join("holodeck/server"))
    }

    /// Returns the SHA-256 of the certificate.
    pub fn fingerprint(&self) -> [u8; 32] {
        sha256(&self.certificate)
    }

    /// Encrypts a connection that a client has opened.
    ///
    /// # Errors
    /// If the client does not agree on an encryption, or the connection breaks.
    pub async fn encrypt(&self, stream: TcpStream) -> io::Result<EncryptedStream> {
        self.acceptor.accept(stream).await
    }

    pub(crate) fn acceptor(&self) -> &TlsAcceptor {
        &self.acceptor
    }

    /// Returns the tokens and their permissions, the oldest first. They are read from the file each
    /// time, so that a revoked token is useless at once.
    ///
    /// # Errors
    /// [`NetError::Identity`] if they cannot be read.
    pub fn tokens(&self) -> Result<Vec<(Token, Rights)>, NetError> {
        let path = self.tokens_path();
        let fail = |error: String| NetError::Identity(path.clone(), error);
        let text = fs::read_to_string(&path).map_err(|error| fail(error.to_string()))?;
        text.lines()
            .map(|line| {
                let (rights, token) =
                    line.split_once(' ').ok_or_else(|| fail("a line is damaged".into()))?;
                Ok((token.parse()?, rights.parse().map_err(fail)?))
            })
            .collect()
    }

    /// Makes a token.
    ///
    /// # Errors
    /// [`NetError::Identity`] if it cannot be written.
    pub fn add_token(&self, rights: Rights) -> Result<Token, NetError> {
        let mut tokens = self.tokens()?;
        let token = new_token().map_err(|error| self.failed(&error))?;
        tokens.push((token, rights));
        write_tokens(&self.tokens_path(), &tokens).map_err(|error| self.failed(&error))?;
        Ok(token)
    }

    /// Revokes the token of this name. Returns true if there was one.
    ///
    /// # Errors
    /// [`NetError::Identity`] if the others cannot be written.
    pub fn revoke_token(&self, name: &str) -> Result<bool, NetError> {
        let mut tokens = self.tokens()?;
        let before = tokens.len();
        tokens.retain(|(token, _)| token.name() != name);
        if tokens.len() < before {
            write_tokens(&self.tokens_path(), &tokens).map_err(|error| self.failed(&error))?;
        }
        Ok(tokens.len() < before)
    }

    fn failed(&self, error: &io::Error) -> NetError {
        NetError::Identity(self.folder.clone(), error.to_string())
    }

    fn tokens_path(&self) -> PathBuf {
        self.folder.join("tokens")
    }
}

fn make_tokens(folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    write_tokens(&folder.join("tokens"), &[(new_token()?, Rights::Admin)])
}

/// Makes a certificate. It is written last, because its file marks the identity as complete.
fn make_certificate(folder: &Path) -> io::Result<()> {
    let made = rcgen::generate_simple_self_signed(vec!["holodeck".to_owned()]);
    let made = made.map_err(io::Error::other)?;
    write(&folder.join("key.der"), made.signing_key.serialized_der())?;
    write(&folder.join(CERTIFICATE), made.cert.der())
}

/// A secret of 256 random bits, as text that fits into a web address.
#[derive(Clone)]
pub struct Secret(String);

impl Secret {
    /// Returns a new secret.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn new() -> io::Result<Secret> {
        Ok(Secret(URL_SAFE_NO_PAD.encode(random::<32>()?)))
    }

    /// Returns whether `text` is this secret, in a time that does not depend on how much of it is
    /// right.
    pub fn is(&self, text: &str) -> bool {
        sha256(self.0.as_bytes()) == sha256(text.as_bytes())
    }
}

impl fmt::Display for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

fn new_token() -> io::Result<Token> {
    Ok(Token { id: random()?, secret: random()? })
}

pub(crate) fn sha256(bytes: &[u8]) -> [u8; 32] {
    let mut hash = [0; 32];
    hash.copy_from_slice(digest::digest(&digest::SHA256, bytes).as_ref());
    hash
}

/// Returns the key that a token's holder uses in proofs.
pub(crate) fn key(token: &Token) -> hmac::Key {
    hmac::Key::new(hmac::HMAC_SHA256, &token.secret)
}

fn write_tokens(path: &Path, tokens: &[(Token, Rights)]) -> io::Result<()> {
    let lines: String =
        tokens.iter().map(|(token, rights)| format!("{rights} {token}\n")).collect();
    write(path, lines.as_bytes())
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use base64::Engine;

    use super::*;

    #[test]
    fn an_identity_is_made_once_and_read_by_its_owner_alone() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("new/server");
        let first = Identity::open(&place).unwrap();
        let again = Identity::open(&place).unwrap();
        assert_eq!(first.fingerprint(), again.fingerprint());
        assert_eq!(first.tokens().unwrap(), again.tokens().unwrap());
        assert!(matches!(first.tokens().unwrap()[..], [(_, Rights::Admin)]));
        for entry in fs::read_dir(&place).unwrap() {
            let mode = entry.unwrap().metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "nobody else may read it");
        }
        let other = Identity::open(&folder.path().join("other")).unwrap();
        assert_ne!(first.fingerprint(), other.fingerprint());
    }

    fn pem(label: &str, der: &[u8]) -> String {
        let text = base64::engine::general_purpose::STANDARD.encode(der);
        let lines: Vec<_> = text.as_bytes().chunks(64).map(String::from_utf8_lossy).collect();
        format!("-----BEGIN {label}-----\n{}\n-----END {label}-----\n", lines.join("\n"))
    }

    #[test]
    fn an_owners_certificate_is_used_with_its_key_and_with_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let made = |name: &str| {
            let made = rcgen::generate_simple_self_signed(vec!["a.example".to_owned()]).unwrap();
            let key = made.signing_key.serialized_der();
            fs::write(path(name), pem("CERTIFICATE", made.cert.der())).unwrap();
            fs::write(path(&format!("{name}.key")), pem("PRIVATE KEY", key)).unwrap();
            sha256(made.cert.der())
        };
        let (first, _) = (made("first"), made("second"));
        let open = |certificate: &str, key: &str| {
            Identity::with_certificate(&path("tokens of it"), &path(certificate), &path(key))
        };
        let identity = open("first", "first.key").unwrap();
        assert_eq!(identity.fingerprint(), first);
        let tokens = identity.tokens().unwrap();
        assert_eq!(open("first", "first.key").unwrap().tokens().unwrap(), tokens, "they stay");
        for (certificate, key, named) in [
            ("first", "second.key", "first"),
            ("first", "none", "none"),
            ("none", "first.key", "none"),
            ("first.key", "first.key", "first.key"),
            ("first", "first", "first"),
        ] {
            let Err(NetError::Identity(at, reason)) = open(certificate, key) else {
                panic!("{certificate} with {key}");
            };
            assert!(at == path(named) && !reason.is_empty(), "{at:?}: {reason}");
        }
    }

    #[test]
    fn tokens_come_and_go() {
        let folder = tempfile::tempdir().unwrap();
        let identity = Identity::open(folder.path()).unwrap();
        let worker = identity.add_token(Rights::Worker).unwrap();
        assert_eq!(identity.tokens().unwrap()[1], (worker, Rights::Worker));
        assert!(identity.revoke_token(&worker.name()).unwrap());
        assert!(!identity.revoke_token(&worker.name()).unwrap());
        assert_eq!(identity.tokens().unwrap().len(), 1);
        fs::write(folder.path().join("tokens"), "admin nonsense\n").unwrap();
        assert!(identity.tokens().is_err());
    }
}
