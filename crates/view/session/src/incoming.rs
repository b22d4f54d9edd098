//! Reads the server's messages on a task of its own, whatever the session is doing.
//!
//! Pings are answered here. Pieces of the scene are collected here. Everything else waits for
//! the session, in bounded memory. If that is full, the server waits.

use std::sync::{Arc, mpsc};

use anyhow::Result;
use holo_display::{UsefulBeam, WantedBeam};
use holo_net::{Inbox, Message, NetError, Outbox};
use holo_proto::control::Control;
use holo_raycast::StoredScenes;

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
    /// Where a scene is stored once it is prepared.
    pub stored: StoredScenes,
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
                    let Some(loader) = &mut self.loader else { continue };
                    match loader.announce_stand_ins(info) {
                        Ok(Some(blobs)) => {
                            self.loader = None;
                            self.build(blobs);
                            Incoming::ScenePreparing
                        }
                        Ok(None) => continue,
                        Err(error) => {
                            self.loader = None;
                            Incoming::Scene(Err(error))
                        }
                    }
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
        let (messages, stored) = (self.messages.clone(), self.stored.clone());
        tokio::task::spawn_blocking(move || {
            // If the session is over, the scene has no use.
            let _ = messages.send(Incoming::Scene(blobs.build(&stored).map(Box::new)));
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

    use glam::DVec3;
    use holo_proto::{
        bulk::Unseen,
        control::{SceneInfo, Welcome},
        frame::FrameKind,
        hello::Role,
    };
    use holo_scene::{Material, Scene};
    use holo_section::{BeamId, BeamKey};
    use tokio::net::TcpListener;

    use super::*;

    /// Connects a display to a server. Returns the display's end and the server's end.
    async fn connected() -> ((Inbox, Outbox, Welcome), (Inbox, Outbox)) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (reached, server) =
            tokio::join!(holo_net::connect(address, Role::Display, "a test"), async {
                let (inbox, outbox, ..) =
                    holo_net::accept(listener.accept().await.unwrap().0).await?;
                let welcome = include_str!("../../../../proto/golden/control-welcome.hex");
                let digits = welcome.lines().filter(|line| !line.starts_with('#'));
                let digits = digits.flat_map(str::split_whitespace);
                let bytes: Vec<_> =
                    digits.map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
                match Control::decode(&bytes[8..]) {
                    Ok(Control::Welcome(welcome)) => holo_net::welcome(&outbox, *welcome)?,
                    other => panic!("{other:?}"),
                }
                Ok::<_, NetError>((inbox, outbox))
            });
        (reached.unwrap(), server.unwrap())
    }

    /// A wavy surface of so many triangles that it is stored.
    fn large_scene() -> Scene {
        const SIDE: u32 = 230;
        let corner = |i: u32| {
            let (x, y) = (f64::from(i % SIDE), f64::from(i / SIDE));
            DVec3::new(x, y, (0.3 * x).sin() + (0.2 * y).cos())
        };
        let corners: Vec<DVec3> = (0..SIDE * SIDE).map(corner).collect();
        let faces = (0..SIDE * (SIDE - 1)).filter(|i| i % SIDE < SIDE - 1);
        let faces = faces.flat_map(|i| [[i, i + 1, i + SIDE], [i + 1, i + SIDE + 1, i + SIDE]]);
        let faces: Vec<[u32; 3]> = faces.collect();
        let ids = vec![0; faces.len()];
        let grey = vec![Material::grey("grey")];
        Scene::from_world(&corners, &faces, &ids, grey, [1.0; 3]).unwrap().0
    }

    #[tokio::test]
    async fn a_scene_that_this_machine_has_prepared_is_not_fetched() {
        let folder = tempfile::tempdir().unwrap();
        let stored = StoredScenes::new(Some(folder.path().to_owned()));
        let scene = large_scene();
        let packed = scene.pack();
        let info = SceneInfo { hash: Scene::content_hash(&packed), bytes: packed.len() as u64 };
        stored.prepare(Arc::new(scene), Some(info.hash)).unwrap();

        let ((inbox, outbox, _), (mut asked, server)) = connected().await;
        let loader = SceneLoader::ask(info, &outbox, stored.clone()).unwrap();
        let (messages, session) = mpsc::channel();
        let room = Arc::new(Semaphore::new(MAX_WAITING_BYTES));
        let reader = SessionReader { inbox, outbox, messages, loader, stored, room };
        tokio::spawn(reader.run());
        let request = asked.next().await.unwrap();
        assert!(matches!(request, Message::Control(Control::StandInsWanted)), "{request:?}");
        let none = SceneInfo { hash: [0; 32], bytes: 0 };
        server.control(&Control::StandIns(none)).unwrap();
        let loaded = tokio::task::spawn_blocking(move || {
            assert!(matches!(session.recv(), Ok(Incoming::ScenePreparing)));
            let Ok(Incoming::Scene(loaded)) = session.recv() else { panic!("no scene") };
            loaded.unwrap()
        });
        let loaded = loaded.await.unwrap();
        assert!(loaded.raycaster.scene().pack() == packed && loaded.stand_ins.is_empty());
    }

    #[tokio::test]
    async fn messages_that_a_session_does_not_read_wait_at_the_server_and_none_is_lost() {
        let ((inbox, outbox, _), (_asked, server)) = connected().await;
        let (messages, session) = mpsc::channel();
        let beams = vec![BeamKey { section: 0, beam: BeamId(1) }; 10_000];
        let message = |view| Unseen { view, beams: beams.clone() };
        let bytes = bytes_of(&Message::Unseen(message(0))) as usize;
        // There is room for three messages. More wait in the inbox and in the system's buffers.
        let room = Arc::new(Semaphore::new(3 * bytes));
        let stored = StoredScenes::new(None);
        let reader = SessionReader { inbox, outbox, messages, loader: None, stored, room };
        tokio::spawn(reader.run());
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
