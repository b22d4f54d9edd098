//! A slow link between a client and a server of this machine.

use std::{
    io::{Read, Write},
    net::{Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

/// Bytes that are passed on at a time.
const PIECE: usize = 1024;

/// Passes connections on to a server. What the server sends comes at a limited rate.
pub struct Link {
    address: SocketAddr,
    /// Bytes per second; 0 without a limit.
    rate: Arc<AtomicU64>,
}

impl Link {
    /// Makes a link to a server, without a limit.
    ///
    /// # Panics
    /// If no port is free.
    pub fn new(server: SocketAddr) -> Link {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
        let address = listener.local_addr().expect("it has an address");
        let rate = Arc::new(AtomicU64::new(0));
        let shared = Arc::clone(&rate);
        thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                let Ok(server) = TcpStream::connect(server) else { return };
                let (Ok(up), Ok(down)) = (client.try_clone(), server.try_clone()) else { return };
                let rate = Arc::clone(&shared);
                thread::spawn(move || pass(up, server, &AtomicU64::new(0)));
                thread::spawn(move || pass(down, client, &rate));
            }
        });
        Link { address, rate }
    }

    /// Where clients connect.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Limits what the server sends over each connection, bytes per second; 0 limits nothing.
    pub fn set_rate(&self, bytes_per_second: u64) {
        self.rate.store(bytes_per_second, Ordering::Relaxed);
    }
}

/// Passes bytes on until either side has gone.
fn pass(mut from: TcpStream, mut to: TcpStream, rate: &AtomicU64) {
    let mut piece = [0; PIECE];
    while let Ok(read @ 1..) = from.read(&mut piece) {
        if to.write_all(&piece[..read]).is_err() {
            break;
        }
        let rate = rate.load(Ordering::Relaxed);
        if rate > 0 {
            thread::sleep(Duration::from_secs_f64(read as f64 / rate as f64));
        }
    }
    // The other direction ends, too. A side that has gone needs to hear nothing.
    let _ = from.shutdown(Shutdown::Both);
    let _ = to.shutdown(Shutdown::Both);
}
