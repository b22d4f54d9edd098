//! The page: one document, one style sheet and two scripts, all compiled into this program.

use axum::{
    http::header,
    response::{Html, IntoResponse},
};

/// The document.
pub async fn index() -> Html<&'static str> {
    Html(include_str!("page/index.html"))
}

/// The style sheet.
pub async fn style() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "text/css; charset=utf-8")], include_str!("page/walk.css"))
}

/// The script.
pub async fn script() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "text/javascript; charset=utf-8")], include_str!("page/walk.js"))
}

/// The script of the panel for sky and lamps.
pub async fn light_script() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, "text/javascript; charset=utf-8")], include_str!("page/light.js"))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_page_is_small_and_loads_nothing_from_elsewhere() {
        let parts = [
            include_str!("page/index.html"),
            include_str!("page/walk.css"),
            include_str!("page/walk.js"),
            include_str!("page/light.js"),
        ];
        assert!(parts.iter().map(|part| part.len()).sum::<usize>() <= 200_000);
        for part in parts {
            let elsewhere = part.replace("http://www.w3.org/2000/svg", "");
            assert!(!elsewhere.contains("http://") && !elsewhere.contains("https://"));
        }
    }
}
