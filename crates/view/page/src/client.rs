//! One client: a page's connection, from its first message to its last.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use axum::{
    body::Bytes,
    extract::{
        ConnectInfo, State, WebSocketUpgrade,
        ws::{Message, WebSocket},
    },
    response::Response,
};
use futures_util::{
    SinkExt, StreamExt,
    stream::{SplitSink, SplitStream},
};
use holo_picture::{Image, Look};
use holo_stage::{Input, PublishedFrame, StagePhase};
use tokio::{
    sync::{mpsc, watch},
    time::{interval, sleep_until, timeout},
};

use super::{
    connections::Visitor,
    eyes::Eyes,
    from_page::{self, PageRequest},
    hub::{ClientFrame, Guest, Hub},
    screen::{ClientScreen, Update},
    to_page::{self, Framed, StageTimes},
};

/// Longest message that a page may send, bytes. Messages are lines of a few numbers.
const MOST_BYTES: usize = 16 << 10;

/// Number of malformed messages after which the connection is closed.
const MOST_GARBAGE: u32 = 8;

/// Longest time to send a message. A client that receives nothing for so long has gone.
const SENDING: Duration = Duration::from_secs(20);

/// Interval between pings. Browsers answer them.
const PING_EVERY: Duration = Duration::from_secs(2);

/// Time without a newer frame after which a picture at rest is sent exactly.
const CALM: Duration = Duration::from_millis(250);

/// Time that eyes adapt to a frame at rest. It is enough to adapt from a thousandth of the light to
/// less than one step of a display's colours.
const ADAPTING: Duration = Duration::from_secs(4);

/// Interval between updates of the screen while eyes adapt.
const ADAPTS_EVERY: Duration = Duration::from_millis(80);

/// Eyes have adapted if the exposure changes by less than this fraction between two looks.
const SETTLED: f32 = 1e-3;

/// Most answers that wait for a client. Further answers are dropped.
const MOST_ANSWERS: usize = 32;

/// Takes a page's connection.
pub async fn connect(
    upgrade: WebSocketUpgrade,
    ConnectInfo(visitor): ConnectInfo<Visitor>,
    State(hub): State<Arc<Hub>>,
) -> Response {
    let upgrade = upgrade.max_message_size(MOST_BYTES).max_frame_size(MOST_BYTES);
    upgrade.on_upgrade(move |socket| async move {
        visitor.begins_session();
        let (sink, stream) = socket.split();
        let Some(guest) = hub.enter() else {
            let mut sink = sink;
            // If the client has gone, the message has no effect.
            let _ = sink.send(text(to_page::error("too many people look already"))).await;
            return;
        };
        let wanted = watch::Sender::new(ClientWishes::default());
        let (answers, waiting) = mpsc::channel(MOST_ANSWERS);
        let reader = ClientReader { hub: &hub, guest: &guest, stream, wanted: &wanted, answers };
        let writer = ClientWriter::new(&hub, &guest, sink, wanted.subscribe());
        tokio::select! {
            () = reader.run() => {}
            // An error also ends the connection.
            _ = writer.run(waiting) => {}
            () = guest.gives_way() => {}
        }
    })
}

/// The client's wishes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ClientWishes {
    /// The last update that is on its screen.
    shown: u64,
    look: Look,
    cursor: Option<(f64, f64)>,
    /// True if the page is hidden. It then receives no frames, and nothing is drawn for it.
    is_hidden: bool,
}

/// Reads a client's messages.
struct ClientReader<'a> {
    hub: &'a Hub,
    guest: &'a Guest,
    stream: SplitStream<WebSocket>,
    wanted: &'a watch::Sender<ClientWishes>,
    answers: mpsc::Sender<String>,
}

