//! Options of a server for other machines.

use std::path::PathBuf;

use holodeck::listening::ListenOptions;

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

impl From<ListenArgs> for ListenOptions {
    fn from(args: ListenArgs) -> ListenOptions {
        let ListenArgs { listen, secure, public, identity, cert, key, log_file } = args;
        ListenOptions { listen, secure, public, identity, cert, key, log_file }
    }
}
