//! What comes from the server: pings are answered and records handed on as they come, the rest waits for the session.

use std::sync::mpsc;

use holo_net::{Inbox, Message, NetError, Outbox};
use holo_proto::control::Control;

use crate::lights::Lights;

/// What a session waits for.
pub enum Incoming {
    /// A message that is the session's affair.
    Message(Message),
    /// The connection is gone.
    Lost(NetError),
    /// The user wants to end.
    Stop,
}

/// Reads until the connection or the session is over.
pub async fn read(
    mut inbox: Inbox,
    outbox: Outbox,
    messages: mpsc::Sender<Incoming>,
    lights: Lights,
) {
    loop {
        let incoming = match inbox.next().await {
            Ok(Message::Control(Control::Ping(number))) => {
                if outbox.control(&Control::Pong(number)).is_err() {
                    return;
                }
                continue;
            }
            Ok(Message::Light(light)) => {
                lights.give(light);
                continue;
            }
            Ok(message) => Incoming::Message(message),
            Err(error) => Incoming::Lost(error),
        };
        let over = matches!(incoming, Incoming::Lost(_));
        if messages.send(incoming).is_err() || over {
            return;
        }
    }
}
