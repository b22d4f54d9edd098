//! Where the page is served: to this machine as it is, to other machines encrypted and with a
//! token.
//!
//! Invariants:
//! - Nothing reaches another machine without encryption, or a client without the token.
//! - A client that does not finish its encryption handshake delays nobody. Unfinished handshakes
//!   are bounded in number and time.

use std::{collections::VecDeque, io, net::SocketAddr, path::Path};

use anyhow::{Context, Result, ensure};
use axum::{Router, serve::Listener};
use holo_net::{EncryptedStream, HANDSHAKE_TIME, Identity, Secret};
use tokio::{
    net::TcpListener,
    sync::mpsc,
    task::{AbortHandle, spawn_blocking},
    time::timeout,
};

use super::{
    connections::{Bounded, Visitor},
    guard::EntryGuard,
};

/// Most unfinished handshakes. A further client ends the oldest one.
const MOST_HANDSHAKES: usize = 64;

/// A socket for the page's clients.
pub struct PageSocket {
    listener: TcpListener,
    outside: Option<Outside>,
}

/// What clients on other machines need.
struct Outside {
    identity: Identity,
    token: Secret,
}

impl PageSocket {
    /// Listens at an address. For an address of other machines, it opens the certificate of the
    /// user's pages or the one in `own`, a PEM file and that of its key.
    ///
    /// # Errors
    /// If the address is not free, or the certificate cannot be made or read.
    pub async fn open(address: &str, own: Option<(&Path, &Path)>) -> Result<PageSocket> {
        let address = holo_net::any_address(address)?;
        if address.ip().is_loopback() {
            ensure!(
                own.is_none(),
                "--http-cert is for other machines, and {address} is this machine alone: say \
                 --http 0.0.0.0:{}",
                address.port()
            );
            return Ok(PageSocket { listener: bind(address).await?, outside: None });
        }
        let folder = Identity::users_folder();
        let folder = folder.context("the user has no home folder for the page's certificate")?;
        let own = own.map(|(certificate, key)| (certificate.to_owned(), key.to_owned()));
        let open = move || match own {
            Some((certificate, key)) => Identity::with_certificate(&folder, &certificate, &key),
            None => Identity::for_page(&folder, address.ip()),
        };
        PageSocket::outside(address, spawn_blocking(open).await??).await
    }

    /// Listens at an address for clients on other machines.
    pub(super) async fn outside(address: SocketAddr, identity: Identity) -> Result<PageSocket> {
        let token = Secret::new().context("making the page's token")?;
        Ok(PageSocket {
            listener: bind(address).await?,
            outside: Some(Outside { identity, token }),
        })
    }

    /// Returns the page's address. For other machines it contains the token.
    pub fn url(&self) -> Result<String> {
        let address = self.listener.local_addr().context("the page's address")?;
        Ok(match &self.outside {
            None => format!("http://{address}/"),
            Some(Outside { token, .. }) => {
                format!("https://{}/?token={token}", holo_net::seen_from_outside(address))
            }
        })
    }

    /// Returns the SHA-256 of the certificate, as browsers show it. `None` without encryption.
    pub fn fingerprint(&self) -> Option<String> {
        let Outside { identity, .. } = self.outside.as_ref()?;
        let bytes = identity.fingerprint().map(|byte| format!("{byte:02X}"));
        Some(bytes.join(":"))
    }

    /// Returns who may enter.
    pub fn gate(&self) -> Result<EntryGuard> {
        let port = self.listener.local_addr().context("the page's address")?.port();
        Ok(match &self.outside {
            None => EntryGuard::Here { port },
            Some(Outside { token, .. }) => EntryGuard::Outside { port, token: token.clone() },
        })
    }

    /// Serves pages until the future is dropped.
    pub async fn serve(self, router: Router) -> Result<()> {
        match self.outside {
            None => {
                let service = router.into_make_service_with_connect_info::<Visitor>();
                axum::serve(Bounded::new(self.listener), service).await
            }
            Some(Outside { identity, .. }) => {
                let listener = EncryptedListener::new(self.listener, identity)?;
                let service = router.into_make_service_with_connect_info::<Visitor>();
                axum::serve(Bounded::new(listener), service).await
            }
        }
        .context("serving the page")
    }
}

async fn bind(address: SocketAddr) -> Result<TcpListener> {
    TcpListener::bind(address).await.with_context(|| format!("listening on {address}"))
}

/// Accepts clients whose connections are encrypted.
struct EncryptedListener {
    clients: mpsc::Receiver<(EncryptedStream, SocketAddr)>,
    address: SocketAddr,
    accepting: AbortHandle,
}

impl EncryptedListener {
    fn new(listener: TcpListener, identity: Identity) -> io::Result<EncryptedListener> {
        let address = listener.local_addr()?;
        let (sender, clients) = mpsc::channel(1);
        let accepting = tokio::spawn(accept(listener, identity, sender)).abort_handle();
        Ok(EncryptedListener { clients, address, accepting })
    }
}

impl Listener for EncryptedListener {
    type Io = EncryptedStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (EncryptedStream, SocketAddr) {
        match self.clients.recv().await {
            Some(client) => client,
            // The task that accepts has failed. Clients that are there go on.
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        Ok(self.address)
    }
}

impl Drop for EncryptedListener {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

/// Accepts connections, and passes each on once it is encrypted.
async fn accept(
    mut listener: TcpListener,
    identity: Identity,
    clients: mpsc::Sender<(EncryptedStream, SocketAddr)>,
) {
    let mut handshakes = VecDeque::<AbortHandle>::new();
    loop {
        let (stream, from) = Listener::accept(&mut listener).await;
        handshakes.retain(|handshake| !handshake.is_finished());
        if handshakes.len() >= MOST_HANDSHAKES
            && let Some(oldest) = handshakes.pop_front()
        {
            oldest.abort();
        }
        let (identity, clients) = (identity.clone(), clients.clone());
        let handshake = tokio::spawn(async move {
            if let Ok(Ok(stream)) = timeout(HANDSHAKE_TIME, identity.encrypt(stream)).await {
                // If nobody takes it, the page is no longer served.
                let _ = clients.send((stream, from)).await;
            }
        });
        handshakes.push_back(handshake.abort_handle());
    }
}
