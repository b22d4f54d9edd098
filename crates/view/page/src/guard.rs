//! Restricts requests: on this machine to its own names and to the page that it serves, from other
//! machines to clients with the page's token.
//!
//! A page of another site can make its visitors' browsers send requests to this machine. It may use
//! this machine's name, or a name of its own that points here (DNS rebinding). Browsers state the
//! page's site in `Origin` and the name in `Host`. They send no `Origin` with requests for images,
//! but `Sec-Fetch-Site` with all.
//!
//! A client on another machine shows its token once, in the page's address. It then has a cookie,
//! which its browser sends with each request of the page.

use axum::{
    extract::{ConnectInfo, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Redirect, Response},
};
use holo_net::Secret;

use super::connections::Visitor;

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

/// Why a program of this machine may not enter.
const NOT_HERE: &str = "this page is served to this machine alone, under its own name";

/// Why a client on another machine may not enter.
const NO_TOKEN: &str = "open the whole address that was printed, with its token";

/// Why a page of another site may not enter.
const OTHER_SITE: &str = "this is not for pages of other sites";

/// How much a request must prove of where it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    /// Nothing, if a person goes to the page, even by a link of another site.
    Visit,
    /// That no other site's page sends it.
    NoOtherSite,
    /// That the page itself sends it, because it takes long or much memory.
    OwnPage,
    /// The page's origin: sessions, which browsers let any site begin.
    Origin,
}

impl Need {
    fn of(request: &Request) -> Need {
        let mode = request.headers().get("sec-fetch-mode").map(HeaderValue::as_bytes);
        let path = request.uri().path();
        let has_size = || {
            let query = request.uri().query().unwrap_or_default();
            query.split('&').any(|part| part.starts_with("size="))
        };
        if request.headers().contains_key(header::UPGRADE) {
            Need::Origin
        } else if path.starts_with("/dropped/") || path.starts_with("/picture.") && has_size() {
            Need::OwnPage
        } else if path == "/" && mode == Some(b"navigate") {
            Need::Visit
        } else {
            Need::NoOtherSite
        }
    }
}

/// Who may enter.
#[derive(Clone)]
pub enum EntryGuard {
    /// Programs of this machine, under its own names.
    Here { port: u16 },
    /// Clients with the token, under any name.
    Outside { port: u16, token: Secret },
}

