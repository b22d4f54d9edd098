//! The front end in a browser: a page on a stage, and a WebSocket for each client.
//!
//! Invariants:
//! - Requests from another origin are refused. So a page of another site reaches neither pictures
//!   nor controls.
//! - A client on another machine has an encrypted connection and the page's token.
//! - At most one frame is under way to a client. When it has arrived, the latest frame follows.
//! - The screens of a wall show one frame at a time. Its next one follows once all have shown it.
//! - One client drives; other clients' inputs move nothing.
//! - Connections are bounded in number, and in the time until their first request.
//! - All input from a client is bounded, and malformed input ends only that client's connection.

mod client;
mod connections;
mod door;
mod drop_requests;
mod dropped;
mod encode;
mod eyes;
mod from_page;
mod guard;
mod hub;
mod page;
mod saved;
mod screen;
#[cfg(test)]
mod tests;
mod to_page;
mod together;

use std::{path::PathBuf, process::Stdio, sync::Arc};

use anyhow::Result;
use axum::{
    Router, middleware,
    routing::{get, put},
};
use clap::Args;
use holo_net::Shutdown;
use holo_stage::{Front, Stage, commands::follow_standard_input};

use door::PageSocket;
use hub::Hub;

/// Options of the page's server.
#[derive(Args, Clone, Debug)]
pub struct BrowserArgs {
    /// Serve the page at this address; port 0 means any free one. At an address for other machines,
    /// such as 0.0.0.0:8080, it is encrypted and needs the token in the printed address
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:0")]
    pub http: String,
    /// The page's certificate for other machines, in place of the one that is made: a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "http_key")]
    pub http_cert: Option<PathBuf>,
    /// That certificate's key, a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "http_cert")]
    pub http_key: Option<PathBuf>,
    /// Print the page's address, and open no browser
    #[arg(long)]
    pub no_open: bool,
    /// Record the walk in this file, as a script for --script
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
}

impl Default for BrowserArgs {
    fn default() -> BrowserArgs {
        BrowserArgs {
            http: "127.0.0.1:0".into(),
            http_cert: None,
            http_key: None,
            no_open: false,
            record: None,
        }
    }
}

/// A page that can be reached. Requests wait until it is shown.
pub struct PageServer {
    door: PageSocket,
    url: String,
    opens_browser: bool,
}

impl PageServer {
    /// Listens at the address of the options.
    ///
    /// # Errors
    /// If the address cannot be used, or the certificate cannot.
    pub async fn open(args: &BrowserArgs) -> Result<PageServer> {
        let own = args.http_cert.as_deref().zip(args.http_key.as_deref());
        let door = PageSocket::open(&args.http, own).await?;
        let url = door.url()?;
        Ok(PageServer { door, url, opens_browser: !args.no_open })
    }

    /// Shows a stage in a browser until somebody quits or the stage ends. `screens` are the names
    /// of a wall's screens, whose pictures stand side by side in each frame.
    ///
    /// # Errors
    /// If the page cannot be served, or the stage's errors.
    pub async fn show(self, stage: Stage, front: Front, screens: Vec<String>) -> Result<()> {
        let PageServer { door, url, opens_browser } = self;
        holo_progress::print_line!("{url}");
        if let Some(fingerprint) = door.fingerprint() {
            holo_progress::print_line!(
                "SHA-256 fingerprint of the page's certificate: {fingerprint}"
            );
        }
        if opens_browser {
            open(&url);
        }
        follow_standard_input(front.inputs.clone());
        let ending = Shutdown::new();
        let pages = tokio::spawn(serve(door, Hub::new(front, screens), ending.clone()));
        // Drawing keeps its thread busy, and sockets must not wait for it.
        let played = tokio::task::spawn_blocking(move || stage.run()).await?;
        ending.trigger();
        pages.await??;
        played
    }
}

/// Serves pages for the stage of a hub until `ending` is triggered and every client has been
/// informed.
async fn serve(door: PageSocket, hub: Hub, ending: Shutdown) -> Result<()> {
    let gate = door.gate()?;
    let hub = Arc::new(hub);
    let router = Router::new()
        .route("/", get(page::index))
        .route("/walk.css", get(page::style))
        .route("/walk.js", get(page::script))
        .route("/light.js", get(page::light_script))
        .route("/picture.png", get(saved::png).post(saved::png))
        .route("/picture.hdr", get(saved::hdr).post(saved::hdr))
        .route("/picture.exr", get(saved::exr).post(saved::exr))
        .route("/dropped/{client}/{drop}/{name}", put(drop_requests::put))
        .route("/session", get(client::connect))
        .layer(middleware::from_fn_with_state(gate, guard::guard))
        .with_state(Arc::clone(&hub));
    tokio::select! {
        result = door.serve(router) => result,
        () = hub.everyone_has_left(&ending) => Ok(()),
    }
}

/// Opens a browser, or says that it cannot. People have the printed address in any case.
fn open(address: &str) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let mut command = std::process::Command::new(program);
    command.arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let failed = "no browser could be opened: open the address yourself";
    match command.spawn() {
        Ok(mut child) => {
            // Such programs pass the address on and end.
            std::thread::spawn(move || {
                if child.wait().is_ok_and(|status| !status.success()) {
                    eprintln!("{failed}");
                }
            });
        }
        Err(_) => eprintln!("{failed}"),
    }
}
