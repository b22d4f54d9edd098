//! The handshake: a peer introduces itself, and the server accepts or refuses it.

use holo_proto::{
    ProtoError,
    control::{Control, Welcome},
    frame::{FrameKind, MAX_HELLO_BYTES},
    hello::{Answer, Hello, Role},
    proof::{Challenge, MachineProof, Proof},
};
use ring::hmac;
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpStream, ToSocketAddrs},
    time::timeout,
};

use crate::{
    Access, Destination, HANDSHAKE_TIME, Identity, Inbox, MachineId, MachineKey, NetError, Outbox,
    Token,
    identity::key,
    inbox::{FROM_A_PEER, FROM_THE_SERVER, FrameReader},
    last_heard::LastHeard,
    machine,
    private_files::random,
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

/// The fingerprint that stands for a server without encryption.
const NO_CERTIFICATE: [u8; 32] = [0; 32];

/// The reason for refusing a worker whose proof is wrong.
const NO_MACHINE: &str = "it did not prove which machine it belongs to";

/// Connects to a server in `role`, and waits until the server accepts. A worker belongs to a
/// machine that no server knows.
///
/// # Errors
/// As [`connect_as`].
pub async fn connect(
    server: impl Into<Destination>,
    role: Role,
    name: &str,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    connect_as(server, role, name, None).await
}

/// Connects as [`connect`] does. A worker proves that it belongs to `machine`.
///
/// # Errors
/// Any [`NetError`]; [`NetError::Refused`] carries the server's reason.
pub async fn connect_as(
    server: impl Into<Destination>,
    role: Role,
    name: &str,
    machine: Option<&MachineKey>,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let server = server.into();
    let token = match &server {
        Destination::Loopback(_) => None,
        Destination::Invited(invitation) => Some((invitation.token, invitation.fingerprint)),
    };
    let shake = async {
        let connection = reach(&server).await?;
        introduce(connection, role, name, token, machine).await
    };
    timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)?
}

/// Connects as [`connect_as`] does, over any byte stream to a server of this process.
///
/// # Errors
/// As [`connect_as`].
pub async fn connect_over(
    stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static,
    role: Role,
    name: &str,
    machine: Option<&MachineKey>,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let shake = introduce(start(tls::split(stream)), role, name, None, machine);
    timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)?
}

/// Introduces this peer, and waits for acceptance. If there is a token, proves that it holds the
/// token. A worker proves its machine.
async fn introduce(
    (mut reader, outbox): (FrameReader, Outbox),
    role: Role,
    name: &str,
    token: Option<(Token, [u8; 32])>,
    machine: Option<&MachineKey>,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let hello = Hello::new(role, name).encode();
    outbox.send(FrameKind::Hello, &hello)?;
    if token.is_some() || role == Role::Worker {
        let challenge = challenged(&mut reader).await?;
        if let Some((token, _)) = &token {
            outbox.send(FrameKind::Proof, &prove(token, &challenge, &hello).encode())?;
        }
        if role == Role::Worker {
            let fingerprint = token.map_or(NO_CERTIFICATE, |(_, fingerprint)| fingerprint);
            let proof = match machine {
                Some(machine) => machine.prove(&challenge, &fingerprint, &hello),
                None => MachineKey::new()?.prove(&challenge, &fingerprint, &hello),
            };
            outbox.send(FrameKind::MachineProof, &proof.encode())?;
        }
    }
    accepted(&reader.frame_of(FrameKind::Answer).await?)?;
    match Control::decode(&reader.frame_of(FrameKind::Control).await?)? {
        Control::Welcome(welcome) => {
            outbox.keep_alive();
            let inbox = Inbox::start(reader, FROM_THE_SERVER);
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

/// Waits for a server's challenge.
async fn challenged(reader: &mut FrameReader) -> Result<Challenge, NetError> {
    let (kind, payload) = reader.frame_of_either(FrameKind::Challenge, FrameKind::Answer).await?;
    if kind == FrameKind::Answer {
        accepted(&payload)?;
        // A server that asks for no proof is not the one that issued the token.
        return Err(ProtoError::NotHolodeck.into());
    }
    Ok(Challenge::decode(&payload)?)
}

/// Returns the proof that this peer holds a token.
fn prove(token: &Token, challenge: &Challenge, hello: &[u8]) -> Proof {
    let mut mac = [0; 32];
    mac.copy_from_slice(hmac::sign(&key(token), &[&challenge.0, hello].concat()).as_ref());
    Proof { token: token.id, mac }
}

fn accepted(answer: &[u8]) -> Result<(), NetError> {
    match Answer::decode(answer)? {
        Answer::Accepted => Ok(()),
        Answer::Refused(reason) => Err(NetError::Refused(reason)),
    }
}

/// Reads the hello of a peer on this machine. A peer of another version is refused with a reason,
/// and so is a worker that does not prove its machine.
///
/// The caller then decides, and calls [`welcome`] or [`refuse`].
///
/// # Errors
/// Any [`NetError`].
pub async fn accept(stream: TcpStream) -> Result<(Inbox, Outbox, Hello, Access), NetError> {
    at_once(&stream);
    greet(start(tls::plain(stream))).await
}

/// Reads a hello as [`accept`] does, over any byte stream from a peer of this process.
///
/// # Errors
/// Any [`NetError`].
pub async fn accept_over(
    stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static,
) -> Result<(Inbox, Outbox, Hello, Access), NetError> {
    greet(start(tls::split(stream))).await
}

/// Reads the hello of the peer, and the proof of a worker's machine.
async fn greet(
    (mut reader, outbox): (FrameReader, Outbox),
) -> Result<(Inbox, Outbox, Hello, Access), NetError> {
    let shake = async {
        let (bytes, hello) = read_hello(&mut reader, &outbox).await?;
        if hello.role != Role::Worker {
            return Ok((hello, Access::of_this_machine(None)));
        }
        let challenge = challenge(&outbox)?;
        match check_machine(&mut reader, &challenge, &NO_CERTIFICATE, &bytes).await? {
            Some(machine) => Ok((hello, Access::of_this_machine(Some(machine)))),
            None => Err(refused(&outbox, NO_MACHINE).await),
        }
    };
    let (hello, access) =
        timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)??;
    Ok((Inbox::start(reader, FROM_A_PEER), outbox, hello, access))
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
        let challenge = challenge(&outbox)?;
        let access = check_proof(&mut reader, &challenge, identity, &bytes).await?;
        let machine = match hello.role {
            Role::Worker => {
                let fingerprint = identity.fingerprint();
                check_machine(&mut reader, &challenge, &fingerprint, &bytes).await?
            }
            _ => None,
        };
        let reason = match access {
            None => "its token is not one of this server's, or was revoked",
            Some(access) if !access.rights.permits(hello.role) => {
                "its token does not permit that role"
            }
            Some(_) if hello.role == Role::Worker && machine.is_none() => NO_MACHINE,
            Some(access) => return Ok((reader, outbox, hello, Access { machine, ..access })),
        };
        Err(refused(&outbox, reason).await)
    };
    let (reader, outbox, hello, access) =
        timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)??;
    Ok((Inbox::start(reader, FROM_A_PEER), outbox, hello, access))
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
    Ok(refused(&outbox, UNENCRYPTED).await)
}

