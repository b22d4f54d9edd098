//! A server, and wires to it.

use std::{
    future::pending,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use holo_net::{Inbox, MachineKey, NetError, Outbox, accept_over, connect_over};
use holo_proto::{control::Farewell, hello::Role};
use parking_lot::Mutex;
use tokio::{
    io::DuplexStream,
    sync::mpsc::{UnboundedSender, unbounded_channel},
    task::JoinHandle,
    time::{sleep, timeout},
};

use super::{peers::Wires, random::SplitMix};
use crate::{
    coordinator::{Coordinator, FillOptions},
    events::ServerEvent,
    holodeck::Holodeck,
    listen::{ListenContext, serve},
    progress::{SampleProgress, Totals},
    schedule::Goal,
};

/// A test that waits for so long has failed.
pub const FOR_EVER: Duration = Duration::from_secs(3600);

/// A server that peers reach by wires, and that may be away.
#[derive(Default)]
pub struct Cluster {
    server: Mutex<Option<ListenContext>>,
    is_over: AtomicBool,
}

/// A server's life.
pub struct ServerLife {
    holodeck: Arc<Holodeck>,
    events: UnboundedSender<ServerEvent>,
    deciding: JoinHandle<anyhow::Result<Totals>>,
}

impl Cluster {
    /// Starts a server for a file.
    pub fn start(&self, file: &Path, fill: Option<FillOptions>, goal: Goal) -> ServerLife {
        let holodeck = Arc::new(Holodeck::open(file, 1 << 20).unwrap());
        assert_eq!(holodeck.warnings, Vec::<String>::new());
        let (events, receiver) = unbounded_channel();
        let progress = SampleProgress::new(&holodeck.file.stats(), true);
        let coordinator =
            Coordinator::new(Arc::clone(&holodeck), events.clone(), fill, goal, progress);
        let deciding = tokio::spawn(coordinator.run(receiver, std::future::ready(())));
        self.serve_by(Some(ListenContext::new(Arc::clone(&holodeck), events.clone())));
        ServerLife { holodeck, events, deciding }
    }

    /// Waits for the end of a server: by its goal, or by a shutdown if `ask`.
    pub async fn end(&self, life: ServerLife, ask: bool) -> Totals {
        let ServerLife { holodeck, events, deciding } = life;
        if ask {
            events.send(ServerEvent::Shutdown(Farewell::SessionOver)).unwrap();
        }
        let totals = timeout(FOR_EVER, deciding).await.expect("it ends").unwrap().unwrap();
        self.serve_by(None);
        // Connections end with it. Its file is then closed, so that the next one may open it.
        while Arc::strong_count(&holodeck) > 1 {
            sleep(Duration::from_millis(10)).await;
        }
        totals
    }

    fn serve_by(&self, server: Option<ListenContext>) {
        *self.server.lock() = server;
    }

    /// Records that no other server will follow.
    pub fn finish(&self) {
        self.is_over.store(true, Ordering::Relaxed);
    }

    /// Returns whether no other server comes.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// Joins by a new wire.
    pub async fn join(
        &self,
        wires: Wires,
        role: Role,
        name: &str,
        machine: Option<&MachineKey>,
        random: &mut SplitMix,
    ) -> Result<(Inbox, Outbox), NetError> {
        let (near, far) = wires(random).lay(random);
        self.take(far);
        let (inbox, outbox, _) = connect_over(near, role, name, machine).await?;
        Ok((inbox, outbox))
    }

    /// Serves whoever is at the end of a wire, if the server is there.
    fn take(&self, wire: DuplexStream) {
        let server = self.server.lock().clone();
        let Some(shared) = server else { return };
        tokio::spawn(async move {
            if let Ok((inbox, outbox, hello, access)) = accept_over(wire).await {
                serve(inbox, outbox, hello, access, pending(), &shared).await;
            }
        });
    }
}
