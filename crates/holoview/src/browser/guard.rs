//! Restricts requests to this machine's own names and to the page that it serves.
//!
//! A page of another site can make its visitors' browsers send requests to this machine. It may use
//! this machine's name, or a name of its own that points here (DNS rebinding). Browsers state the
//! page's site in `Origin` and the name in `Host`.

use axum::{
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Response},
};

/// Names of this machine that no other machine can have.
const NAMES: [&str; 3] = ["127.0.0.1", "localhost", "[::1]"];

/// Headers that restrict what a browser does with answers: it may show them on this page only.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
         connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
];

/// Refuses requests for other names and from other origins.
pub async fn guard(State(port): State<u16>, request: Request, next: Next) -> Response {
    let needs_origin = request.headers().contains_key(header::UPGRADE);
    let mut response = match refusal(request.headers(), port, needs_origin) {
        Some(reason) => (StatusCode::FORBIDDEN, reason).into_response(),
        None => next.run(request).await,
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Returns why a request is refused, or `None` if it is allowed.
fn refusal(headers: &HeaderMap, port: u16, needs_origin: bool) -> Option<&'static str> {
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    let is_here = |host: &str| NAMES.iter().any(|name| host == format!("{name}:{port}"));
    if !text(header::HOST).is_some_and(is_here) {
        return Some("this page is served to this machine alone, under its own name");
    }
    let is_own = |origin: &str| origin.strip_prefix("http://").is_some_and(is_here);
    match headers.get(header::ORIGIN) {
        None if needs_origin => Some("a session is for the page of this server alone"),
        None => None,
        Some(_) if text(header::ORIGIN).is_some_and(is_own) => None,
        Some(_) => Some("this is not for pages of other sites"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_refused(host: Option<&str>, origin: Option<&str>, needs_origin: bool) -> bool {
        let mut headers = HeaderMap::new();
        let mut set = |name, value: Option<&str>| {
            value.map(|value| headers.insert(name, value.parse().unwrap()))
        };
        set(header::HOST, host);
        set(header::ORIGIN, origin);
        refusal(&headers, 8080, needs_origin).is_some()
    }

    #[test]
    fn only_this_machines_own_names_and_origins_are_served() {
        for host in ["127.0.0.1:8080", "localhost:8080", "[::1]:8080"] {
            assert!(!is_refused(Some(host), None, false), "{host}");
            assert!(is_refused(Some(host), None, true), "a session without an origin");
            assert!(!is_refused(Some(host), Some("http://localhost:8080"), true));
            for origin in [
                "http://evil.example",
                "http://127.0.0.1:8081",
                "https://127.0.0.1:8080",
                "http://127.0.0.1:8080.evil.example",
                "null",
                "",
            ] {
                assert!(is_refused(Some(host), Some(origin), false), "{origin}");
            }
        }
        for host in ["evil.example:8080", "127.0.0.1", "127.0.0.1:80", "localhost.evil:8080"] {
            assert!(is_refused(Some(host), None, false), "{host}");
        }
        assert!(is_refused(None, None, false));
    }
}
