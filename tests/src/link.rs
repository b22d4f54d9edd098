//! A link between clients and a server of this machine. It can be slow, have a delay, lose packets,
//! hang, or be cut.

use std::{
    io::{ErrorKind, Read, Write},
    net::{Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
    time::{Duration, Instant},
};

/// Bytes that are passed on together: about a packet.
const PIECE: usize = 1024;

/// Most pieces in transit in one direction of a connection.
const WINDOW: usize = 64;

/// Time after which a sender repeats a lost packet: the least value in Linux.
const SENT_AGAIN: Duration = Duration::from_millis(200);

/// Interval at which a link that passes nothing on is checked.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// The quality of a link.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quality {
    /// Bytes per second from the server over each connection; 0 without a limit.
    pub rate: u64,
    /// Delay of bytes in either direction.
    pub delay: Duration,
    /// Percent of pieces that are lost, and arrive after a repetition. Later ones wait for them.
    pub lost: u64,
    /// The state of connections.
    pub state: State,
}

/// The state of a link's connections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Bytes pass.
    #[default]
    Open,
    /// No byte passes, and neither side learns the reason.
    Hangs,
    /// Every connection ends, and new ones end at once.
    Cut,
}

/// Passes connections on to a server.
pub struct Link {
    address: SocketAddr,
    quality: Arc<Mutex<Quality>>,
}

impl Link {
    /// Makes a link to a server. At first, it passes everything on without delay.
    ///
    /// # Panics
    /// If no port is free.
    pub fn new(server: SocketAddr) -> Link {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
        let address = listener.local_addr().expect("it has an address");
        let quality = Arc::new(Mutex::new(Quality::default()));
        let shared = Arc::clone(&quality);
        thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                if shared.lock().unwrap().state == State::Cut {
                    continue;
                }
                let Ok(server) = TcpStream::connect(server) else { return };
                join(&client, &server, &shared, false);
                join(&server, &client, &shared, true);
            }
        });
        Link { address, quality }
    }

    /// Returns the address for clients.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Changes the quality of the link.
    pub fn set(&self, quality: Quality) {
        *self.quality.lock().unwrap() = quality;
    }
}

/// Passes on one direction of a connection, with two threads, because bytes may be in transit
/// between them.
fn join(from: &TcpStream, to: &TcpStream, quality: &Arc<Mutex<Quality>>, is_limited: bool) {
    let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) else { return };
    let (sender, pieces) = sync_channel(WINDOW);
    let (ours, theirs) = (Arc::clone(quality), Arc::clone(quality));
    thread::spawn(move || take(from, &sender, &ours));
    thread::spawn(move || give(to, &pieces, &theirs, is_limited));
}

/// Reads pieces from one side, and sets the time when each arrives.
fn take(mut from: TcpStream, pieces: &SyncSender<(Instant, Vec<u8>)>, quality: &Mutex<Quality>) {
    let mut piece = [0; PIECE];
    let (mut last, mut random) = (Instant::now(), 1_u64);
    // If the time-out cannot be set, a link that is cut closes only with the next byte.
    let _ = from.set_read_timeout(Some(LOOK_EVERY));
    loop {
        let read = from.read(&mut piece);
        let now = *quality.lock().unwrap();
        if now.state == State::Cut {
            break;
        }
        match read {
            Ok(read @ 1..) => {
                // The constants of Knuth's MMIX.
                random = random.wrapping_mul(6_364_136_223_846_793_005);
                random = random.wrapping_add(1_442_695_040_888_963_407);
                let is_lost = (random >> 33) % 100 < now.lost;
                let again = if is_lost { SENT_AGAIN } else { Duration::ZERO };
                last = last.max(Instant::now() + now.delay + again);
                if pieces.send((last, piece[..read].to_vec())).is_err() {
                    break;
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            _ => break,
        }
    }
    let _ = from.shutdown(Shutdown::Read);
}

/// Writes pieces to the other side, each at its time of arrival.
fn give(
    mut to: TcpStream,
    pieces: &Receiver<(Instant, Vec<u8>)>,
    quality: &Mutex<Quality>,
    is_limited: bool,
) {
    while let Ok((arrives, piece)) = pieces.recv() {
        thread::sleep(arrives.saturating_duration_since(Instant::now()));
        while quality.lock().unwrap().state == State::Hangs {
            thread::sleep(LOOK_EVERY);
        }
        if to.write_all(&piece).is_err() {
            break;
        }
        let rate = quality.lock().unwrap().rate;
        if is_limited && rate > 0 {
            thread::sleep(Duration::from_secs_f64(piece.len() as f64 / rate as f64));
        }
    }
    // The other direction ends, too. If that side is gone, the call fails harmlessly.
    let _ = to.shutdown(Shutdown::Both);
}
