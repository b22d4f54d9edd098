//! Pictures that a person saves: as seen, or in radiance.

use std::sync::Arc;

use anyhow::Result;
use axum::{
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use holo_picture::{Format, Image, Look};

use super::hub::{Hub, Seen};
use crate::stage::Shown;

/// Answers with what a client sees, `?client=NUMBER`, and its legend. Without a client, answers with
/// the latest frame in the default look.
pub async fn png(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    let query = query.unwrap_or_default();
    let client = query.strip_prefix("client=").and_then(|client| client.parse().ok());
    let kind = "image/png";
    match client.and_then(|client| hub.seen(client)) {
        Some(Seen { frame, image }) => {
            answer(frame, "png", kind, move || Ok(Image::clone(&image).with_legend().png()?)).await
        }
        None => {
            let encode = |shown: &Shown| Ok(Look::default().show(&shown.frame.picture).png()?);
            latest(&hub, "png", kind, encode).await
        }
    }
}

/// Answers with the latest frame's radiance as Radiance's RGBE.
pub async fn hdr(State(hub): State<Arc<Hub>>) -> Response {
    radiance(&hub, "hdr", "image/vnd.radiance", Format::Hdr).await
}

/// Answers with the latest frame's radiance as OpenEXR.
pub async fn exr(State(hub): State<Arc<Hub>>) -> Response {
    radiance(&hub, "exr", "image/x-exr", Format::Exr).await
}

async fn radiance(hub: &Hub, end: &str, kind: &'static str, format: Format) -> Response {
    latest(hub, end, kind, move |shown| Ok(shown.frame.picture.encode(format)?)).await
}

async fn latest(
    hub: &Hub,
    end: &str,
    kind: &'static str,
    encode: impl FnOnce(&Shown) -> Result<Vec<u8>> + Send + 'static,
) -> Response {
    match hub.latest() {
        Some(shown) => answer(shown.number, end, kind, move || encode(&shown)).await,
        None => (StatusCode::NOT_FOUND, "there is no picture yet").into_response(),
    }
}

async fn answer(
    frame: u64,
    end: &str,
    kind: &'static str,
    encode: impl FnOnce() -> Result<Vec<u8>> + Send + 'static,
) -> Response {
    let name = format!("attachment; filename=\"holodeck-{frame}.{end}\"");
    match tokio::task::spawn_blocking(encode).await {
        Ok(Ok(bytes)) => {
            let headers =
                [(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_DISPOSITION, name)];
            (headers, bytes).into_response()
        }
        _ => (StatusCode::INTERNAL_SERVER_ERROR, "the picture cannot be encoded").into_response(),
    }
}
