//! Mail from a peer that the coordinator has not handled yet, limited for each peer.
//!
//! Invariants:
//! - A mailbox holds at most [`MAX_MESSAGES`] messages of [`MAX_BYTES`] together, in addition to
//!   one that is longer and one view. A reader that fills it waits, and then the peer waits.
//! - The coordinator is informed once that there is mail, and takes one message at a time. So peers
//!   take turns, however much one of them sends.
//! - A display's newer view replaces one that was not handled. Messages after the older view then
//!   apply to the newer one.
//! - A display's messages are dropped when the display goes. A worker's messages are handled,
//!   because they contain finished work.

use std::collections::VecDeque;

use holo_net::Message;
use holo_proto::hello::Role;
use parking_lot::{Mutex, MutexGuard};
use tokio::sync::Notify;

/// Most messages that wait.
const MAX_MESSAGES: usize = 64;

/// Most bytes that wait. A peer's next message waits for as long as the coordinator takes to handle
/// them.
const MAX_BYTES: usize = 4 << 20;

/// Something that a peer did.
#[derive(Debug)]
pub enum Mail {
    /// It sent a message.
    Message(Message),
    /// It is gone; with a reason unless it closed its connection.
    Left(Option<String>),
    /// It broke the protocol, or may no longer be here.
    Broke(String),
}

/// One peer's mail.
#[derive(Debug)]
pub struct Mailbox {
    role: Role,
    state: Mutex<MailboxState>,
    /// Wakes the one who waits for room.
    room: Notify,
}

#[derive(Debug, Default)]
struct MailboxState {
    mail: VecDeque<Mail>,
    bytes: usize,
    /// True if the coordinator knows that there is mail.
    is_announced: bool,
    is_closed: bool,
}

/// The result of adding mail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Put {
    /// It waits, and the coordinator must be informed.
    Announce,
    /// It waits, and the coordinator knows.
    Waits,
    /// The mailbox is closed.
    Closed,
}

impl Mailbox {
    /// Returns an empty mailbox for a peer of this role.
    pub fn new(role: Role) -> Mailbox {
        Mailbox { role, state: Mutex::default(), room: Notify::new() }
    }

    /// Adds a message. Waits while there is no room.
    pub async fn put(&self, mut message: Message) -> Put {
        let bytes = bytes(&message);
        loop {
            {
                let mut state = self.lock();
                if state.is_closed {
                    return Put::Closed;
                }
                if state.replace_older_views(&mut message) {
                    return state.announce();
                }
                let fits = state.mail.len() < MAX_MESSAGES
                    && state.bytes.saturating_add(bytes) <= MAX_BYTES;
                if fits || state.mail.is_empty() {
                    state.bytes += bytes;
                    state.mail.push_back(Mail::Message(message));
                    return state.announce();
                }
            }
            // A single task puts, so no wake-up is missed.
            self.room.notified().await;
        }
    }

    /// Adds the end of the connection. A display's other mail is dropped.
    pub fn end(&self, end: Mail) -> Put {
        let mut state = self.lock();
        if state.is_closed {
            return Put::Closed;
        }
        if self.role == Role::Display {
            state.mail.clear();
            state.bytes = 0;
        }
        state.mail.push_back(end);
        state.announce()
    }

    /// Takes the oldest mail. Also returns whether there is more: the coordinator must then come
    /// back.
    pub fn take(&self) -> (Option<Mail>, bool) {
        let mut state = self.lock();
        let mail = state.mail.pop_front();
        if let Some(Mail::Message(message)) = &mail {
            state.bytes -= bytes(message);
        }
        state.is_announced = !state.mail.is_empty();
        self.room.notify_one();
        (mail, state.is_announced)
    }

    /// Drops everything, now and later: the coordinator has ended the connection.
    pub fn close(&self) {
        let mut state = self.lock();
        (state.is_closed, state.bytes) = (true, 0);
        state.mail.clear();
        self.room.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, MailboxState> {
        // Each change is whole before anything can panic.
        self.state.lock()
    }
}

impl MailboxState {
    /// Puts a newer view in the place of older ones. Returns whether there were any.
    fn replace_older_views(&mut self, message: &mut Message) -> bool {
        let Message::View(newer) = &*message else { return false };
        let number = newer.view;
        let is_older = |mail: &Mail| matches!(mail, Mail::Message(Message::View(older)) if older.view != number);
        let (mut is_placed, mut dropped, added) = (false, 0, bytes(message));
        self.mail.retain_mut(|mail| {
            if !is_older(mail) {
                return true;
            }
            dropped += mail_bytes(mail);
            if let Mail::Message(older) = mail
                && !is_placed
            {
                std::mem::swap(older, message);
                is_placed = true;
                return true;
            }
            false
        });
        if is_placed {
            self.bytes = self.bytes + added - dropped;
        }
        is_placed
    }

    fn announce(&mut self) -> Put {
        match std::mem::replace(&mut self.is_announced, true) {
            true => Put::Waits,
            false => Put::Announce,
        }
    }
}

/// Returns about as many bytes as mail takes in memory.
fn mail_bytes(mail: &Mail) -> usize {
    if let Mail::Message(message) = mail { bytes(message) } else { 0 }
}

/// Returns about as many bytes as a message takes in memory.
fn bytes(message: &Message) -> usize {
    size_of::<Message>()
        + match message {
            Message::View(view) => size_of_val(&*view.beams),
            Message::Rays(rays) => size_of_val(&*rays.rays),
            Message::LiveWanted(live) => size_of_val(&*live.rays),
            Message::Results(results) => {
                size_of_val(&*results.packets)
                    + size_of_val(&*results.samples)
                    + size_of_val(&*results.unseen)
            }
            Message::LiveResults(live) => size_of_val(&*live.packets) + size_of_val(&*live.hits),
            Message::Cells(cells) => size_of_val(&*cells.cells),
            // Control messages: few are longer than a line.
            _ => 0,
        }
}

#[cfg(test)]
mod tests {
    use holo_proto::{
        bulk::{CellBatch, RaysWanted, RequestedBeam, ViewRequest},
        control::Control,
    };
    use holo_section::{BeamId, BeamKey, Viewpoint};
    use tokio::time::{Duration, timeout};

