//! Pictures that a person saves: as seen, or in radiance.

use std::sync::Arc;

use axum::{
    extract::{RawQuery, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use holo_picture::Format;

use super::{
    encode::{Coding, Colours, Rect},
    hub::Hub,
};
use crate::{
    screen::{Display, Exposure},
    stage::Shown,
};

/// Answers with the latest frame as it looks: `?exposure=FACTOR`, else automatically exposed.
pub async fn png(State(hub): State<Arc<Hub>>, RawQuery(query): RawQuery) -> Response {
    let query = query.unwrap_or_default();
    let factor = query.strip_prefix("exposure=").and_then(|factor| factor.parse().ok());
    let exposure = factor.map_or(Exposure::Automatic, Exposure::Locked);
    answer(&hub, "png", "image/png", move |shown| {
        let display = Display { exposure, stops: 0.0 };
        let (bytes, size) = (display.colours(shown), shown.frame.picture.size());
        let whole = Rect { x: 0, y: 0, width: size.0, height: size.1 };
        Colours { bytes: &bytes, size }.encode(whole, Coding::Png)
    })
    .await
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
    answer(hub, end, kind, move |shown| Ok(shown.frame.picture.encode(format)?)).await
}

async fn answer(
    hub: &Hub,
    end: &str,
    kind: &'static str,
    encode: impl FnOnce(&Shown) -> anyhow::Result<Vec<u8>> + Send + 'static,
) -> Response {
    let Some(shown) = hub.latest() else {
        return (StatusCode::NOT_FOUND, "there is no picture yet").into_response();
    };
    let name = format!("attachment; filename=\"holodeck-{}.{end}\"", shown.number);
    let encoded = tokio::task::spawn_blocking(move || encode(&shown)).await;
    match encoded {
        Ok(Ok(bytes)) => {
            let headers =
                [(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_DISPOSITION, name)];
            (headers, bytes).into_response()
        }
        _ => (StatusCode::INTERNAL_SERVER_ERROR, "the picture cannot be encoded").into_response(),
    }
}