/// Refuses a peer, and waits until the reason has left.
async fn refused(outbox: &Outbox, reason: &str) -> NetError {
    refuse(outbox, reason);
    outbox.drained().await;
    NetError::Refused(reason.to_owned())
}

/// Sends a challenge.
fn challenge(outbox: &Outbox) -> Result<Challenge, NetError> {
    let challenge = Challenge(random()?);
    outbox.send(FrameKind::Challenge, &challenge.encode())?;
    Ok(challenge)
}

/// Reads the proof of a worker's machine. Returns the machine; `None` if the proof is wrong.
async fn check_machine(
    reader: &mut FrameReader,
    challenge: &Challenge,
    fingerprint: &[u8; 32],
    hello: &[u8],
) -> Result<Option<MachineId>, NetError> {
    let proof = MachineProof::decode(&reader.frame_of(FrameKind::MachineProof).await?)?;
    Ok(machine::proven(&proof, challenge, fingerprint, hello))
}

/// Reads a hello. Returns its bytes and their content.
async fn read_hello(
    reader: &mut FrameReader,
    outbox: &Outbox,
) -> Result<(Vec<u8>, Hello), NetError> {
    let bytes = reader.frame_of(FrameKind::Hello).await?;
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
    challenge: &Challenge,
    identity: &Identity,
    hello: &[u8],
) -> Result<Option<Access>, NetError> {
    let proof = Proof::decode(&reader.frame_of(FrameKind::Proof).await?)?;
    let known = identity.tokens()?.into_iter().find(|(token, _)| token.id == proof.token);
    Ok(known.and_then(|(token, rights)| {
        let said = [&challenge.0, hello].concat();
        hmac::verify(&key(&token), &said, &proof.mac).ok()?;
        Some(Access { rights, token: Some(token.name()), machine: None })
    }))
}

/// Accepts a peer, sends it the holodeck's description, and pings it from now on.
///
/// # Errors
/// [`ProtoError::TooLong`] if the welcome is longer than a control message may be.
pub fn welcome(outbox: &Outbox, welcome: Welcome) -> Result<(), ProtoError> {
    let welcome = Control::Welcome(Box::new(welcome));
    outbox.send(FrameKind::Answer, &Answer::Accepted.encode())?;
    outbox.control(&welcome)?;
    outbox.keep_alive();
    Ok(())
}

/// Refuses a peer with a reason. The connection ends when the halves are dropped.
pub fn refuse(outbox: &Outbox, reason: &str) {
    // The answer to a hello always fits its frame, because texts are truncated.
    let _ = outbox.send(FrameKind::Answer, &Answer::Refused(reason.to_owned()).encode());
}

/// Disables Nagle's algorithm.
fn at_once(stream: &TcpStream) {
    // Packets are small and the other side waits for each, so Nagle's delay would be noticeable.
    // Without this option, everything still works.
    let _ = stream.set_nodelay(true);
}

fn start((read, write): (ReadHalf, WriteHalf)) -> (FrameReader, Outbox) {
    let heard = LastHeard::new();
    (FrameReader::new(read, heard.clone()), Outbox::start(write, heard))
}
