//! A server's report in the format of Prometheus, as text and over HTTP.

use std::{net::SocketAddr, sync::atomic::AtomicU64};

use anyhow::{Context, Result};
use axum::{Router, http::StatusCode, routing::get};
use holo_net::Shutdown;
use holo_progress::said_once;
use holo_proto::report::{StatusReport, WorkerReport};
use holodeck::status::QueriedServer;
use prometheus_client::{
    encoding::text,
    metrics::{family::Family, gauge::Gauge},
    registry::Registry,
};
use tokio::net::TcpListener;

/// Answers Prometheus at `/metrics` until a signal. Each answer is a new report of the server. If
/// the server does not answer, Prometheus gets an error.
///
/// # Errors
/// If the address is not free.
pub async fn serve(server: QueriedServer, address: SocketAddr) -> Result<()> {
    let listener = TcpListener::bind(address).await;
    let listener = listener.with_context(|| format!("listening at {address}"))?;
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    holo_progress::print_line!("metrics at http://{}/metrics", listener.local_addr()?);
    let answer = move || {
        let server = server.clone();
        async move {
            let text = server.report().await.and_then(|report| text_of(&report));
            text.map_err(|error| (StatusCode::BAD_GATEWAY, said_once(error.as_ref()) + "\n"))
        }
    };
    let router = Router::new().route("/metrics", get(answer));
    let ended = async move { shutdown.wait().await };
    Ok(axum::serve(listener, router).with_graceful_shutdown(ended).await?)
}

/// A metric that is any number.
type Number = Gauge<f64, AtomicU64>;

/// The label of a metric of one worker or display.
type Labels = Vec<(&'static str, String)>;

/// Returns a report in the format of Prometheus.
pub fn text_of(report: &StatusReport) -> Result<String> {
    let mut registry = Registry::with_prefix("holodeck");
    let mut add = |name: &str, help: &str, value: f64| {
        let gauge = Number::default();
        gauge.set(value);
        registry.register(name, help, gauge);
    };
    add("samples", "Samples in the file and in memory", report.samples as f64);
    add("traced", "Samples traced since the server began", report.traced as f64);
    add("samples_per_second", "Samples per second from all workers", report.samples_per_second);
    add("file_bytes", "Length of the file", report.file_bytes as f64);
    add("unseen_beams", "Beams that see nothing", report.unseen_beams as f64);
    add("disk_failing", "Whether samples wait in memory", f64::from(!report.disk_error.is_empty()));
    let dropped = report.faults.iter().filter(|fault| fault.is_dropped).count();
    add("workers_broken", "Workers dropped because their samples were wrong", dropped as f64);
    add("workers", "Workers connected", report.workers.len() as f64);
    add("displays", "Displays connected", report.displays.len() as f64);
    let mut families = |name: &str, help: &str, values: Vec<(&str, f64)>| {
        let family = Family::<Labels, Number>::default();
        for (peer, value) in values {
            family.get_or_create(&vec![("name", peer.to_owned())]).set(value);
        }
        registry.register(name, help, family);
    };
    let workers = |value: fn(&WorkerReport) -> f64| {
        report.workers.iter().map(|worker| (worker.name.as_str(), value(worker))).collect()
    };
    let rate = workers(|worker| worker.rays_per_second);
    families("worker_rays_per_second", "Rays per second of a worker while it has work", rate);
    families("worker_rays", "Rays that a worker has returned", workers(|w| w.rays as f64));
    families("worker_packets", "Packets that a worker has", workers(|w| f64::from(w.packets)));
    let late = workers(|worker| f64::from(worker.late_packets));
    families("worker_late_packets", "Packets that a worker has not returned in time", late);
    let latency = workers(|worker| worker.latency);
    families("worker_latency_seconds", "Seconds from a packet to its results", latency);
    let waiting =
        report.displays.iter().map(|d| (d.name.as_str(), d.queued_bytes as f64)).collect();
    families("display_queued_bytes", "Bytes that wait to be sent to a display", waiting);
    let mut encoded = String::new();
    text::encode(&mut encoded, &registry)?;
    Ok(encoded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::status::tests::report;

    #[test]
    fn prometheus_reads_a_value_for_each_worker_and_display() {
        let text = text_of(&report()).unwrap();
        for line in [
            "holodeck_samples 1000000.0",
            "holodeck_worker_rays_per_second{name=\"rtworker 1\"} 1234.5",
            "holodeck_worker_late_packets{name=\"an \\\"odd\\\" one\"} 2.0",
            "holodeck_display_queued_bytes{name=\"holoview 2\"} 2048.0",
            "holodeck_disk_failing 0.0",
            "holodeck_workers_broken 1.0",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}: {text}");
        }
    }
}