impl ClientReader<'_> {
    /// Reads until the client leaves or sends garbage.
    async fn run(mut self) {
        let mut garbage = 0;
        while let Some(Ok(message)) = self.stream.next().await {
            self.guest.is_heard();
            let parsed = match message {
                Message::Text(text) => from_page::parse(&text),
                Message::Binary(_) => Err("messages are texts".to_owned()),
                Message::Close(_) => return,
                Message::Ping(_) | Message::Pong(_) => continue,
            };
            let answer = match parsed {
                Ok((number, asked)) => self.take(number, asked),
                Err(reason) => {
                    garbage += 1;
                    Some(to_page::error(&reason))
                }
            };
            if let Some(answer) = answer {
                // If the client reads no answers, they are dropped.
                let _ = self.answers.try_send(answer);
            }
            if garbage == MOST_GARBAGE {
                return;
            }
        }
    }

    /// Does what a client asks for, and returns the answer to send, if any.
    fn take(&self, number: u64, asked: PageRequest) -> Option<String> {
        let mut answer = None;
        match asked {
            PageRequest::Shown(update) => self.wanted.send_modify(|wanted| wanted.shown = update),
            PageRequest::Look(look) => self.wanted.send_modify(|wanted| wanted.look = look),
            PageRequest::Hidden(is_hidden) => {
                self.wanted.send_modify(|wanted| wanted.is_hidden = is_hidden);
            }
            PageRequest::TakeOver => self.hub.take_over(self.guest.number),
            PageRequest::Drop(drop, name, at) => {
                let client = self.guest.number;
                let path = self.hub.dropped.path(client, drop, &name);
                let path = path.filter(|path| path.is_file());
                let sent = path.map(|path| self.hub.drive(client, number, Input::Drop(path, at)));
                if sent != Some(true) {
                    answer = Some(to_page::error(&format!("{name} did not arrive")));
                }
            }
            PageRequest::Input(input) => {
                if let Input::Cursor(cursor) = input {
                    self.wanted.send_if_modified(|wanted| {
                        wanted.cursor = cursor;
                        // The cursor alone is no reason to send a frame.
                        false
                    });
                    let shown = self.hub.latest();
                    let under = shown.zip(cursor);
                    answer = under.and_then(|(shown, at)| to_page::under_cursor(&shown, at));
                }
                if !self.hub.drive(self.guest.number, number, input) {
                    answer = Some(to_page::error("too many inputs at once: some were lost"));
                }
            }
        }
        answer
    }
}

/// Sends updates and answers to a client.
struct ClientWriter<'a> {
    hub: &'a Arc<Hub>,
    guest: &'a Guest,
    sink: SplitSink<WebSocket, Message>,
    wanted: watch::Receiver<ClientWishes>,
    screen: ClientScreen,
    eyes: Arc<Eyes>,
    /// When the eyes will have adapted to the frame on the screen, and when they next look.
    adapts: Option<(Instant, Instant)>,
    on_screen: Option<OnScreen>,
    under_way: Option<UnderWay>,
    /// Number of the last update.
    updates: u64,
    /// Durations of the last frame's stages, except encoding.
    times: StageTimes,
}

/// A frame that the client's screen shows or will soon show.
#[derive(Clone)]
struct OnScreen {
    shown: Arc<PublishedFrame>,
    /// Number of times that the frame was shown again since it arrived.
    times: u32,
    look: Look,
    image: Arc<Image>,
}

/// An update on its way.
struct UnderWay {
    update: u64,
    bytes: usize,
    since: Instant,
}

