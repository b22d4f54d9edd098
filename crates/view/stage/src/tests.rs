//! Tests of a stage whose server disconnects and comes back.

use holo_drivers::{DriverArgs, DriverOptions};
use holo_net::Shutdown;
use holo_options::ViewArgs;
use holo_proto::control::{Control, Farewell};
use holo_session::{Connected, DriverArg};
use tokio::{net::TcpListener, time::timeout};

use super::{Wishes, stage};
use server::{LIMIT, serve};

#[path = "../../session/src/tests/server.rs"]
mod server;

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_lost_or_starts_again_is_reached_and_asked_for_the_view() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let shutdown = Shutdown::new();
    let args = DriverArgs { driver: DriverArg::Quadtree, ..DriverArgs::default() };
    let choice = Box::new(DriverOptions { args, ..DriverOptions::default() });
    let connecting = Connected::new(address, choice, true, shutdown.clone());
    let playing = tokio::spawn(async move {
        let connected = connecting.await.unwrap();
        let view = ViewArgs { size: Some((32, 24)), ..ViewArgs::default() };
        let (stage, _front) = stage(connected, Wishes { view, record: None, crew: None });
        tokio::task::spawn_blocking(move || stage.run()).await.unwrap()
    });
    for _ in 0..2 {
        // The server closes the connection without a message, as if it had been killed.
        drop(serve(&listener).await);
        let (_inbox, outbox) = serve(&listener).await;
        outbox.control(&Control::Bye(Farewell::StartsAgain)).unwrap();
        outbox.drained().await;
    }
    shutdown.trigger();
    drop(listener);
    timeout(LIMIT, playing).await.unwrap().unwrap().unwrap();
}
