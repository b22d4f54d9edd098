//! The handshake: a peer introduces itself, and the server accepts or refuses it.

use holo_proto::{
    ProtoError,
    control::{Control, Welcome},
    frame::{Kind, MAX_HELLO_BYTES},
    hello::{Answer, Hello, Role},
    proof::{Challenge, Proof},
};
use ring::hmac;
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpStream, ToSocketAddrs},
    time::timeout,
};

use crate::{
    Access, Destination, HANDSHAKE_TIME, Identity, Inbox, NetError, Outbox, Token,
    identity::{key, random},
    inbox::{FROM_A_PEER, FROM_THE_SERVER, FrameReader},
    tls::{self, ReadHalf, WriteHalf},
};

/// The first byte of every encrypted connection: a record of TLS's handshake. Its version follows,
/// 3.1 or later.
const TLS_HANDSHAKE: u8 = 0x16;

// The third byte of a hello's frame is a byte of its length, and is 0. The third byte of TLS is
// not.
const _: () = assert!(MAX_HELLO_BYTES < 1 << 16);

/// The reason for refusing a peer that does not encrypt.
const UNENCRYPTED: &str =
    "connections here are encrypted; join by the string that the server prints (holodeck://…)";

/// Connects to a server in `role`, and waits until the server accepts.
///
/// # Errors
/// Any [`NetError`]; [`NetError::Refused`] carries the server's reason.
pub async fn connect(
    server: impl Into<Destination>,
    role: Role,
    name: &str,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let server = server.into();
    let token = match &server {
        Destination::Loopback(_) => None,
        Destination::Invited(invitation) => Some(invitation.token),
    };
    let shake = async {
        let connection = reach(&server).await?;
        introduce(connection, role, name, token).await
    };
    timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)?
}

/// Connects as [`connect`] does, over any byte stream to a server of this process.
///
/// # Errors
/// As [`connect`].
pub async fn connect_over(
    stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static,
    role: Role,
    name: &str,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let shake = introduce(start(tls::split(stream)), role, name, None);
    timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)?
}

/// Introduces this peer, proves that it holds the token if there is one, and waits for acceptance.
async fn introduce(
    (mut reader, outbox): (FrameReader, Outbox),
    role: Role,
    name: &str,
    token: Option<Token>,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let hello = Hello::new(role, name).encode();
    outbox.send(Kind::Hello, &hello)?;
    if let Some(token) = token {
        prove(&mut reader, &outbox, &token, &hello).await?;
    }
    accepted(&reader.frame_of(Kind::Answer).await?)?;
    match Control::decode(&reader.frame_of(Kind::Control).await?)? {
        Control::Welcome(welcome) => {
            let inbox = Inbox::start(reader, outbox.downgrade(), FROM_THE_SERVER);
            Ok((inbox, outbox, *welcome))
        }
        _ => Err(ProtoError::NotHolodeck.into()),
    }
}

/// Opens a connection, encrypted if the server is on another machine.
async fn reach(server: &Destination) -> Result<(FrameReader, Outbox), NetError> {
    Ok(match server {
        Destination::Loopback(address) => start(tls::plain(open(address).await?)),
        Destination::Invited(invitation) => {
            let stream = open(&invitation.address).await?;
            start(tls::connect(stream, invitation.fingerprint).await?)
        }
    })
}

async fn open(address: impl ToSocketAddrs) -> Result<TcpStream, NetError> {
    let stream = TcpStream::connect(address).await?;
    at_once(&stream);
    Ok(stream)
}

/// Proves to a server that this peer holds a token.
async fn prove(
    reader: &mut FrameReader,
    outbox: &Outbox,
    token: &Token,
    hello: &[u8],
) -> Result<(), NetError> {
    let (kind, payload) = reader.frame_of_either(Kind::Challenge, Kind::Answer).await?;
    if kind == Kind::Answer {
        accepted(&payload)?;
        // A server that asks for no proof is not the one that issued the token.
        return Err(ProtoError::NotHolodeck.into());
    }
    let challenge = Challenge::decode(&payload)?;
    let mut mac = [0; 32];
    mac.copy_from_slice(hmac::sign(&key(token), &[&challenge.0, hello].concat()).as_ref());
    Ok(outbox.send(Kind::Proof, &Proof { token: token.id, mac }.encode())?)
}

fn accepted(answer: &[u8]) -> Result<(), NetError> {
    match Answer::decode(answer)? {
        Answer::Accepted => Ok(()),
        Answer::Refused(reason) => Err(NetError::Refused(reason)),
    }
}

/// Reads the hello of a peer on this machine. A peer of another version is refused with a reason.
///
/// The caller then decides, and calls [`welcome`] or [`refuse`].
///
/// # Errors
/// Any [`NetError`].
pub async fn accept(stream: TcpStream) -> Result<(Inbox, Outbox, Hello), NetError> {
    at_once(&stream);
    greet(start(tls::plain(stream))).await
}

/// Reads a hello as [`accept`] does, over any byte stream from a peer of this process.
///
/// # Errors
/// Any [`NetError`].
pub async fn accept_over(
    stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static,
) -> Result<(Inbox, Outbox, Hello), NetError> {
    greet(start(tls::split(stream))).await
}

