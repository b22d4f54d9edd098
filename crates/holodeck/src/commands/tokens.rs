//! `holodeck tokens`: lists the tokens of this user's servers, and makes or revokes one.

use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use holo_net::{Identity, Invitation, Rights};

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
    #[arg(long, value_name = "NAME", conflicts_with = "add", allow_hyphen_values = true)]
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
pub fn run(args: &TokensArgs) -> Result<()> {
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
