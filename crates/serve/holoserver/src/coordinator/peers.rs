//! Workers and displays that come and go.

use std::sync::atomic::Ordering;

use holo_beamfile::Maker;
use holo_net::{Access, MachineId, Outbox, Rights};
use holo_proto::{
    control::{Control, Farewell},
    hello::{Hello, Role},
};
use tracing::info;

use super::{Coordinator, display::ConnectedDisplay};
use crate::{
    assignment::PacketPurpose, events::ConnectionId, worker_id::WorkerId, workers::ConnectedWorker,
};

impl Coordinator {
    /// Admits a peer.
    pub(super) fn join(&mut self, id: ConnectionId, hello: Hello, access: Access, outbox: Outbox) {
        let Hello { role, name, .. } = hello;
        let (token, rights) = (access.token.as_deref().unwrap_or_default(), access.rights);
        info!(peer = name, role = role_name(role), token, %rights, "joined");
        match role {
            Role::Worker => {
                self.progress.say(&format!("{name} joined"));
                let paths = self.holodeck.about.settings.paths_per_sample;
                let (maker, refusal) = self.number(&name, access.token, access.machine);
                let worker = WorkerId::new(maker, self.workers.values().map(|worker| worker.id));
                self.workers.insert(id, ConnectedWorker::new(outbox, name, worker, paths));
                if let Some(reason) = refusal.or_else(|| self.fault_of(maker)) {
                    self.expel(id, reason);
                }
            }
            Role::Display => {
                self.progress.say(&format!("{name} joined"));
                let is_read_only = access.rights == Rights::ReadOnly;
                self.displays.insert(id, ConnectedDisplay::new(outbox, name, is_read_only));
            }
            Role::Admin => _ = self.admins.insert(id, outbox),
        }
    }

    /// Returns the file's number for a worker's machine, or why it gets none.
    fn number(
        &self,
        name: &str,
        token: Option<String>,
        machine: Option<MachineId>,
    ) -> (Maker, Option<String>) {
        let key = machine.map(|machine| machine.to_string());
        let mut makers = self.holodeck.makers_mut();
        let refusal = makers.refusal(name, token.as_deref(), key.as_deref());
        if refusal.is_some() {
            return (Maker::UNKNOWN, refusal);
        }
        let maker = makers.of(name, token.clone(), key);
        // A machine may come back with another token. The last one is the one to revoke.
        makers.change(maker, |made| made.token = token);
        (maker, None)
    }

    /// Returns the connection of a worker that is there.
    pub(super) fn connection_of(&self, worker: WorkerId) -> Option<ConnectionId> {
        let mut workers = self.workers.iter();
        workers.find(|(_, known)| known.id == worker).map(|(&id, _)| id)
    }

    /// Returns the name of a worker for people. If it is not there, the name of its machine.
    pub(super) fn name_of(&self, worker: WorkerId) -> String {
        if let Some(known) = self.workers.values().find(|known| known.id == worker) {
            return known.name.clone();
        }
        let makers = self.holodeck.makers();
        makers
            .get(worker.maker)
            .map_or("a worker that has left".to_owned(), |made| made.name.clone())
    }

    /// Returns the sending half of a connection.
    pub(super) fn outbox(&self, id: ConnectionId) -> Option<&Outbox> {
        let worker = self.workers.get(&id).map(|worker| &worker.outbox);
        let display = self.displays.get(&id).map(|display| &display.outbox);
        worker.or(display).or_else(|| self.admins.get(&id))
    }

    /// Ends the connection of a peer that broke the rules, and sends it the reason.
    pub(super) fn expel(&mut self, id: ConnectionId, reason: String) {
        if let Some(outbox) = self.outbox(id) {
            // If the reason is longer than a control message, the connection ends without it.
            let farewell = Farewell::Dropped { reason: reason.clone() };
            let _ = outbox.control(&Control::Bye(farewell));
            // This also stops a thread that is sending it a scene.
            outbox.end();
        }
        self.leave(id, Some(reason));
    }

    /// Removes a peer that has gone. Other workers get its work.
    pub(super) fn leave(&mut self, id: ConnectionId, reason: Option<String>) {
        let reason = reason.unwrap_or_else(|| "it closed its connection".into());
        self.listeners.remove(&id);
        self.admins.remove(&id);
        if let Some(mailbox) = self.mailboxes.remove(&id) {
            mailbox.close();
        }
        if let Some(mut worker) = self.workers.remove(&id) {
            let peer = &worker.name;
            info!(peer, role = role_name(Role::Worker), reason, "left");
            self.progress.say(&format!("{} left: {reason}", worker.name));
            self.live_again(worker.take_live());
            let id = worker.id;
            self.lose(worker.into_assignments());
            self.claims.left(id);
            self.audits.left(id);
            self.checks.retain(|_, assignment| match assignment.purpose {
                PacketPurpose::Again(audit) => audit.checker != id,
                _ => true,
            });
        }
        if let Some(display) = self.displays.remove(&id) {
            let peer = &display.name;
            info!(peer, role = role_name(Role::Display), reason, "left");
            self.progress.say(&format!("{} left: {reason}", display.name));
            display.newest.store(u32::MAX, Ordering::Release);
        }
        self.forget_stale();
        self.try_settle();
    }
}

/// Returns a role's name in the log.
fn role_name(role: Role) -> &'static str {
    match role {
        Role::Worker => "worker",
        Role::Display => "display",
        Role::Admin => "admin",
    }
}
