//! Reads the server's messages on a task of its own, whatever the session is doing.
//!
//! Pings are answered here. Pieces of the scene are collected here. Everything else waits for
//! the session, in bounded memory. If that is full, the server waits.

use std::sync::{Arc, mpsc};

use anyhow::Result;
use holo_display::{UsefulBeam, WantedBeam};
use holo_net::{Inbox, Message, NetError, Outbox};
use holo_proto::control::Control;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::{
    driver_choice::LoadedScene,
    objects::LoadedObject,
    scene::{Blobs, SceneLoader},
};

/// Most bytes of messages that wait for the session.
pub const MAX_WAITING_BYTES: usize = 64 << 20;

/// An event that a session waits for.
pub enum Incoming {
    /// A message for the session.
    Message {
        /// The message.
        message: Message,
        /// The memory that the message takes. It is released when this is dropped.
        _room: OwnedSemaphorePermit,
    },
    /// A piece of the scene arrived.
    SceneFetched {
        /// Bytes that have arrived.
        bytes: u64,
        /// Bytes of the whole scene.
        total: u64,
    },
    /// The whole scene arrived. It is being prepared, which takes seconds for millions of
    /// triangles.
    ScenePreparing,
    /// The scene is ready, or cannot be used.
    Scene(Result<Box<LoadedScene>>),
    /// A model that was to be carried into the scene was read.
    Object(Box<LoadedObject>),
    /// A search for useful beams has ended.
    Found {
        /// The first request of the view that the beams are for.
        first_request: u32,
        /// The beams, in the order of their keys.
        beams: Vec<UsefulBeam>,
    },
    /// The beams of a view were weighed by the error of what is shown.
    Weighed {
        /// The first request of the view.
        first_request: u32,
        /// The beams with their weights, in the order of their keys.
        beams: Vec<WantedBeam>,
    },
    /// The connection is lost.
    Lost(NetError),
    /// A front end needs attention.
    Wake,
    /// The user wants to quit.
    Stop,
}

/// Reads a connection for a session.
pub struct SessionReader {
    /// Source of messages.
    pub inbox: Inbox,
    /// Where answers to pings go.
    pub outbox: Outbox,
    /// The queue that the session reads.
    pub messages: mpsc::Sender<Incoming>,
    /// Collects the scene, if the session wants it.
    pub loader: Option<SceneLoader>,
    /// Room for messages that wait, bytes: [`MAX_WAITING_BYTES`].
    pub room: Arc<Semaphore>,
}

impl SessionReader {
    /// Reads until the connection or the session ends.
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
                Ok(message) => {
                    let room = Arc::clone(&self.room).acquire_many_owned(bytes_of(&message)).await;
                    // The semaphore is never closed.
                    let Ok(room) = room else { return };
                    Incoming::Message { message, _room: room }
                }
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
            // If the session is over, the scene has no use.
            let _ = messages.send(Incoming::Scene(blobs.build().map(Box::new)));
        });
    }
}

/// Returns the memory that a waiting message takes, bytes, about.
fn bytes_of(message: &Message) -> u32 {
    let bulk = match message {
        Message::Samples(samples) => {
            size_of_val(&samples.samples[..]) + size_of_val(&samples.runs[..])
        }
        Message::LiveSamples(samples) => size_of_val(&samples.samples[..]),
        Message::Unseen(unseen) => size_of_val(&unseen.beams[..]),
        _ => 0,
    };
    // A message that is larger than all room waits for all of it.
    (size_of::<Incoming>() + bulk).min(MAX_WAITING_BYTES) as u32
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use holo_proto::{bulk::Unseen, frame::FrameKind, hello::Role};
    use holo_section::{BeamId, BeamKey};
    use tokio::net::TcpListener;

    use super::*;

    #[tokio::test]
    async fn messages_that_a_session_does_not_read_wait_at_the_server_and_none_is_lost() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (reached, server) =
            tokio::join!(holo_net::connect(address, Role::Display, "a test"), async {
                let (_, outbox, ..) = holo_net::accept(listener.accept().await.unwrap().0).await?;
                let welcome = include_str!("../../../../proto/golden/control-welcome.hex");
                let digits = welcome.lines().filter(|line| !line.starts_with('#'));
                let digits = digits.flat_map(str::split_whitespace);
                let bytes: Vec<_> =
                    digits.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
                match Control::decode(&bytes[8..]) {
                    Ok(Control::Welcome(welcome)) => holo_net::welcome(&outbox, *welcome)?,
                    other => panic!("{other:?}"),
                }
                Ok::<_, NetError>(outbox)
            });
        let ((inbox, outbox, _), server) = (reached.unwrap(), server.unwrap());
        let (messages, session) = mpsc::channel();
        let beams = vec![BeamKey { section: 0, beam: BeamId(1) }; 10_000];
        let message = |view| Unseen { view, beams: beams.clone() };
        let bytes = bytes_of(&Message::Unseen(message(0))) as usize;
        // There is room for three messages. More wait in the inbox and in the system's buffers.
        let room = Arc::new(Semaphore::new(3 * bytes));
        tokio::spawn(SessionReader { inbox, outbox, messages, loader: None, room }.run());
        const SENT: u32 = 1000;
        for view in 0..SENT {
            server.send(FrameKind::Unseen, &message(view).encode()).unwrap();
        }
        let mut queued = usize::MAX;
        while server.queued_bytes() != queued {
            queued = server.queued_bytes();
            tokio::time::sleep(Duration::from_millis(300)).await;
        }
        assert!(queued > bytes * SENT as usize / 2, "{queued} bytes wait at the server");

        let taken = tokio::task::spawn_blocking(move || {
            for view in 0..SENT {
                match session.recv() {
                    Ok(Incoming::Message { message: Message::Unseen(unseen), .. }) => {
                        assert_eq!(unseen.view, view)
                    }
                    _ => panic!("another message"),
                }
            }
        });
        taken.await.unwrap();
    }
}
