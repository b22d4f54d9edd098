//! Reads what the server sends, on a task of its own, whatever the session is doing.
//!
//! Pings are answered at once. Pieces of the scene are taken in here.
//! Everything else waits for the session.

use std::sync::mpsc;

use anyhow::Result;
use holo_display::UsefulBeam;
use holo_net::{Inbox, Message, NetError, Outbox};
use holo_proto::control::Control;

use super::scene::{Blobs, SceneLoader};
use crate::drivers::LoadedScene;

/// What a session waits for.
pub enum Incoming {
    /// A message that is the session's affair.
    Message(Message),
    /// A piece of the scene arrived.
    SceneFetched {
        /// Bytes that are here.
        bytes: u64,
        /// Bytes of the whole scene.
        total: u64,
    },
    /// The whole scene arrived. It is being prepared, which takes seconds for millions of triangles.
    ScenePreparing,
    /// The scene is ready, or cannot be used.
    Scene(Result<Box<LoadedScene>>),
    /// A search for useful beams has ended.
    Found {
        /// The first request of the view that they are for.
        first_request: u32,
        /// The beams, in the order of their keys.
        beams: Vec<UsefulBeam>,
    },
    /// The connection is gone.
    Lost(NetError),
    /// A front end has something to do.
    Wake,
    /// The user wants to end.
    Stop,
}

/// Reads a connection for a session.
pub struct Reader {
    /// Where messages come from.
    pub inbox: Inbox,
    /// Where pings are answered.
    pub outbox: Outbox,
    /// Where the session waits.
    pub messages: mpsc::Sender<Incoming>,
    /// Collects the scene, if the session wants it.
    pub loader: Option<SceneLoader>,
}

impl Reader {
    /// Reads until the connection or the session is over.
    pub async fn run(mut self) {
        loop {
            let next = self.inbox.next().await;
            let incoming = match next {
                Ok(Message::Control(Control::Ping(number))) => {
                    if self.outbox.control(&Control::Pong(number)).is_err() {
                        return;
                    }
                    continue;
                }
                Ok(Message::Control(Control::StandIns(info))) => {
                    if let Some(loader) = &mut self.loader {
                        loader.announce_stand_ins(info);
                    }
                    continue;
                }
                Ok(Message::BlobChunk(chunk)) => {
                    let Some(loader) = &mut self.loader else { continue };
                    match loader.take(&chunk) {
                        Ok(Some(blobs)) => {
                            self.loader = None;
                            self.build(blobs);
                            Incoming::ScenePreparing
                        }
                        Ok(None) => {
                            let (bytes, total) = loader.progress();
                            Incoming::SceneFetched { bytes, total }
                        }
                        Err(error) => {
                            self.loader = None;
                            Incoming::Scene(Err(error))
                        }
                    }
                }
                Ok(message) => Incoming::Message(message),
                Err(error) => Incoming::Lost(error),
            };
            let over = matches!(incoming, Incoming::Lost(_));
            if self.messages.send(incoming).is_err() || over {
                return;
            }
        }
    }

    /// Prepares the scene on another thread.
    fn build(&self, blobs: Blobs) {
        let messages = self.messages.clone();
        tokio::task::spawn_blocking(move || {
            // A session that is over needs no scene.
            let _ = messages.send(Incoming::Scene(blobs.build().map(Box::new)));
        });
    }
}
