//! Workers and displays of a cluster. They connect again after they have lost the server.

use std::{sync::Arc, time::Duration};

use holo_net::{Inbox, MachineKey, Message, NetError, Outbox};
use holo_proto::{
    bulk::{Packet, RequestedBeam, Results, TracedPacket, ViewRequest},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::Viewpoint;
use tokio::time::sleep;

use super::{
    cluster::Cluster,
    random::SplitMix,
    truth::{self, Samples, beam, is_unseen},
    wire::Wire,
};

/// Time that peers wait before they connect again.
const PAUSE: Duration = Duration::from_millis(250);

/// A fault of a worker, which occurs after this many packets of each connection.
#[derive(Clone, Copy, Debug)]
pub enum WorkerFault {
    /// It disappears without a message.
    Dies(u64),
    /// It returns nothing for so long, and then goes on.
    Hangs(u64, Duration),
}

/// Returns the wire that a peer uses for its next connection.
pub type Wires = fn(&mut SplitMix) -> Wire;

/// A worker.
#[derive(Clone, Copy, Debug)]
pub struct WorkerPlan {
    pub wire: Wires,
    /// What a ray takes.
    pub ray: Duration,
    pub fault: Option<WorkerFault>,
}

/// Traces until the cluster is over.
pub async fn worker(cluster: Arc<Cluster>, number: usize, plan: WorkerPlan, mut random: SplitMix) {
    let name = format!("worker {number}");
    let machine = MachineKey::new().unwrap();
    while !cluster.is_over() {
        let role = Role::Worker;
        let joined = cluster.join(plan.wire, role, &name, Some(&machine), &mut random).await;
        if let Ok((inbox, outbox)) = joined {
            // Why it ended does not matter: the server goes on, or is over.
            let _ = trace(inbox, outbox, plan).await;
        }
        sleep(PAUSE).await;
    }
}

async fn trace(mut inbox: Inbox, outbox: Outbox, plan: WorkerPlan) -> Result<(), NetError> {
    outbox.control(&Control::Ready { threads: 1 })?;
    let mut done = 0;
    loop {
        let Message::Work(work) = inbox.next().await? else { continue };
        for packet in work.packets {
            match plan.fault {
                Some(WorkerFault::Dies(after)) if done >= after => return Ok(()),
                Some(WorkerFault::Hangs(after, time)) if done == after => sleep(time).await,
                _ => {}
            }
            sleep(plan.ray * u32::from(packet.count)).await;
            outbox.send(FrameKind::Results, &results(&packet).encode())?;
            done += 1;
        }
    }
}

fn results(packet: &Packet) -> Results {
    if is_unseen(packet.key) {
        return Results { unseen: vec![packet.id], ..Default::default() };
    }
    let traced = TracedPacket { id: packet.id, count: u32::from(packet.count), nanoseconds: 1000 };
    Results { packets: vec![traced], samples: truth::traced(packet), unseen: Vec::new() }
}

/// A display, and the beams of its views: each view has so many of its own.
#[derive(Clone, Copy, Debug)]
pub struct DisplayPlan {
    pub wire: Wires,
    pub views: u32,
    pub first_beam: u64,
    pub beams: u64,
    /// Samples that it waits for in each view before the view settles.
    pub samples: usize,
}

impl DisplayPlan {
    /// Returns the numbers of a view's beams.
    fn beams_of(&self, view: u32) -> std::ops::Range<u64> {
        let first = self.first_beam + u64::from(view - 1) * self.beams;
        first..first + self.beams
    }
}

/// Looks at all views until each has settled. Returns the samples that have come.
pub async fn display(
    cluster: Arc<Cluster>,
    number: usize,
    plan: DisplayPlan,
    mut random: SplitMix,
) -> Samples {
    let name = format!("display {number}");
    let (mut seen, mut view) = (Samples::new(), 1);
    while view <= plan.views && !cluster.is_over() {
        let joined = cluster.join(plan.wire, Role::Display, &name, None, &mut random).await;
        if let Ok((mut inbox, outbox)) = joined {
            while view <= plan.views
                && look(&mut inbox, &outbox, &plan, view, &mut seen).await.is_ok()
            {
                view += 1;
            }
        }
        sleep(PAUSE).await;
    }
    seen
}

/// Looks at one view until it has settled.
async fn look(
    inbox: &mut Inbox,
    outbox: &Outbox,
    plan: &DisplayPlan,
    view: u32,
    seen: &mut Samples,
) -> Result<(), NetError> {
    let wanted =
        |number| RequestedBeam { key: beam(number), weight: 1.0, held: 0, has_earlier: false };
    let viewpoint = Viewpoint { eye: [0.5; 3], radius: 0.1 };
    let beams = plan.beams_of(view).map(wanted).collect();
    outbox.send(FrameKind::View, &ViewRequest { view, viewpoint, beams }.encode())?;
    let (mut have, mut is_settling) = (0, false);
    loop {
        match inbox.next().await? {
            Message::Samples(message) => {
                // Samples sent for an earlier view belong to other beams, which have settled.
                assert_eq!(message.view, view);
                for (run, samples) in message.iter() {
                    assert!(plan.beams_of(view).contains(&run.key.beam.0), "{run:?}");
                    for (number, sample) in (run.first..).zip(samples) {
                        let known = seen.insert((run.key, run.kind as u8, number), *sample);
                        assert!(known.is_none_or(|known| known == *sample), "{run:?}");
                        have += 1;
                    }
                }
            }
            Message::Control(Control::Settled { view: settled }) if settled == view => {
                return Ok(());
            }
            _ => {}
        }
        if have >= plan.samples && !std::mem::replace(&mut is_settling, have >= plan.samples) {
            outbox.control(&Control::Settle { view })?;
        }
    }
}