/// Reads the hello of the peer.
async fn greet(
    (mut reader, outbox): (FrameReader, Outbox),
) -> Result<(Inbox, Outbox, Hello), NetError> {
    let shake = read_hello(&mut reader, &outbox);
    let (_, hello) = timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)??;
    Ok((Inbox::start(reader, outbox.downgrade(), FROM_A_PEER), outbox, hello))
}

/// Reads the hello of a peer on any machine over an encrypted connection, and lets it prove that it
/// holds a token. A peer without that proof, or without the right to its role, is refused.
///
/// # Errors
/// Any [`NetError`].
pub async fn accept_secure(
    stream: TcpStream,
    identity: &Identity,
) -> Result<(Inbox, Outbox, Hello, Access), NetError> {
    let shake = async {
        at_once(&stream);
        if !begins_encrypted(&stream).await? {
            return Err(refuse_unencrypted(stream).await?);
        }
        let (mut reader, outbox) = start(tls::serve(stream, identity).await?);
        let (bytes, hello) = read_hello(&mut reader, &outbox).await?;
        let access = check_proof(&mut reader, &outbox, identity, &bytes).await?;
        let reason = match access {
            None => "its token is not one of this server's, or was revoked",
            Some(access) if !access.rights.permits(hello.role) => {
                "its token does not permit that role"
            }
            Some(access) => return Ok((reader, outbox, hello, access)),
        };
        refuse(&outbox, reason);
        outbox.drained().await;
        Err(NetError::Refused(reason.to_owned()))
    };
    let (reader, outbox, hello, access) =
        timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)??;
    Ok((Inbox::start(reader, outbox.downgrade(), FROM_A_PEER), outbox, hello, access))
}

/// Returns true if the first bytes from a peer may begin TLS. If fewer than three arrive at once,
/// TLS itself checks them.
async fn begins_encrypted(stream: &TcpStream) -> Result<bool, NetError> {
    let mut first = [0; 3];
    let peeked = stream.peek(&mut first).await?;
    let first = &first[..peeked];
    Ok(first.first().is_none_or(|byte| *byte == TLS_HANDSHAKE) && first.get(2) != Some(&0))
}

/// Refuses a peer that speaks the protocol without encryption, and reports to it how to join.
async fn refuse_unencrypted(stream: TcpStream) -> Result<NetError, NetError> {
    let (mut reader, outbox) = start(tls::plain(stream));
    read_hello(&mut reader, &outbox).await?;
    refuse(&outbox, UNENCRYPTED);
    outbox.drained().await;
    Ok(NetError::Refused(UNENCRYPTED.to_owned()))
}

/// Reads a hello. Returns its bytes and their content.
async fn read_hello(
    reader: &mut FrameReader,
    outbox: &Outbox,
) -> Result<(Vec<u8>, Hello), NetError> {
    let bytes = reader.frame_of(Kind::Hello).await?;
    let hello = Hello::decode(&bytes);
    match hello.and_then(|hello| hello.check_version().map(|()| hello)) {
        Ok(hello) => Ok((bytes, hello)),
        Err(error) => {
            refuse(outbox, &error.to_string());
            Err(error.into())
        }
    }
}

/// Lets the other side prove that it holds a token. Returns the token's permissions; `None` without
/// a valid proof.
async fn check_proof(
    reader: &mut FrameReader,
    outbox: &Outbox,
    identity: &Identity,
    hello: &[u8],
) -> Result<Option<Access>, NetError> {
    let challenge = Challenge(random()?);
    outbox.send(Kind::Challenge, &challenge.encode())?;
    let proof = Proof::decode(&reader.frame_of(Kind::Proof).await?)?;
    let known = identity.tokens()?.into_iter().find(|(token, _)| token.id == proof.token);
    Ok(known.and_then(|(token, rights)| {
        let said = [&challenge.0, hello].concat();
        hmac::verify(&key(&token), &said, &proof.mac).ok()?;
        Some(Access { rights, token: Some(token.name()) })
    }))
}

/// Accepts a peer, sends it the holodeck's description, and pings it from now on.
///
/// # Errors
/// [`ProtoError::TooLong`] if the welcome is longer than a control message may be.
pub fn welcome(outbox: &Outbox, welcome: Welcome) -> Result<(), ProtoError> {
    let welcome = Control::Welcome(Box::new(welcome));
    outbox.send(Kind::Answer, &Answer::Accepted.encode())?;
    outbox.control(&welcome)?;
    outbox.keep_alive();
    Ok(())
}

/// Refuses a peer with a reason. The connection ends when the halves are dropped.
pub fn refuse(outbox: &Outbox, reason: &str) {
    // The answer to a hello always fits its frame, because texts are truncated.
    let _ = outbox.send(Kind::Answer, &Answer::Refused(reason.to_owned()).encode());
}

/// Disables Nagle's algorithm.
fn at_once(stream: &TcpStream) {
    // Packets are small and the other side waits for each, so Nagle's delay would be noticeable.
    // Without this option, everything still works.
    let _ = stream.set_nodelay(true);
}

fn start((read, write): (ReadHalf, WriteHalf)) -> (FrameReader, Outbox) {
    (FrameReader::new(read), Outbox::start(write))
}
