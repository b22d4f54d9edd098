//! Who connects, and whether the server takes it.

use std::net::SocketAddr;

use holo_proto::{
    ProtoError,
    control::{Control, Welcome},
    frame::Kind,
    hello::{Answer, Hello, Role},
};
use tokio::{net::TcpStream, time::timeout};

use crate::{
    HANDSHAKE_TIME, Inbox, NetError, Outbox,
    inbox::{FROM_A_PEER, FROM_THE_SERVER, FrameReader},
};

/// Connects to a server and is taken by it in `role`.
///
/// # Errors
/// Any [`NetError`]; [`NetError::Refused`] carries the server's reason.
pub async fn connect(
    address: SocketAddr,
    role: Role,
    name: &str,
) -> Result<(Inbox, Outbox, Welcome), NetError> {
    let shake = async {
        let (mut reader, outbox) = split(TcpStream::connect(address).await?);
        outbox.send(Kind::Hello, &Hello::new(role, name).encode())?;
        match Answer::decode(&reader.frame_of(Kind::Answer).await?)? {
            Answer::Accepted => {}
            Answer::Refused(reason) => return Err(NetError::Refused(reason)),
        }
        match Control::decode(&reader.frame_of(Kind::Control).await?)? {
            Control::Welcome(welcome) => {
                let inbox = Inbox::start(reader, outbox.downgrade(), FROM_THE_SERVER);
                Ok((inbox, outbox, *welcome))
            }
            _ => Err(ProtoError::NotHolodeck.into()),
        }
    };
    timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)?
}

/// Reads the hello of whoever has connected. A side of another version is refused with a reason.
///
/// The caller then decides, and calls [`welcome`] or [`refuse`].
///
/// # Errors
/// Any [`NetError`].
pub async fn accept(stream: TcpStream) -> Result<(Inbox, Outbox, Hello), NetError> {
    let (mut reader, outbox) = split(stream);
    let shake = async {
        let hello = Hello::decode(&reader.frame_of(Kind::Hello).await?);
        match hello.and_then(|hello| hello.check_version().map(|()| hello)) {
            Ok(hello) => Ok::<_, NetError>(hello),
            Err(error) => {
                refuse(&outbox, &error.to_string());
                Err(error.into())
            }
        }
    };
    let hello = timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)??;
    Ok((Inbox::start(reader, outbox.downgrade(), FROM_A_PEER), outbox, hello))
}

/// Takes whoever has connected, says what the holodeck is, and pings it from now on.
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

/// Tells whoever has connected why it is not taken. The connection ends when the halves are
/// dropped.
pub fn refuse(outbox: &Outbox, reason: &str) {
    // A hello's answer always fits its frame: texts are cut to size.
    let _ = outbox.send(Kind::Answer, &Answer::Refused(reason.to_owned()).encode());
}

/// Splits a stream into a reader and an outbox.
fn split(stream: TcpStream) -> (FrameReader, Outbox) {
    // Packets are small and somebody waits for each: Nagle's delay would show. If it cannot be
    // switched off, everything still works.
    let _ = stream.set_nodelay(true);
    let (read, write) = stream.into_split();
    (FrameReader::new(read), Outbox::start(write))
}
