//! The browser front end: a page, and a WebSocket for each client.
//!
//! Invariants:
//! - Requests from another origin, or under a name other than this machine's own, are refused. So a
//!   page of another site reaches neither pictures nor controls.
//! - At most one frame is under way to a client. When it has arrived, the latest frame follows.
//! - One client drives; other clients' inputs move nothing.
//! - All input from a client is bounded, and malformed input ends only that client's connection.

mod client;
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

use std::{path::PathBuf, process::Stdio, sync::Arc};

use anyhow::{Context, Result};
use axum::{Router, middleware, routing::get};
use clap::Args;
use holo_net::{Destination, NetError, Shutdown};
use tokio::net::TcpListener;

use crate::{
    Config, DriverArgs,
    commands::follow_standard_input,
    session,
    stage::{Front, Wishes, stage},
};
use hub::Hub;

/// Options of the page's server.
#[derive(Args, Clone, Debug)]
pub struct BrowserArgs {
    /// Serve the page at this address of this machine; port 0 means any free one
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:0")]
    pub http: String,
    /// Print the page's address, and open no browser
    #[arg(long)]
    pub no_open: bool,
    /// Record the walk in this file, as a script for --script
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
}

impl Default for BrowserArgs {
    fn default() -> BrowserArgs {
        BrowserArgs { http: "127.0.0.1:0".into(), no_open: false, record: None }
    }
}

/// Shows a server's holodeck in a browser until somebody quits or `shutdown` is triggered.
///
/// # Errors
/// If the page cannot be served, or the server cannot be reached or is lost.
pub async fn run(config: Config, args: BrowserArgs, shutdown: Shutdown) -> Result<()> {
    config.driver.check().map_err(anyhow::Error::msg)?;
    let listener = listen(&args.http).await?;
    let address = listener.local_addr().context("the page's address")?;
    let server = Destination::parse(&config.connect)?;
    let driver = DriverArgs { walks: true, ..config.driver };
    let connected =
        session::Connected::new(server, driver, config.points.clone(), shutdown.clone()).await?;
    let wishes = Wishes { view: config.view, record: args.record, crew: config.crew };
    let (stage, front) = stage(connected, wishes);
    holo_progress::print_line!("http://{address}/");
    if !args.no_open {
        open(&format!("http://{address}/"));
    }
    follow_standard_input(front.inputs.clone());
    let ending = Shutdown::new();
    let pages = tokio::spawn(serve(listener, front, ending.clone()));
    // Drawing keeps its thread busy, and sockets must not wait for it.
    let played = tokio::task::spawn_blocking(move || stage.run()).await?;
    ending.trigger();
    pages.await??;
    played
}

/// Listens at a loopback address.
async fn listen(address: &str) -> Result<TcpListener> {
    let address = holo_net::loopback(address).map_err(|error| match error {
        NetError::NotLoopback(address) => anyhow::anyhow!(
            "the page cannot be served at {address} yet: connections are not encrypted. Serve it \
             at 127.0.0.1, and reach it from elsewhere through a tunnel, such as \
             ssh -L 8080:127.0.0.1:8080"
        ),
        error => error.into(),
    })?;
    TcpListener::bind(address).await.with_context(|| format!("listening on {address}"))
}

/// Serves pages for a stage until `ending` is triggered and every client has been informed.
pub async fn serve(listener: TcpListener, front: Front, ending: Shutdown) -> Result<()> {
    let address = listener.local_addr().context("the page's address")?;
    let hub = Arc::new(Hub::new(front));
    let router = Router::new()
        .route("/", get(page::index))
        .route("/walk.css", get(page::style))
        .route("/walk.js", get(page::script))
        .route("/picture.png", get(saved::png))
        .route("/picture.hdr", get(saved::hdr))
        .route("/picture.exr", get(saved::exr))
        .route("/session", get(client::connect))
        .layer(middleware::from_fn_with_state(address.port(), guard::guard))
        .with_state(Arc::clone(&hub));
    let served = axum::serve(listener, router).into_future();
    tokio::select! {
        result = served => result.context("serving the page"),
        () = hub.everyone_has_left(&ending) => Ok(()),
    }
}

/// Opens a browser. If that fails, people still have the printed address.
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
    // A person who waits for the browser sees whether it opens.
    let _ = command.spawn();
}
