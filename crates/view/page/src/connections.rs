//! The page's connections: bounded in number, and in the time until their first request.
//!
//! Invariants:
//! - A connection whose first request has not been admitted within [`REQUEST_TIME`] ends.
//! - At most [`MOST_CONNECTIONS`] are open. A further one ends the oldest without an admitted
//!   request. If there is none, it ends the one whose last request is the longest ago. Sessions and
//!   requests under way stay.

use std::{
    collections::BTreeMap,
    io,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use axum::{
    extract::connect_info::Connected,
    serve::{IncomingStream, Listener},
};
use futures_util::task::AtomicWaker;
use parking_lot::Mutex;
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    time::{Instant, Sleep, sleep},
};

/// Longest time from the opening of a connection, encrypted if need be, to its first whole request.
const REQUEST_TIME: Duration = Duration::from_secs(10);

/// Most connections. Sessions are fewer, and a browser opens six besides.
const MOST_CONNECTIONS: usize = 192;

/// What a connection is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ConnectionPhase {
    /// No request was admitted yet.
    Unknown,
    /// A request is being answered.
    Asked,
    /// All requests are answered.
    Idle,
    /// It is a session.
    Session,
    /// It must end.
    Ended,
}

/// All open connections, by number.
#[derive(Default)]
struct Connections {
    last: u64,
    open: BTreeMap<u64, Arc<Connection>>,
}

/// One connection.
struct Connection {
    number: u64,
    state: Mutex<(ConnectionPhase, Instant)>,
    /// Wakes whoever reads from it.
    reader: AtomicWaker,
}

impl Connection {
    fn phase(&self) -> ConnectionPhase {
        self.state.lock().0
    }

    /// Enters a phase, unless it must end.
    fn enter(&self, phase: ConnectionPhase) {
        let mut state = self.state.lock();
        if state.0 != ConnectionPhase::Ended {
            *state = (phase, Instant::now());
        }
    }

    fn end(&self) {
        self.state.lock().0 = ConnectionPhase::Ended;
        self.reader.wake();
    }
}

impl Connections {
    /// Adds a connection, and ends another one if there are too many.
    fn add(&mut self) -> Arc<Connection> {
        if self.open.len() >= MOST_CONNECTIONS {
            let of = |phase: ConnectionPhase| {
                let of_phase = self.open.values().filter(move |known| known.phase() == phase);
                of_phase.min_by_key(|known| known.state.lock().1).map(|known| known.number)
            };
            let victim = of(ConnectionPhase::Unknown).or_else(|| of(ConnectionPhase::Idle));
            if let Some(victim) = victim.and_then(|number| self.open.remove(&number)) {
                victim.end();
            }
        }
        self.last += 1;
        let state = Mutex::new((ConnectionPhase::Unknown, Instant::now()));
        let connection = Connection { number: self.last, state, reader: AtomicWaker::new() };
        let connection = Arc::new(connection);
        self.open.insert(self.last, Arc::clone(&connection));
        connection
    }
}

/// A listener whose connections are bounded.
pub struct Bounded<L> {
    listener: L,
    connections: Arc<Mutex<Connections>>,
}

impl<L: Listener> Bounded<L> {
    /// Bounds the connections of a listener.
    pub fn new(listener: L) -> Bounded<L> {
        Bounded { listener, connections: Arc::default() }
    }
}

impl<L: Listener> Listener for Bounded<L> {
    type Io = WatchedStream<L::Io>;
    type Addr = L::Addr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        let (stream, from) = self.listener.accept().await;
        let connection = self.connections.lock().add();
        let connections = Arc::clone(&self.connections);
        let limit = Box::pin(sleep(REQUEST_TIME));
        (WatchedStream { stream, connection, connections, limit }, from)
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.listener.local_addr()
    }
}

/// A stream that ends when its connection must.
pub struct WatchedStream<S> {
    stream: S,
    connection: Arc<Connection>,
    connections: Arc<Mutex<Connections>>,
    limit: Pin<Box<Sleep>>,
}

impl<S> Drop for WatchedStream<S> {
    fn drop(&mut self) {
        self.connections.lock().open.remove(&self.connection.number);
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for WatchedStream<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.connection.reader.register(context.waker());
        let phase = self.connection.phase();
        let is_late =
            phase == ConnectionPhase::Unknown && self.limit.as_mut().poll(context).is_ready();
        if is_late || phase == ConnectionPhase::Ended {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        Pin::new(&mut self.stream).poll_read(context, into)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for WatchedStream<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

/// The connection that a request came by.
#[derive(Clone)]
pub struct Visitor(Arc<Connection>);

impl<L: Listener> Connected<IncomingStream<'_, Bounded<L>>> for Visitor {
    fn connect_info(stream: IncomingStream<'_, Bounded<L>>) -> Visitor {
        Visitor(Arc::clone(&stream.io().connection))
    }
}

impl Visitor {
    /// Records that a request is admitted, and is being answered.
    pub fn asks(&self) {
        self.0.enter(ConnectionPhase::Asked);
    }

    /// Records that the answer is ready.
    pub fn is_answered(&self) {
        if self.0.phase() == ConnectionPhase::Asked {
            self.0.enter(ConnectionPhase::Idle);
        }
    }

    /// Records that the connection is a session from now on.
    pub fn begins_session(&self) {
        self.0.enter(ConnectionPhase::Session);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_unknown_gives_way_then_the_idlest_and_never_a_session() {
        let mut connections = Connections::default();
        let mut add = |phase: ConnectionPhase| {
            let connection = connections.add();
            connection.enter(phase);
            connection
        };
        let session = add(ConnectionPhase::Session);
        let idle = add(ConnectionPhase::Idle);
        let mut others = Vec::new();
        for _ in 0..MOST_CONNECTIONS {
            others.push(add(ConnectionPhase::Unknown));
        }
        let ended = |of: &[Arc<Connection>]| {
            of.iter().filter(|known| known.phase() == ConnectionPhase::Ended).count()
        };
        assert_eq!((ended(&others), ended(&others[..2])), (2, 2));
        others.iter().for_each(|known| known.enter(ConnectionPhase::Asked));
        let more = add(ConnectionPhase::Asked);
        assert_eq!((ended(&others), idle.phase()), (2, ConnectionPhase::Ended));
        assert_eq!(
            (session.phase(), more.phase()),
            (ConnectionPhase::Session, ConnectionPhase::Asked)
        );
    }
}
