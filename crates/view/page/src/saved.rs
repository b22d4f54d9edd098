//! Answers requests for pictures to save: PNG as the client sees it, or radiance.
//!
//! A picture of a stated size is drawn beside the walk, and sent while it is drawn. If the client
//! goes, the drawing ends.

use std::{
    io::{self, BufWriter, Write},
    sync::Arc,
};

use anyhow::Result;
use axum::{
    body::{Body, Bytes},
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use futures_util::stream::poll_fn;
use holo_display::Frame;
use holo_options::parse_size;
use holo_picture::{Format, Image, Look};
use holo_stage::{
    Input, PictureNews, PictureOrder, encode_picture, format_refusal, on_screen_threads,
};
use tokio::sync::mpsc;

use super::hub::{ClientFrame, Hub};

/// Bytes that are sent together.
const CHUNK: usize = 1 << 16;

/// Most chunks that wait for a client.
const MOST_CHUNKS: usize = 16;

/// A request for a picture.
#[derive(Debug, Default)]
struct PictureQuery {
    /// The client whose look the picture has.
    client: Option<u32>,
    /// Size, such as `1920x1080`; if absent, the picture is the latest frame.
    size: Option<String>,
}

impl PictureQuery {
    /// Parses a query such as `client=3&size=1920x1080`. Unknown parts are ignored.
    fn parse(query: Option<&str>) -> PictureQuery {
        let mut wish = PictureQuery::default();
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
    let wish = PictureQuery::parse(query.as_deref());
    let seen = wish.client.and_then(|client| hub.seen(client));
    match (&wish.size, seen) {
        (None, Some(ClientFrame { frame, image, .. })) => {
            let encode = move || Ok(Image::clone(&image).with_legend().png()?);
            answer(frame, Format::Png, encode).await
        }
        (_, seen) => {
            let look = seen.map(|seen| seen.look).unwrap_or_default();
            saved(&hub, wish, Format::Png, look).await
        }
    }
}

/// Answers with radiance in Radiance's RGBE format.
pub async fn hdr(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    saved(&hub, PictureQuery::parse(query.as_deref()), Format::Hdr, Look::default()).await
}

/// Answers with radiance as OpenEXR.
pub async fn exr(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    saved(&hub, PictureQuery::parse(query.as_deref()), Format::Exr, Look::default()).await
}

/// Answers with a picture of a stated size, or with the latest frame.
async fn saved(hub: &Hub, wish: PictureQuery, format: Format, look: Look) -> Response {
    if let Some(size) = wish.size {
        return match parse_size(&size) {
            Ok(size) => drawn(hub, size, format, look).await,
            Err(reason) => (StatusCode::BAD_REQUEST, reason).into_response(),
        };
    }
    let Some(shown) = hub.latest() else {
        return (StatusCode::NOT_FOUND, "there is no picture yet").into_response();
    };
    let encode = move || {
        let Frame { picture, .. } = shown.frame.as_ref();
        match format {
            Format::Png => Ok(on_screen_threads(|| look.show(picture)).with_legend().png()?),
            format => Ok(picture.encode(format)?),
        }
    };
    answer(hub.latest().map_or(0, |shown| shown.number), format, encode).await
}

/// Answers with a picture of this size, which is sent while it is drawn.
async fn drawn(hub: &Hub, size: (u32, u32), format: Format, look: Look) -> Response {
    if let Some(reason) = format_refusal(format, &look, size) {
        return (StatusCode::BAD_REQUEST, reason).into_response();
    }
    let Ok(permit) = Arc::clone(&hub.encoders).try_acquire_owned() else {
        return (StatusCode::CONFLICT, "too many pictures are being sent").into_response();
    };
    let (order, mut news, wish) = PictureOrder::new(size);
    hub.front.inputs.send(0, 0, Input::Render(order));
    let begun = match news.recv().await {
        Some(PictureNews::Begun(begun)) => begun,
        Some(PictureNews::Refused(reason)) => {
            return (StatusCode::CONFLICT, reason).into_response();
        }
        Some(PictureNews::Band(_)) | None => {
            return (StatusCode::SERVICE_UNAVAILABLE, "no picture is drawn now").into_response();
        }
    };
    let (chunks, mut body) = mpsc::channel(MOST_CHUNKS);
    let number = hub.latest().map_or(0, |shown| shown.number);
    tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let out = BufWriter::with_capacity(CHUNK, Chunks(chunks.clone()));
        if let Err(error) = encode_picture(out, format, &look, *begun, &mut news) {
            // If the client has gone, nobody needs the reason. Otherwise it gets no whole file.
            let _ = chunks.blocking_send(Err(io::Error::other(format!("{error:#}"))));
        }
    });
    let body = poll_fn(move |context| {
        // Dropped with the body, when the client has gone.
        let _wish = &wish;
        body.poll_recv(context)
    });
    (headers(number, format), Body::from_stream(body)).into_response()
}

/// Sends what is written in chunks.
struct Chunks(mpsc::Sender<io::Result<Bytes>>);

impl Write for Chunks {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let bytes = &bytes[..bytes.len().min(CHUNK)];
        let sent = self.0.blocking_send(Ok(Bytes::copy_from_slice(bytes)));
        sent.map_err(|_| io::Error::from(io::ErrorKind::BrokenPipe))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn headers(frame: u64, format: Format) -> [(header::HeaderName, String); 2] {
    let (end, kind) = match format {
        Format::Png => ("png", "image/png"),
        Format::Exr => ("exr", "image/x-exr"),
        _ => ("hdr", "image/vnd.radiance"),
    };
    let name = format!("attachment; filename=\"holodeck-{frame}.{end}\"");
    [(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_DISPOSITION, name)]
}

async fn answer(
    frame: u64,
    format: Format,
    encode: impl FnOnce() -> Result<Vec<u8>> + Send + 'static,
) -> Response {
    match tokio::task::spawn_blocking(encode).await {
        Ok(Ok(bytes)) => (headers(frame, format), bytes).into_response(),
        _ => (StatusCode::INTERNAL_SERVER_ERROR, "the picture cannot be encoded").into_response(),
    }
}