/// Answers requests that may not enter, and passes on the others.
pub async fn guard(State(gate): State<EntryGuard>, request: Request, next: Next) -> Response {
    let visitor = request.extensions().get::<ConnectInfo<Visitor>>().map(|info| info.0.clone());
    let mut response = if let Some(cookie) = gate.cookie_for(&request) {
        ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response()
    } else if let Some(reason) = gate.refusal(request.headers(), Need::of(&request)) {
        (StatusCode::FORBIDDEN, reason).into_response()
    } else {
        visitor.iter().for_each(Visitor::asks);
        let response = next.run(request).await;
        visitor.iter().for_each(Visitor::is_answered);
        response
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

impl EntryGuard {
    /// Returns the cookie for a client that shows the token in the page's address.
    fn cookie_for(&self, request: &Request) -> Option<String> {
        let EntryGuard::Outside { port, token } = self else { return None };
        let mut parts = request.uri().query()?.split('&');
        let shown = parts.find_map(|part| part.strip_prefix("token="))?;
        (request.uri().path() == "/" && token.is(shown)).then(|| {
            format!("{}={token}; Path=/; Secure; HttpOnly; SameSite=Lax", cookie_name(*port))
        })
    }

    /// Returns why a request is refused, or `None` if it is allowed.
    fn refusal(&self, headers: &HeaderMap, need: Need) -> Option<&'static str> {
        let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        let host = text(header::HOST).unwrap_or_default();
        let scheme = match self {
            EntryGuard::Here { .. } if !self.is_own(host, host) => return Some(NOT_HERE),
            EntryGuard::Outside { port, token } if !shows(headers, *port, token) => {
                return Some(NO_TOKEN);
            }
            EntryGuard::Here { .. } => "http://",
            EntryGuard::Outside { .. } => "https://",
        };
        let is_own =
            |origin: &str| origin.strip_prefix(scheme).is_some_and(|site| self.is_own(site, host));
        let has_origin = headers.contains_key(header::ORIGIN);
        if has_origin && !text(header::ORIGIN).is_some_and(is_own) {
            return Some(OTHER_SITE);
        }
        // Other ports of this machine are the same site to a browser, but not this page.
        let site = HeaderName::from_static("sec-fetch-site");
        let has_site = headers.contains_key(&site);
        let site = text(site).unwrap_or_default();
        match need {
            Need::Visit => None,
            _ if has_site && site != "same-origin" && site != "none" => Some(OTHER_SITE),
            Need::NoOtherSite => None,
            Need::OwnPage if has_origin || site == "same-origin" => None,
            Need::OwnPage => {
                Some("pictures of a chosen size and models are for the page of this server alone")
            }
            Need::Origin if has_origin => None,
            Need::Origin => Some("a session is for the page of this server alone"),
        }
    }

    /// Returns whether a site is the page's own, in a request for the site `host`.
    fn is_own(&self, site: &str, host: &str) -> bool {
        match self {
            EntryGuard::Here { port } => NAMES.iter().any(|name| site == format!("{name}:{port}")),
            // A browser that has the cookie got it from this site.
            EntryGuard::Outside { .. } => site == host,
        }
    }
}

/// Returns whether a request has the cookie with the token.
fn shows(headers: &HeaderMap, port: u16, token: &Secret) -> bool {
    let lines = headers.get_all(header::COOKIE).iter().filter_map(|line| line.to_str().ok());
    lines.flat_map(|line| line.split(';')).any(|cookie| {
        let shown = cookie.trim().split_once('=');
        shown.is_some_and(|(name, value)| name == cookie_name(port) && token.is(value))
    })
}

/// Returns the name of the cookie. Browsers send cookies to all ports of a machine.
fn cookie_name(port: u16) -> String {
    format!("holodeck-{port}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_refused(
        gate: &EntryGuard,
        headers: &[(HeaderName, Option<&str>)],
        needs_origin: bool,
    ) -> bool {
        let need = if needs_origin { Need::Origin } else { Need::NoOtherSite };
        refuses(gate, headers, need)
    }

    fn refuses(gate: &EntryGuard, headers: &[(HeaderName, Option<&str>)], need: Need) -> bool {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            value.map(|value| map.append(name, value.parse().unwrap()));
        }
        gate.refusal(&map, need).is_some()
    }

    #[test]
    fn only_this_machines_own_names_and_origins_are_served() {
        let is_refused = |host: Option<&str>, origin: Option<&str>, needs_origin| {
            let headers = [(header::HOST, host), (header::ORIGIN, origin)];
            is_refused(&EntryGuard::Here { port: 8080 }, &headers, needs_origin)
        };
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

    #[test]
    fn other_sites_reach_only_the_page_by_a_link_and_pictures_by_size_are_for_the_page() {
        let gate = EntryGuard::Here { port: 8080 };
        let is_refused = |site: Option<&str>, origin: Option<&str>, need| {
            let headers = [
                (header::HOST, Some("localhost:8080")),
                (HeaderName::from_static("sec-fetch-site"), site),
                (header::ORIGIN, origin),
            ];
            refuses(&gate, &headers, need)
        };
        for site in ["cross-site", "same-site", "", "same-origin, none"] {
            for need in [Need::NoOtherSite, Need::OwnPage, Need::Origin] {
                assert!(is_refused(Some(site), None, need), "{site} {need:?}");
            }
            assert!(!is_refused(Some(site), None, Need::Visit));
        }
        assert!(!is_refused(None, None, Need::NoOtherSite));
        assert!(is_refused(None, None, Need::OwnPage));
        assert!(is_refused(Some("none"), None, Need::OwnPage));
        assert!(!is_refused(Some("same-origin"), None, Need::OwnPage));
        assert!(!is_refused(None, Some("http://localhost:8080"), Need::OwnPage));
        assert!(is_refused(Some("cross-site"), Some("http://localhost:8080"), Need::OwnPage));
    }

    #[test]
    fn a_request_needs_what_it_costs() {
        let need = |uri: &str, header: Option<(&str, &str)>| {
            let mut request = Request::builder().uri(uri);
            if let Some((name, value)) = header {
                request = request.header(name, value);
            }
            Need::of(&request.body(axum::body::Body::empty()).unwrap())
        };
        assert_eq!(need("/picture.png?size=8192x8192", None), Need::OwnPage);
        assert_eq!(need("/picture.exr?client=1&size=9x9", None), Need::OwnPage);
        assert_eq!(need("/picture.png?client=1", None), Need::NoOtherSite);
        assert_eq!(need("/", Some(("sec-fetch-mode", "navigate"))), Need::Visit);
        assert_eq!(need("/", Some(("sec-fetch-mode", "no-cors"))), Need::NoOtherSite);
        assert_eq!(need("/picture.png", Some(("sec-fetch-mode", "navigate"))), Need::NoOtherSite);
        assert_eq!(need("/session", Some(("upgrade", "websocket"))), Need::Origin);
    }

    #[test]
    fn other_machines_need_the_token_and_the_page_s_own_origin() {
        let (token, other) = (Secret::new().unwrap(), Secret::new().unwrap());
        let gate = EntryGuard::Outside { port: 8080, token: token.clone() };
        let is_refused = |cookie: Option<&str>, origin: Option<&str>, needs_origin| {
            let host = Some("house.example:8080");
            let headers =
                [(header::HOST, host), (header::COOKIE, cookie), (header::ORIGIN, origin)];
            is_refused(&gate, &headers, needs_origin)
        };
        let own = format!("holodeck-8080={token}");
        for cookie in [own.clone(), format!("a=b; {own}; c"), format!("holodeck-80={other};{own}")]
        {
            assert!(!is_refused(Some(&cookie), None, false), "{cookie}");
            assert!(!is_refused(Some(&cookie), Some("https://house.example:8080"), true));
            assert!(is_refused(Some(&cookie), None, true), "a session without an origin");
            for origin in ["https://evil.example", "http://house.example:8080", "null"] {
                assert!(is_refused(Some(&cookie), Some(origin), false), "{origin}");
            }
        }
        for cookie in [
            format!("holodeck-8080={other}"),
            format!("holodeck-8081={token}"),
            format!("holodeck-8080={token}x"),
            "holodeck-8080=".to_owned(),
            token.to_string(),
        ] {
            assert!(is_refused(Some(&cookie), None, false), "{cookie}");
        }
        assert!(is_refused(None, None, false));
    }
}
