//! Sessions of several machines: where a server listens for others, and how its owner joins it.

use std::{
    ffi::OsString,
    net::SocketAddr,
    path::{Path, PathBuf},
};

use anyhow::Result;
use holo_net::{Destination, Identity, Invitation, Rights};

/// Where a server listens for workers and displays on other machines.
#[derive(Clone, Debug, Default)]
pub struct ListenOptions {
    /// The address for other machines, such as `0.0.0.0:7070`. `None`: this machine alone.
    pub listen: Option<String>,
    /// True if connections on this machine are encrypted and need a token, too.
    pub secure: bool,
    /// The address in the string to join with, if others see this machine under another one.
    pub public: Option<String>,
    /// Folder of the server's certificate and tokens. `None`: in the user's configuration folder.
    pub identity: Option<PathBuf>,
    /// A certificate in place of the one that is made: a PEM file.
    pub cert: Option<PathBuf>,
    /// The certificate's key, a PEM file.
    pub key: Option<PathBuf>,
    /// The file to which what happens is appended: a JSON object in each line.
    pub log_file: Option<PathBuf>,
}

impl ListenOptions {
    /// Returns the server's arguments. Without options, the server accepts only processes of this
    /// machine, at any free port.
    pub fn arguments(&self) -> Vec<OsString> {
        let listen = self.listen.clone().unwrap_or_else(|| "127.0.0.1:0".to_owned());
        let mut arguments: Vec<OsString> = vec!["--listen".into(), listen.into()];
        if self.secure {
            arguments.push("--secure".into());
        }
        if let Some(public) = &self.public {
            arguments.extend(["--public".into(), public.into()]);
        }
        let files = [
            ("--identity", &self.identity),
            ("--cert", &self.cert),
            ("--key", &self.key),
            ("--log-file", &self.log_file),
        ];
        for (option, file) in files {
            if let Some(file) = file {
                arguments.extend([option.into(), file.into()]);
            }
        }
        arguments
    }

    /// If any free port was allowed, states the one that a server has taken by listening at
    /// `address`. The next server then listens there too.
    pub fn stay_at(&mut self, address: SocketAddr) {
        if self.listen.is_some() {
            self.listen = Some(address.to_string());
        }
    }
}

/// Returns the address and the token with which an administrator joins a server on this machine.
/// The server's certificate and tokens are in `folder`; `None` if the folder has none.
///
/// # Errors
/// If the files in the folder cannot be read.
pub fn own(server: &Destination, folder: Option<&Path>) -> Result<Option<Destination>> {
    let (Destination::Loopback(address), Some(folder)) = (server, folder) else { return Ok(None) };
    let Some(identity) = Identity::existing(folder)? else { return Ok(None) };
    let tokens = identity.tokens()?;
    let admin = tokens.into_iter().find(|(_, rights)| *rights == Rights::Admin);
    Ok(admin.map(|(token, _)| {
        let (address, fingerprint) = (address.to_string(), identity.fingerprint());
        Destination::Invited(Box::new(Invitation { address, fingerprint, token }))
    }))
}