    use super::*;

    fn view(view: u32, beams: usize) -> Message {
        let key = BeamKey { section: 0, beam: BeamId(0) };
        let viewpoint = Viewpoint { eye: [0.0; 3], radius: f64::from(view) };
        let beams = vec![RequestedBeam { key, weight: 1.0, held: 0, has_earlier: false }; beams];
        Message::View(ViewRequest { view, viewpoint, beams })
    }

    fn ping(number: u64) -> Message {
        Message::Control(Control::Ping(number))
    }

    fn settle(view: u32) -> Message {
        Message::Control(Control::Settle { view })
    }

    /// Takes all messages.
    fn messages(mailbox: &Mailbox) -> Vec<Message> {
        let mut all = Vec::new();
        loop {
            match mailbox.take() {
                (Some(Mail::Message(message)), _) => all.push(message),
                (None, is_more) => {
                    assert!(!is_more);
                    return all;
                }
                (other, _) => panic!("{other:?}"),
            }
        }
    }

    /// Puts a message that must not wait.
    async fn put(mailbox: &Mailbox, message: Message) -> Put {
        timeout(Duration::ZERO, mailbox.put(message)).await.expect("there is room")
    }

    #[tokio::test]
    async fn of_a_hundred_thousand_views_the_latest_is_kept_and_the_rest_stays_in_order() {
        let mailbox = Mailbox::new(Role::Display);
        assert_eq!(put(&mailbox, ping(1)).await, Put::Announce, "told once");
        for number in 0..100_000 {
            assert_eq!(put(&mailbox, view(number, 100)).await, Put::Waits);
        }
        put(&mailbox, settle(99_999)).await;
        put(&mailbox, view(100_000, 3)).await;
        let rays = Message::Rays(RaysWanted { view: 100_000, rays: Vec::new() });
        put(&mailbox, rays.clone()).await;
        let kept = messages(&mailbox);
        assert_eq!(kept, [ping(1), view(100_000, 3), settle(99_999), rays]);
        assert_eq!(put(&mailbox, ping(2)).await, Put::Announce, "told again");
    }

    #[tokio::test]
    async fn a_view_requested_again_moves_the_viewpoint_and_keeps_its_beams() {
        let mailbox = Mailbox::new(Role::Display);
        let mut again = view(7, 0);
        if let Message::View(request) = &mut again {
            request.viewpoint.radius = 0.5;
        }
        put(&mailbox, view(7, 10)).await;
        put(&mailbox, again.clone()).await;
        assert_eq!(messages(&mailbox), [view(7, 10), again.clone()]);
        put(&mailbox, view(7, 10)).await;
        put(&mailbox, again).await;
        put(&mailbox, view(8, 2)).await;
        assert_eq!(messages(&mailbox), [view(8, 2)]);
    }

    #[tokio::test]
    async fn who_sends_too_much_waits_and_goes_on_when_there_is_room() {
        let mailbox = Mailbox::new(Role::Worker);
        for number in 0..MAX_MESSAGES as u64 {
            put(&mailbox, ping(number)).await;
        }
        let more = mailbox.put(ping(99));
        tokio::pin!(more);
        assert!(timeout(Duration::ZERO, &mut more).await.is_err(), "too many");
        mailbox.take();
        assert_eq!(more.await, Put::Waits);
        assert_eq!(messages(&mailbox).len(), MAX_MESSAGES);
        // By bytes: a single message may be as long as it likes, and nothing comes after it.
        put(&mailbox, view(1, 1 << 20)).await;
        let more = mailbox.put(ping(1));
        tokio::pin!(more);
        assert!(timeout(Duration::ZERO, &mut more).await.is_err(), "too long");
        mailbox.take();
        assert_eq!(more.await, Put::Announce);
    }

    #[tokio::test]
    async fn a_dead_displays_mail_is_dropped_and_a_dead_workers_is_not() {
        for (role, kept) in [(Role::Display, 0), (Role::Worker, 5)] {
            let mailbox = Mailbox::new(role);
            for _ in 0..5 {
                put(&mailbox, Message::Cells(CellBatch { cells: Vec::new() })).await;
            }
            assert_eq!(mailbox.end(Mail::Left(None)), Put::Waits);
            for _ in 0..kept {
                assert!(matches!(mailbox.take(), (Some(Mail::Message(_)), true)));
            }
            assert!(matches!(mailbox.take(), (Some(Mail::Left(None)), false)));
        }
    }

    #[tokio::test]
    async fn nothing_waits_for_a_coordinator_that_has_ended_the_connection() {
        let mailbox = Mailbox::new(Role::Display);
        put(&mailbox, view(1, 1 << 20)).await;
        let more = mailbox.put(ping(1));
        tokio::pin!(more);
        assert!(timeout(Duration::ZERO, &mut more).await.is_err());
        mailbox.close();
        assert_eq!((more.await, mailbox.end(Mail::Left(None))), (Put::Closed, Put::Closed));
        assert!(matches!(mailbox.take(), (None, false)));
    }
}
