//! Answers requests that send a file which was dropped on the page.
//!
//! Invariant: only the client that drives stores anything. It proves with its key who it is.

use std::{
    fs::{self, File},
    io::{self, Write},
    sync::Arc,
};

use axum::{
    body::{Body, Bytes},
    extract::{self, State},
    http::{HeaderMap, StatusCode, header},
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
    headers: HeaderMap,
    body: Body,
) -> Response {
    let key = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let key = key.and_then(|text| text.strip_prefix("Bearer ")).unwrap_or_default();
    if !hub.is_key_of(client, key) {
        return (StatusCode::FORBIDDEN, "this is for the page that was greeted alone")
            .into_response();
    }
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
    let mut taken = 0;
    let failed = send(&hub.dropped, body, chunks, &mut taken).await;
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
            hub.dropped.gives_back(taken);
            // If it stays, it goes with the session.
            let _ = fs::remove_file(path);
            refused.into_response()
        }
    }
}

/// Hands the chunks of a body on, and adds up in `taken` how much room they take. Returns why not
/// all of them came.
async fn send(
    dropped: &DroppedFiles,
    body: Body,
    chunks: mpsc::Sender<Bytes>,
    taken: &mut u64,
) -> Option<(StatusCode, String)> {
    let mut stream = body.into_data_stream();
    while let Some(chunk) = stream.next().await {
        let Ok(chunk) = chunk else {
            return Some((StatusCode::BAD_REQUEST, "the file came in part".to_owned()));
        };
        *taken += chunk.len() as u64;
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
