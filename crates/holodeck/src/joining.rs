//! Sessions of several machines: options of a server for other machines, and tokens to join it.

use std::{
    ffi::OsString,
    net::SocketAddr,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};
use holo_net::{Destination, Identity, Invitation, Rights};

/// Options for workers and displays on other machines.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct ListenArgs {
    /// Take workers and displays from other machines at this address, such as 0.0.0.0:7070. The
    /// string to join with is printed
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
    /// Encrypt connections and ask for a token even on this machine, as for a tunnel
    #[arg(long, requires = "listen")]
    secure: bool,
    /// The address in the printed string, if others see this machine under another one
    #[arg(long, value_name = "HOST:PORT", requires = "listen")]
    public: Option<String>,
    /// Folder of the server's certificate and tokens [default: holodeck/server in the user's
    /// configuration folder]
    #[arg(long, value_name = "DIR", requires = "listen")]
    identity: Option<PathBuf>,
    /// A certificate to use in place of the one that is made: a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "listen", requires = "key")]
    cert: Option<PathBuf>,
    /// The certificate's key, a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "cert")]
    key: Option<PathBuf>,
    /// Append what happens to this file: a JSON object in each line
    #[arg(long, value_name = "FILE")]
    log_file: Option<PathBuf>,
}

impl ListenArgs {
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

/// List the tokens of this user's servers, and make or revoke one
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck tokens\n  \
    holodeck tokens --add worker --public 192.0.2.7:7070\n  holodeck tokens --revoke GkdS3h6pXzU")]
pub struct TokensArgs {
    /// Make a token for this role (admin, member, worker, display, read-only), and print the string
    /// to join with
    #[arg(long, value_name = "ROLE", requires = "public")]
    add: Option<Rights>,
    /// The server's address in that string
    #[arg(long, value_name = "HOST:PORT", requires = "add")]
    public: Option<String>,
    /// Revoke the token of this name: no worker or display can join with it any more
    #[arg(long, value_name = "NAME", conflicts_with = "add")]
    revoke: Option<String>,
    /// Folder of the certificate and the tokens [default: holodeck/server in the user's
    /// configuration folder]
    #[arg(long, value_name = "DIR")]
    identity: Option<PathBuf>,
    /// The certificate of the server, if it is not the one in that folder: a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "key")]
    cert: Option<PathBuf>,
    /// The certificate's key, a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "cert")]
    key: Option<PathBuf>,
}

/// See [`TokensArgs`].
pub fn tokens(args: &TokensArgs) -> Result<()> {
    let folder = args.identity.clone().or_else(Identity::users_folder);
    let folder = folder.context("say --identity DIR: the user has no home folder")?;
    let identity = match (&args.cert, &args.key) {
        (Some(certificate), Some(key)) => Identity::with_certificate(&folder, certificate, key)?,
        _ => Identity::open(&folder)?,
    };
    if let (Some(rights), Some(address)) = (args.add, &args.public) {
        let token = identity.add_token(rights)?;
        let (address, fingerprint) = (address.clone(), identity.fingerprint());
        holo_progress::print_line!("join with {}", Invitation { address, fingerprint, token });
    } else if let Some(name) = &args.revoke {
        ensure!(identity.revoke_token(name)?, "no token has the name `{name}`");
    } else {
        for (token, rights) in identity.tokens()? {
            holo_progress::print_line!("{} {rights}", token.name());
        }
    }
    Ok(())
}
