//! Carries an object through a served holodeck, and measures the time from each move to the frame
//! that shows it, over the way that a person's inputs take.
//!
//! `cargo run --release -p holo-stage --example carry -- ADDRESS OBJECT X Y Z`

use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use holo_drivers::DriverOptions;
use holo_net::Shutdown;
use holo_options::ViewArgs;
use holo_session::Connected;
use holo_stage::{Input, Wishes, commands, stage};

/// Number of moves.
const MOVES: u32 = 60;

/// Time between two moves: that of a hand at 30 events a second.
const PAUSE: Duration = Duration::from_millis(33);

/// Longest time until the object is seen.
const APPEARS: Duration = Duration::from_secs(60);

/// Time until the first frame is at rest.
const SETTLES: Duration = Duration::from_secs(8);

#[tokio::main]
async fn main() {
    if let Err(error) = carry().await {
        eprintln!("{error:#}");
        // The stage's thread would be waited for.
        std::process::exit(1);
    }
}

async fn carry() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    ensure!(arguments.len() >= 5, "needs ADDRESS OBJECT X Y Z, and may have options of a view");
    let (address, object) = (arguments[0].clone(), arguments[1].clone());
    let place: Vec<f64> = arguments[2..5].iter().map(|c| c.parse()).collect::<Result<_, _>>()?;
    let server = holo_net::Destination::parse(&address)?;
    let shutdown = Shutdown::new();
    let choice = Box::new(DriverOptions::default());
    let connected = Connected::new(server, choice, true, shutdown).await?;
    let view = ViewArgs { size: Some((1280, 720)), ..ViewArgs::default() };
    let (stage, front) = stage(connected, Wishes { view, record: None, crew: None });
    let running = tokio::task::spawn_blocking(move || stage.run());
    let mut frames = front.frames.subscribe();
    let mut number = 0;
    let mut send = |line: &str| {
        number += 1;
        let input = commands::parse(line).map_err(anyhow::Error::msg)?;
        ensure!(front.inputs.send(1, number, input), "the stage takes no input");
        Ok(number)
    };
    frames.changed().await?;
    if arguments.len() > 5 {
        send(&format!("view {}", arguments[5..].join(" ")))?;
    }
    tokio::time::sleep(SETTLES).await;
    let depth = |frame: &holo_stage::PublishedFrame| frame.frame.depth.clone();
    let empty = frames.borrow_and_update().as_ref().map(|frame| depth(frame));
    send(&format!("object add {object} at {} {} {} as carried", place[0], place[1], place[2]))?;
    let begin = Instant::now();
    while frames.borrow_and_update().as_ref().map(|frame| depth(frame)) == empty {
        tokio::time::timeout(APPEARS, frames.changed()).await.context("no object came")??;
    }
    println!("from the order to its first frame: {:.1} s", begin.elapsed().as_secs_f64());
    tokio::time::sleep(SETTLES).await;
    let mut times = Vec::new();
    for step in 0..MOVES {
        let begin = Instant::now();
        let before = frames.borrow_and_update().as_ref().map(|frame| depth(frame));
        let by = if step % 20 < 10 { 0.03 } else { -0.03 };
        send(&format!("object move carried by {by} 0 0"))?;
        loop {
            tokio::time::timeout(SETTLES, frames.changed()).await.context("no frame came")??;
            let now = frames.borrow_and_update().as_ref().map(|frame| depth(frame));
            if now != before {
                break;
            }
        }
        times.push(begin.elapsed().as_secs_f64() * 1e3);
        tokio::time::sleep(PAUSE).await;
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!(
        "from a move to its frame: median {:.1} ms, 90 % {:.1} ms, most {:.1} ms",
        at(0.5),
        at(0.9),
        at(1.0)
    );
    ensure!(front.inputs.send(1, u64::MAX, Input::Quit), "the stage takes no input");
    running.await?
}
