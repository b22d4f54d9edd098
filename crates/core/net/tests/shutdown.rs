//! Requests to end a process. It is alone in its process, because it sends a signal to it.

#[path = "it/common/mod.rs"]
mod common;

use std::process::Command;

use common::SOON;
use holo_net::Shutdown;
use tokio::time::timeout;

#[tokio::test(start_paused = true)]
async fn everyone_who_waits_is_woken_and_whoever_comes_later_does_not_wait() {
    let shutdown = Shutdown::new();
    assert!(!shutdown.is_triggered());
    let waiting: Vec<_> = (0..10)
        .map(|_| {
            let shutdown = shutdown.clone();
            tokio::spawn(async move { shutdown.wait().await })
        })
        .collect();
    assert!(timeout(SOON, shutdown.wait()).await.is_err(), "not triggered yet");
    assert!(waiting.iter().all(|task| !task.is_finished()));
    shutdown.clone().trigger();
    for task in waiting {
        timeout(SOON, task).await.unwrap().unwrap();
    }
    assert!(shutdown.is_triggered());
    shutdown.trigger();
    timeout(SOON, shutdown.wait()).await.expect("once triggered it stays so");
    assert!(!Shutdown::default().is_triggered(), "another one is another one's");
}

#[tokio::test]
async fn it_outlives_the_one_that_triggered_it() {
    let shutdown = Shutdown::new();
    let copy = shutdown.clone();
    let waiting = tokio::spawn(async move { copy.wait().await });
    tokio::task::yield_now().await;
    shutdown.trigger();
    drop(shutdown);
    timeout(SOON, waiting).await.unwrap().unwrap();
}

#[tokio::test]
async fn a_polite_kill_triggers_it() {
    let shutdown = Shutdown::new();
    shutdown.on_signals(false).unwrap();
    let sent = Command::new("sh")
        .args(["-c", &format!("kill -TERM {}", std::process::id())])
        .status()
        .unwrap();
    assert!(sent.success());
    timeout(SOON, shutdown.wait()).await.expect("triggered");
}
