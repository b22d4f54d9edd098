//! Answers requests that send a file which was dropped on the page.
//!
//! Invariant: a client that does not drive stores nothing.

use std::{
    fs::{self, File},
    io::{self, Write},
    sync::Arc,
};

use axum::{
    body::{Body, Bytes},
    extract::{self, State},
    http::StatusCode,
    response::{IntoResponse, Response},
};
use futures_util::StreamExt;
use tokio::sync::mpsc;

use super::{
    dropped::{DroppedFiles, MOST_BYTES},
    hub::Hub,
};

/// Most chunks of a file that wait to be written.
const MOST_CHUNKS: usize = 16;

/// Stores a file of a drop.
pub async fn put(
    State(hub): State<Arc<Hub>>,
    extract::Path((client, drop, name)): extract::Path<(u32, u32, String)>,
    body: Body,
) -> Response {
    if !hub.drives(client) {
        return (StatusCode::CONFLICT, "another page drives: take over first").into_response();
    }
    let (path, file) = match hub.dropped.create(client, drop, &name) {
        Ok(created) => created,
        Err(error) => {
            let reason = format!("{name} cannot be stored: {error}");
            return (StatusCode::BAD_REQUEST, reason).into_response();
        }
    };
    let (chunks, received) = mpsc::channel(MOST_CHUNKS);
    let writing = tokio::task::spawn_blocking(move || write(file, received));
    let failed = send(&hub.dropped, body, chunks).await;
    let written = match writing.await {
        Ok(Ok(())) => None,
        Ok(Err(error)) => {
            let reason = format!("{name} cannot be stored: {error}");
            Some((StatusCode::INSUFFICIENT_STORAGE, reason))
        }
        Err(error) => Some((StatusCode::INTERNAL_SERVER_ERROR, error.to_string())),
    };
    match failed.or(written) {
        None => StatusCode::NO_CONTENT.into_response(),
        Some(refused) => {
            // If it stays, it goes with the session.
            let _ = fs::remove_file(path);
            refused.into_response()
        }
    }
}

/// Hands the chunks of a body on. Returns why not all of them came.
async fn send(
    dropped: &DroppedFiles,
    body: Body,
    chunks: mpsc::Sender<Bytes>,
) -> Option<(StatusCode, String)> {
    let mut stream = body.into_data_stream();
    while let Some(chunk) = stream.next().await {
        let Ok(chunk) = chunk else {
            return Some((StatusCode::BAD_REQUEST, "the file came in part".to_owned()));
        };
        if !dropped.takes(chunk.len()) {
            let reason = format!(
                "all files that are dropped in a session have at most {} MiB: start the viewer \
                 with `--object FILE@X,Y,Z` instead",
                MOST_BYTES >> 20
            );
            return Some((StatusCode::PAYLOAD_TOO_LARGE, reason));
        }
        if chunks.send(chunk).await.is_err() {
            // The writer knows the reason.
            return None;
        }
    }
    None
}

fn write(mut file: File, mut received: mpsc::Receiver<Bytes>) -> io::Result<()> {
    while let Some(chunk) = received.blocking_recv() {
        file.write_all(&chunk)?;
    }
    file.flush()
}