impl<'a> ClientWriter<'a> {
    fn new(
        hub: &'a Arc<Hub>,
        guest: &'a Guest,
        sink: SplitSink<WebSocket, Message>,
        wanted: watch::Receiver<ClientWishes>,
    ) -> ClientWriter<'a> {
        let (screen, eyes) = (ClientScreen::default(), hub.eyes.of(Look::default()));
        let (on_screen, under_way, updates) = (None, None, 0);
        let times = StageTimes::default();
        let adapts = None;
        ClientWriter {
            hub,
            guest,
            sink,
            wanted,
            screen,
            eyes,
            adapts,
            on_screen,
            under_way,
            updates,
            times,
        }
    }

    /// Sends until the session ends or the client receives nothing any more.
    async fn run(mut self, mut answers: mpsc::Receiver<String>) -> Result<()> {
        // Without a receiver of frames, the stage draws none at rest.
        let mut frames = Some(self.hub.front.frames.subscribe());
        let mut states = self.hub.front.state.subscribe();
        let mut roles = self.hub.roles();
        states.mark_changed();
        roles.mark_changed();
        let Guest { number, key, .. } = self.guest;
        let hub = self.hub;
        self.send(text(to_page::hello(*number, key, &hub.session, &hub.screens))).await?;
        let mut rounds = hub.rounds.ended();
        let mut has_facts = false;
        let mut sent_at = Instant::now();
        let mut pings = interval(PING_EVERY);
        loop {
            let is_free = self.under_way.is_none();
            let is_hidden = self.wanted.borrow().is_hidden;
            if is_hidden {
                frames = None;
                hub.rounds.leave(self.guest.number);
            } else if frames.is_none() {
                frames = Some(self.hub.front.frames.subscribe());
            }
            let latest = frames.as_mut().and_then(|frames| frames.borrow_and_update().clone());
            rounds.mark_unchanged();
            let latest = latest.map(|latest| hub.frame_for(self.guest.number, latest));
            if is_free && self.update(latest).await? {
                sent_at = Instant::now();
                continue;
            }
            let adapts = self.adapts.map_or_else(Instant::now, |(_, next)| next);
            let calm = is_free && !is_hidden && !self.screen.is_exact() && self.is_at_rest();
            tokio::select! {
                changed = next_frame(&mut frames), if is_free && !is_hidden => changed?,
                changed = rounds.changed(), if is_free && !is_hidden => changed?,
                changed = self.wanted.changed() => {
                    changed?;
                    self.note_shown();
                }
                changed = states.changed() => {
                    changed?;
                    let state = states.borrow_and_update().clone();
                    if !has_facts && state.phase == StagePhase::Running {
                        has_facts = true;
                        self.send(text(to_page::facts(&state))).await?;
                    }
                    self.send(text(to_page::state(&state))).await?;
                    if matches!(state.phase, StagePhase::Ended(_)) {
                        return self.send(Message::Close(None)).await;
                    }
                }
                changed = roles.changed() => {
                    changed?;
                    let (drives, clients) = {
                        let roles = roles.borrow_and_update();
                        (roles.driver == Some(self.guest.number), roles.clients.len())
                    };
                    self.send(text(to_page::roles(drives, clients))).await?;
                }
                Some(answer) = answers.recv() => self.send(text(answer)).await?,
                _ = pings.tick() => {
                    ensure!(self.guest.silence() < SENDING, "it has gone");
                    self.send(Message::Ping(Bytes::new())).await?;
                }
                () = sleep_until(adapts.into()), if is_free && !is_hidden && self.adapts.is_some() => {}
                () = sleep_until((sent_at + CALM).into()), if calm => {
                    self.improve().await?;
                    sent_at = Instant::now() - CALM;
                }
            }
        }
    }

    /// Records that the client's screen shows the update under way, if the client has said so.
    fn note_shown(&mut self) {
        let shown = self.wanted.borrow_and_update().shown;
        if let Some(under_way) = self.under_way.take_if(|under_way| shown >= under_way.update) {
            self.screen.note(under_way.bytes, under_way.since.elapsed().as_secs_f64());
            if let Some(on_screen) = &self.on_screen {
                self.hub.rounds.shown(self.guest.number, on_screen.shown.number);
            }
        }
    }

    fn is_at_rest(&self) -> bool {
        self.on_screen.as_ref().is_some_and(|now| now.shown.is_at_rest)
    }

    /// Sends the latest frame unless the client's screen already shows it. Returns whether it was
    /// sent.
    async fn update(&mut self, latest: Option<Arc<PublishedFrame>>) -> Result<bool> {
        let Some(shown) = latest else { return Ok(false) };
        let look = self.wanted.borrow().look;
        let now = Instant::now();
        let shows = |on: &&OnScreen| on.shown.number == shown.number && on.look == look;
        let again = self.on_screen.as_ref().filter(shows).map(|on| on.times + 1);
        let is_due = self.adapts.is_some_and(|(_, next)| now >= next);
        if again.is_some() && !is_due {
            return Ok(false);
        }
        if self.eyes.look() != look {
            self.eyes = self.hub.eyes.of(look);
        }
        let times = again.unwrap_or(0);
        let image = self.eyes.see(&shown, times).await?;
        let [look_took, draw_took] = shown.took.map(|seconds| 1e3 * seconds);
        self.times = StageTimes {
            look: look_took,
            draw: draw_took,
            wait: milliseconds(shown.done, now),
            tone: milliseconds(now, Instant::now()),
            encode: 0.0,
        };
        let until = match self.adapts.filter(|_| again.is_some()) {
            Some((until, _)) => until,
            None => now + ADAPTING,
        };
        self.adapts = (shown.is_at_rest && now < until).then_some((until, now + ADAPTS_EVERY));
        self.guest.sees(ClientFrame { frame: shown.number, image: Arc::clone(&image), look });
        let update = self.screen.show(Arc::clone(&image));
        let before = self.on_screen.as_ref().and_then(|on| on.image.exposure);
        let settled = |before: f32, now: f32| (now / before - 1.0).abs() < SETTLED;
        let has_adapted = before.zip(image.exposure).is_none_or(|(a, b)| settled(a, b));
        self.on_screen = Some(OnScreen { shown, times, look, image });
        if again.is_some() && update.rects.is_empty() {
            self.adapts.take_if(|_| has_adapted);
            return Ok(false);
        }
        self.send_update(update).await?;
        Ok(true)
    }

    /// Sends the next tiles that are not exact.
    async fn improve(&mut self) -> Result<()> {
        let update = self.screen.improve();
        self.send_update(update).await
    }

    async fn send_update(&mut self, update: Update) -> Result<()> {
        let Some(OnScreen { shown, image, .. }) = self.on_screen.clone() else { return Ok(()) };
        let begin = Instant::now();
        let coding = update.coding;
        let parts = self.eyes.encode(&image, update.rects, coding).await;
        let parts = parts.context("encoding a frame")?;
        self.updates += 1;
        let framed = Framed {
            shown: &shown,
            update: self.updates,
            client: self.guest.number,
            cursor: self.wanted.borrow().cursor,
            image: &image,
            is_exact: self.screen.is_exact(),
            coding,
            times: StageTimes { encode: milliseconds(begin, Instant::now()), ..self.times },
        };
        let message = framed.message(&parts);
        self.under_way =
            Some(UnderWay { update: self.updates, bytes: message.len(), since: Instant::now() });
        self.send(Message::Binary(message.into())).await
    }

    async fn send(&mut self, message: Message) -> Result<()> {
        timeout(SENDING, self.sink.send(message)).await.context("the client takes nothing")??;
        Ok(())
    }
}

/// Waits for the next frame; for ever without a receiver.
async fn next_frame(
    frames: &mut Option<watch::Receiver<Option<Arc<PublishedFrame>>>>,
) -> Result<(), watch::error::RecvError> {
    match frames {
        Some(frames) => frames.changed().await,
        None => std::future::pending().await,
    }
}

/// Returns the time between two moments, milliseconds.
fn milliseconds(from: Instant, to: Instant) -> f64 {
    1e3 * to.saturating_duration_since(from).as_secs_f64()
}

fn text(text: String) -> Message {
    Message::Text(text.into())
}
