//! Answers requests for pictures to save: PNG as the client sees it, or radiance.

use std::{sync::Arc, time::Duration};

use anyhow::Result;
use axum::{
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use holo_display::Frame;
use holo_picture::{Format, Image};
use tokio::{sync::mpsc, time::timeout};

use super::hub::{Hub, Seen};
use crate::{
    args::parse_size,
    screen::on_screen_threads,
    stage::{Input, Reply},
};

/// Longest wait for a picture of a stated size.
const PATIENCE: Duration = Duration::from_secs(60);

/// A request for a picture.
#[derive(Debug, Default)]
struct Wish {
    /// The client whose look the picture has.
    client: Option<u32>,
    /// Size, such as `1920x1080`; if absent, the picture is the latest frame.
    size: Option<String>,
}

impl Wish {
    /// Parses a query such as `client=3&size=1920x1080`. Unknown parts are ignored.
    fn parse(query: Option<&str>) -> Wish {
        let mut wish = Wish::default();
        let parts = query.unwrap_or_default().split('&');
        for (name, value) in parts.filter_map(|part| part.split_once('=')) {
            match name {
                "client" => wish.client = value.parse().ok(),
                "size" => wish.size = Some(value.to_owned()),
                _ => {}
            }
        }
        wish
    }
}

/// Answers with a PNG as the client sees it, with the legend.
pub async fn png(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    let wish = Wish::parse(query.as_deref());
    let seen = wish.client.and_then(|client| hub.seen(client));
    let kind = "image/png";
    match (wish.size, seen) {
        (None, Some(Seen { frame, image, .. })) => {
            answer(frame, "png", kind, move || Ok(Image::clone(&image).with_legend().png()?)).await
        }
        (size, seen) => {
            let look = seen.map(|seen| seen.look).unwrap_or_default();
            let encode = move |frame: &Frame| {
                Ok(on_screen_threads(|| look.show(&frame.picture)).with_legend().png()?)
            };
            drawn(&hub, size, "png", kind, encode).await
        }
    }
}

/// Answers with radiance in Radiance's RGBE format.
pub async fn hdr(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    let wish = Wish::parse(query.as_deref());
    radiance(&hub, wish, "hdr", "image/vnd.radiance", Format::Hdr).await
}

/// Answers with radiance as OpenEXR.
pub async fn exr(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    let wish = Wish::parse(query.as_deref());
    radiance(&hub, wish, "exr", "image/x-exr", Format::Exr).await
}

async fn radiance(
    hub: &Hub,
    wish: Wish,
    end: &str,
    kind: &'static str,
    format: Format,
) -> Response {
    let encode = move |frame: &Frame| Ok(frame.picture.encode(format)?);
    drawn(hub, wish.size, end, kind, encode).await
}

/// Answers with a picture of a stated size, or with the latest frame.
async fn drawn(
    hub: &Hub,
    size: Option<String>,
    end: &str,
    kind: &'static str,
    encode: impl FnOnce(&Frame) -> Result<Vec<u8>> + Send + 'static,
) -> Response {
    let number = hub.latest().map_or(0, |shown| shown.number);
    let frame = match size {
        None => hub.latest().map(|shown| Arc::clone(&shown.frame)),
        Some(size) => match parse_size(&size) {
            Ok(size) => rendered(hub, size).await,
            Err(reason) => return (StatusCode::BAD_REQUEST, reason).into_response(),
        },
    };
    match frame {
        Some(frame) => answer(number, end, kind, move || encode(&frame)).await,
        None => (StatusCode::NOT_FOUND, "there is no picture yet").into_response(),
    }
}

/// Draws a picture on the stage.
async fn rendered(hub: &Hub, size: (u32, u32)) -> Option<Arc<Frame>> {
    let (sender, mut frames) = mpsc::channel(1);
    let reply = Reply::new(move |frame| {
        // If the request was cancelled, the picture is dropped.
        let _ = sender.try_send(frame);
    });
    hub.front.inputs.send(0, 0, Input::Render(size, reply));
    timeout(PATIENCE, frames.recv()).await.ok().flatten()
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
