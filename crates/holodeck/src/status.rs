//! The state of a running server.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use holo_net::{Destination, Message, NetError};
use holo_proto::{control::Control, hello::Role, report::StatusReport};

use crate::listening;

/// A server that is queried.
#[derive(Clone)]
pub struct QueriedServer {
    /// The server's address.
    pub destination: Destination,
    /// Folder of the server's certificate and tokens, if the server is this user's own.
    pub identity: Option<PathBuf>,
}

impl QueriedServer {
    /// Requests the server's report.
    ///
    /// # Errors
    /// If the server cannot be reached, refuses, or leaves.
    pub async fn report(&self) -> Result<StatusReport> {
        let connect = |to| holo_net::connect(to, Role::Admin, "holodeck status");
        let mut connected = connect(self.destination.clone()).await;
        // A server for other machines refuses connections without a token, even on this machine.
        if matches!(connected, Err(NetError::Refused(_)))
            && let Some(own) = listening::own(&self.destination, self.identity.as_deref())?
        {
            connected = connect(own).await;
        }
        let (mut inbox, outbox, _) = connected
            .with_context(|| format!("connecting to the holoserver at {}", self.destination))?;
        outbox.control(&Control::ReportWanted)?;
        loop {
            match inbox.next().await? {
                Message::Control(Control::Report(report)) => return Ok(*report),
                Message::Control(Control::Bye(farewell)) => bail!("the server left: {farewell}"),
                _ => {}
            }
        }
    }
}
