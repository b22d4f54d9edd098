//! The page for other machines: its token, its origin, and clients that do not finish encryption.

use holo_net::{HANDSHAKE_TIME, Identity, encrypt_to};
use tokio::io::{AsyncRead, AsyncWrite};

use super::*;

/// A page for other machines, which the test reaches over loopback.
struct Outside {
    server: Server,
    fingerprint: [u8; 32],
    _folder: tempfile::TempDir,
}

impl Outside {
    async fn start() -> Outside {
        let folder = tempfile::tempdir().unwrap();
        let identity = Identity::open(folder.path()).unwrap();
        let fingerprint = identity.fingerprint();
        let door = PageSocket::outside(([127, 0, 0, 1], 0).into(), identity).await.unwrap();
        Outside { server: Server::behind(door), fingerprint, _folder: folder }
    }

    async fn stream(&self) -> impl AsyncRead + AsyncWrite + Unpin + use<> {
        let stream = TcpStream::connect(("127.0.0.1", self.server.port)).await.unwrap();
        encrypt_to(stream, self.fingerprint).await.unwrap()
    }

    /// Returns the answer to a request with this cookie.
    async fn get(&self, path: &str, cookie: &str) -> String {
        let request = format!(
            "GET {path} HTTP/1.1\r\nHost: house.example\r\nCookie: {cookie}\r\n\
             Connection: close\r\n\r\n"
        );
        let mut stream = self.stream().await;
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        timeout(LIMIT, stream.read_to_end(&mut answer)).await.unwrap().unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// Shows the token, and returns the cookie that the page's server gives.
    async fn cookie(&self) -> String {
        let (_, token) = self.server.url.split_once('?').unwrap();
        let answer = self.get(&format!("/?{token}"), "").await;
        assert!(answer.starts_with("HTTP/1.1 303"), "{answer}");
        let cookie = answer.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
        for part in ["Secure", "HttpOnly", "SameSite=Lax"] {
            assert!(cookie.contains(part), "{cookie}");
        }
        cookie.split(';').next().unwrap().to_owned()
    }

    /// Begins a session, and returns the first message.
    async fn session(&self, cookie: &str, origin: &str) -> Result<Value, Error> {
        let mut request = "wss://house.example/session".into_client_request().unwrap();
        request.headers_mut().insert("origin", origin.parse().unwrap());
        request.headers_mut().insert("cookie", cookie.parse().unwrap());
        let (mut socket, _) = client_async(request, self.stream().await).await?;
        let hello = timeout(LIMIT, socket.next()).await.unwrap().unwrap()?;
        Ok(serde_json::from_str(hello.to_text()?).unwrap())
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn another_machine_needs_the_token_for_the_page_the_pictures_and_the_session() {
    let outside = Outside::start().await;
    assert!(outside.server.url.starts_with("https://127.0.0.1:"), "{}", outside.server.url);
    let wrong = format!("holodeck-{}=wrong", outside.server.port);
    for path in ["/", "/walk.js", "/picture.png", "/?token=wrong", "/?token=", "/?"] {
        for cookie in ["", &wrong] {
            let answer = outside.get(path, cookie).await;
            assert!(answer.starts_with("HTTP/1.1 403"), "{path}: {answer}");
        }
    }
    let (own, other) = ("https://house.example", "https://evil.example");
    assert!(outside.session(&wrong, own).await.is_err());
    let cookie = outside.cookie().await;
    assert!(outside.get("/", &cookie).await.starts_with("HTTP/1.1 200"));
    assert!(outside.session(&cookie, other).await.is_err());
    assert_eq!(outside.session(&cookie, own).await.unwrap()["is"], "hello");
    outside.server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn half_requests_of_strangers_lock_nobody_out() {
    let outside = Outside::start().await;
    let cookie = outside.cookie().await;
    let mut half = Vec::new();
    for _ in 0..400 {
        let mut stream = outside.stream().await;
        stream.write_all(b"GET / HTTP/1.1\r\nHost: house").await.unwrap();
        half.push(stream);
    }
    assert!(outside.get("/", &cookie).await.starts_with("HTTP/1.1 200"));
    assert_eq!(outside.session(&cookie, "https://house.example").await.unwrap()["is"], "hello");
    // The first ones have given way, and the last ones have no more than their time.
    for at in [0, 399] {
        let mut rest = Vec::new();
        // The end may come without a word of the encryption.
        let _ = timeout(LIMIT, half[at].read_to_end(&mut rest)).await.expect("it is ended");
    }
    outside.server.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_that_do_not_finish_encryption_delay_nobody() {
    let outside = Outside::start().await;
    let mut silent = Vec::new();
    for _ in 0..200 {
        silent.push(TcpStream::connect(("127.0.0.1", outside.server.port)).await.unwrap());
    }
    let cookie = outside.cookie().await;
    assert!(outside.get("/", &cookie).await.starts_with("HTTP/1.1 200"));
    // The first ones have given way.
    let ended = timeout(HANDSHAKE_TIME / 2, silent[0].read(&mut [0])).await.unwrap();
    assert!(matches!(ended, Ok(0) | Err(_)), "{ended:?}");
    outside.server.end().await;
}
