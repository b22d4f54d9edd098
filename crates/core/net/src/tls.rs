//! Encrypted connections. The client trusts one certificate, by its fingerprint.

use std::sync::Arc;

use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::TcpStream,
};
use tokio_rustls::{
    TlsConnector,
    client::TlsStream,
    rustls::{
        CertificateError, ClientConfig, DigitallySignedStruct, Error, SignatureScheme,
        client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier},
        crypto::{CryptoProvider, ring::default_provider, verify_tls13_signature},
        pki_types::{CertificateDer, ServerName, UnixTime},
        version::TLS13,
    },
};

use crate::{Identity, NetError, identity::sha256};

/// The half of a connection that is read.
pub(crate) type ReadHalf = Box<dyn AsyncRead + Send + Unpin>;
/// The half of a connection that is written.
pub(crate) type WriteHalf = Box<dyn AsyncWrite + Send + Unpin>;

/// Splits a connection that is not encrypted.
pub(crate) fn plain(stream: TcpStream) -> (ReadHalf, WriteHalf) {
    let (read, write) = stream.into_split();
    (Box::new(read), Box::new(write))
}

/// Splits anything else that carries bytes.
pub(crate) fn split(
    stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static,
) -> (ReadHalf, WriteHalf) {
    let (read, write) = tokio::io::split(stream);
    (Box::new(read), Box::new(write))
}

/// Encrypts a connection, as the server.
pub(crate) async fn serve(
    stream: TcpStream,
    identity: &Identity,
) -> Result<(ReadHalf, WriteHalf), NetError> {
    Ok(split(identity.acceptor().accept(stream).await?))
}

/// Encrypts a connection, as the client, and splits it.
pub(crate) async fn connect(
    stream: TcpStream,
    fingerprint: [u8; 32],
) -> Result<(ReadHalf, WriteHalf), NetError> {
    encrypt_to(stream, fingerprint).await.map(split)
}

/// Encrypts a connection, as the client, if the server's certificate has this fingerprint.
///
/// # Errors
/// [`NetError::Fingerprint`] if it has another one, or another error if the connection breaks.
pub async fn encrypt_to(
    stream: TcpStream,
    fingerprint: [u8; 32],
) -> Result<TlsStream<TcpStream>, NetError> {
    let provider = Arc::new(default_provider());
    let pinned = Arc::new(Pinned { fingerprint, provider: Arc::clone(&provider) });
    let config = ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&TLS13])
        .map_err(std::io::Error::other)?
        .dangerous()
        .with_custom_certificate_verifier(pinned)
        .with_no_client_auth();
    // The fingerprint identifies the certificate. The name in it has no meaning.
    let name = ServerName::try_from("holodeck").map_err(std::io::Error::other)?;
    let connected = TlsConnector::from(Arc::new(config)).connect(name, stream).await;
    connected.map_err(|error| {
        let source = error.get_ref().and_then(|source| source.downcast_ref::<Error>());
        match source {
            Some(Error::InvalidCertificate(_)) => NetError::Fingerprint,
            _ => error.into(),
        }
    })
}

/// Accepts the one certificate with this fingerprint. The proof that the server has the key is
/// checked as usual.
#[derive(Debug)]
struct Pinned {
    fingerprint: [u8; 32],
    provider: Arc<CryptoProvider>,
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _name: &ServerName<'_>,
        _ocsp: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        if sha256(certificate) == self.fingerprint {
            Ok(ServerCertVerified::assertion())
        } else {
            Err(CertificateError::ApplicationVerificationFailure.into())
        }
    }

    fn verify_tls12_signature(
        &self,
        _message: &[u8],
        _certificate: &CertificateDer<'_>,
        _signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        // Neither side supports TLS 1.2.
        Err(CertificateError::BadSignature.into())
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, certificate, signature, algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider.signature_verification_algorithms.supported_schemes()
    }
}
