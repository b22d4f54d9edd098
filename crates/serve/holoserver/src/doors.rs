//! Where a server takes connections: on this machine without encryption, and from elsewhere by
//! invitation.

use std::{
    net::{Ipv4Addr, SocketAddr},
    sync::Arc,
};

use anyhow::{Context, Result};
use holo_net::{Identity, Invitation, Rights};
use tokio::{net::TcpListener, sync::mpsc::UnboundedSender, task::JoinSet};

use crate::{config::Config, events::ServerEvent, holodeck::Holodeck, listen};

/// Where a server takes connections.
#[derive(Clone, Debug)]
pub struct Ready {
    /// On this machine, without encryption.
    pub address: SocketAddr,
    /// From elsewhere, if it does.
    pub outside: Option<Outside>,
}

/// Where a server takes connections from other machines.
#[derive(Clone, Debug)]
pub struct Outside {
    /// The address that it listens at. Others may see this machine under another one.
    pub address: SocketAddr,
    /// What others join with.
    pub invitation: Invitation,
}

/// Listening sockets.
pub struct Doors {
    /// Where they are.
    pub ready: Ready,
    local: TcpListener,
    outside: Option<(TcpListener, Identity)>,
}

impl Doors {
    /// Listens where the options say. A server for other machines also listens at a free loopback
    /// port, for the worker and the viewer that are started with it.
    ///
    /// # Errors
    /// If an address is not free, or the certificate and tokens cannot be made or read.
    pub async fn open(config: &Config) -> Result<Doors> {
        let address = holo_net::any_address(&config.listen)?;
        if address.ip().is_loopback() && !config.secure {
            let local = bind(address).await?;
            let ready = Ready { address: local.local_addr()?, outside: None };
            return Ok(Doors { ready, local, outside: None });
        }
        let outside = bind(address).await?;
        let folder = config.identity.clone().or_else(Identity::users_folder);
        let folder = folder.context("say --identity DIR: the user has no home folder")?;
        let own = config.cert.clone().zip(config.key.clone());
        let open = move || match own {
            Some((certificate, key)) => Identity::with_certificate(&folder, &certificate, &key),
            None => Identity::open(&folder),
        };
        let identity = tokio::task::spawn_blocking(open).await??;
        let local = bind((Ipv4Addr::LOCALHOST, 0).into()).await?;
        let address = outside.local_addr()?;
        let seen = holo_net::seen_from_outside(address).to_string();
        let invitation = invitation(&identity, config.public.clone().unwrap_or(seen))?;
        let ready =
            Ready { address: local.local_addr()?, outside: Some(Outside { address, invitation }) };
        Ok(Doors { ready, local, outside: Some((outside, identity)) })
    }

    /// Takes connections until the tasks are ended.
    pub fn listen(
        self,
        holodeck: &Arc<Holodeck>,
        events: &UnboundedSender<ServerEvent>,
    ) -> JoinSet<()> {
        let mut tasks = JoinSet::new();
        let shared = listen::ListenContext::new(Arc::clone(holodeck), events.clone());
        tasks.spawn(listen::listen(self.local, None, shared.clone()));
        if let Some((outside, identity)) = self.outside {
            tasks.spawn(listen::listen(outside, Some(identity), shared));
        }
        tasks
    }
}

async fn bind(address: SocketAddr) -> Result<TcpListener> {
    TcpListener::bind(address).await.with_context(|| format!("listening at {address}"))
}

/// Returns the invitation with the oldest token that permits only tracing and looking. If no such
/// token exists, one is made.
fn invitation(identity: &Identity, address: String) -> Result<Invitation> {
    let tokens = identity.tokens()?;
    let members = tokens.iter().find(|(_, rights)| *rights == Rights::Member);
    let token = match members {
        Some((token, _)) => *token,
        None => identity.add_token(Rights::Member)?,
    };
    Ok(Invitation { address, fingerprint: identity.fingerprint(), token })
}
