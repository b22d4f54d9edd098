//! Who connects, and whether it is taken.

use std::net::SocketAddr;

use holo_proto::{
    ProtoError,
    control::{Control, Welcome},
    frame::Kind,
    hello::{Answer, Hello, Role},
};
use tokio::{net::TcpStream, time::timeout};

use crate::{
    HANDSHAKE_TIME, NetError,
    connection::{Inbox, Message, Outbox, split},
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
        let (mut inbox, outbox) = split(TcpStream::connect(address).await?);
        outbox.send(Kind::Hello, &Hello::new(role, name).encode())?;
        match Answer::decode(&inbox.frame_of(Kind::Answer).await?)? {
            Answer::Accepted => {}
            Answer::Refused(reason) => return Err(NetError::Refused(reason)),
        }
        match inbox.next().await? {
            Message::Control(Control::Welcome(welcome)) => Ok((inbox, outbox, *welcome)),
            _ => Err(ProtoError::NotHolodeck.into()),
        }
    };
    timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)?
}

/// Reads the hello of whoever has connected. A side of another version is told so and refused; whether it is taken
/// otherwise is for the caller, who answers with [`Answer::Accepted`] and a welcome, or with [`refuse`].
///
/// # Errors
/// Any [`NetError`].
pub async fn accept(stream: TcpStream) -> Result<(Inbox, Outbox, Hello), NetError> {
    let (mut inbox, outbox) = split(stream);
    let shake = async {
        let hello = Hello::decode(&inbox.frame_of(Kind::Hello).await?);
        match hello.and_then(|hello| hello.check_version().map(|()| hello)) {
            Ok(hello) => Ok::<_, NetError>(hello),
            Err(error) => {
                refuse(&outbox, &error.to_string());
                Err(error.into())
            }
        }
    };
    let hello = timeout(HANDSHAKE_TIME, shake).await.map_err(|_| NetError::Handshake)??;
    Ok((inbox, outbox, hello))
}

/// Tells whoever has connected why it is not taken. The connection ends when the halves are dropped.
pub fn refuse(outbox: &Outbox, reason: &str) {
    // A hello's answer always fits its frame: texts are cut to size.
    let _ = outbox.send(Kind::Answer, &Answer::Refused(reason.to_owned()).encode());
}
