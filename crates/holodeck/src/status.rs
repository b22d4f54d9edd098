//! `holodeck status`: how a running server fares, for people and for other programs.

use std::fmt::Write;

use anyhow::{Context, Result, bail};
use holo_net::{Destination, Message};
use holo_progress::{HumanBytes, HumanCount};
use holo_proto::{
    control::Control,
    hello::Role,
    report::{FaultReport, Report},
};
use prometheus_client::{
    encoding::text,
    metrics::{family::Family, gauge::Gauge},
    registry::Registry,
};

/// Show how a running server fares: its file, its workers and its displays
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck status --connect 127.0.0.1:7070\n  \
    holodeck status --connect 127.0.0.1:7070 --prometheus")]
pub struct Args {
    /// The holoserver: its address on this machine, or an administrator's string to join with (see
    /// `holodeck tokens --add admin`)
    #[arg(
        long,
        visible_alias = "join",
        value_name = "HOST:PORT|STRING",
        default_value = "127.0.0.1:7070"
    )]
    connect: String,
    /// Print JSON
    #[arg(long, conflicts_with = "prometheus")]
    json: bool,
    /// Print the text that Prometheus reads
    #[arg(long)]
    prometheus: bool,
}

/// See [`Args`].
pub async fn run(args: Args) -> Result<()> {
    let report = ask(Destination::parse(&args.connect)?).await?;
    let text = if args.json {
        serde_json::to_string(&report)? + "\n"
    } else if args.prometheus {
        metrics(&report)?
    } else {
        table(&report)
    };
    print!("{text}");
    Ok(())
}

/// Asks a server how it fares.
async fn ask(server: Destination) -> Result<Report> {
    let connected = holo_net::connect(server.clone(), Role::Admin, "holodeck status").await;
    let (mut inbox, outbox, _) =
        connected.with_context(|| format!("connecting to the holoserver at {server}"))?;
    outbox.control(&Control::ReportWanted)?;
    loop {
        match inbox.next().await? {
            Message::Control(Control::Report(report)) => return Ok(*report),
            Message::Control(Control::Bye { reason }) => bail!("the server left: {reason}"),
            _ => {}
        }
    }
}

/// Returns a report for people.
fn table(report: &Report) -> String {
    let mut text = format!(
        "{}: {} samples, {}; {} traced, {}/s; {} beams see nothing\n",
        report.file,
        HumanCount(report.samples),
        HumanBytes(report.file_bytes),
        HumanCount(report.traced),
        HumanCount(report.samples_per_second as u64),
        HumanCount(report.unseen_beams),
    );
    if !report.disk_error.is_empty() {
        text += &format!("samples wait in memory: {}\n", report.disk_error);
    }
    if !report.workers.is_empty() {
        text += "\nworker                        no. threads     rays/s  packets   late  latency     rays\n";
    }
    for worker in &report.workers {
        let threads = match worker.threads {
            0 => "loads".to_owned(),
            threads => threads.to_string(),
        };
        let (rate, latency) = (worker.rays_per_second as u64, worker.latency * 1000.0);
        // Writing to a text cannot fail.
        let _ = writeln!(
            text,
            "{:<28} {:>4} {threads:>7} {rate:>10} {:>8} {:>6} {latency:>5.0} ms {:>8}",
            worker.name, worker.maker, worker.packets, worker.late_packets, worker.rays
        );
    }
    if !report.displays.is_empty() {
        text += "\ndisplay                         beams     waiting\n";
    }
    for display in &report.displays {
        let waiting = HumanBytes(display.queued_bytes).to_string();
        let note = if display.is_read_only { "  read-only" } else { "" };
        let _ = writeln!(text, "{:<28} {:>8} {waiting:>11}{note}", display.name, display.beams);
    }
    if !report.faults.is_empty() {
        text += "\n";
    }
    for fault in &report.faults {
        let FaultReport { name, maker, token, reason, is_dropped } = fault;
        let dropped = if *is_dropped { "dropped" } else { "in doubt" };
        let _ = writeln!(text, "{dropped}: {name} (no. {maker}): {reason}");
        if *is_dropped {
            let file = &report.file;
            let _ = writeln!(text, "  remove its samples: holodeck forget {file} --worker {maker}");
        }
        if *is_dropped && !token.is_empty() {
            let _ = writeln!(text, "  keep it out: holodeck tokens --revoke {token}");
        }
    }
    text
}

/// The label of a metric of one worker or display.
type Labels = Vec<(&'static str, String)>;

/// Returns a report as Prometheus reads it.
fn metrics(report: &Report) -> Result<String> {
    let mut registry = Registry::with_prefix("holodeck");
    let mut add = |name: &str, help: &str, value: f64| {
        let gauge = Gauge::<f64, std::sync::atomic::AtomicU64>::default();
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
        let family = Family::<Labels, Gauge<f64, std::sync::atomic::AtomicU64>>::default();
        for (peer, value) in values {
            family.get_or_create(&vec![("name", peer.to_owned())]).set(value);
        }
        registry.register(name, help, family);
    };
    let workers = |value: fn(&holo_proto::report::WorkerReport) -> f64| {
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
    use holo_proto::report::{DisplayReport, WorkerReport};

    use super::*;

    fn report() -> Report {
        let worker = |name: &str, threads| WorkerReport {
            name: name.into(),
            maker: 7,
            threads,
            rays_per_second: 1234.5,
            rays: 99,
            packets: 3,
            late_packets: 2,
            latency: 0.25,
            queued_bytes: 0,
        };
        Report {
            file: "a.holo".into(),
            samples: 1_000_000,
            workers: vec![worker("rtworker 1", 4), worker("an \"odd\" one", 0)],
            displays: vec![DisplayReport {
                name: "holoview 2".into(),
                beams: 500,
                is_read_only: true,
                queued_bytes: 2048,
            }],
            faults: vec![FaultReport {
                name: "rtworker 3".into(),
                maker: 9,
                token: "GkdS3h6pXzU".into(),
                reason: "its red light is 0.50 times that of others".into(),
                is_dropped: true,
            }],
            ..Report::default()
        }
    }

    #[test]
    fn people_read_a_line_for_each_worker_and_display() {
        let text = table(&report());
        assert!(text.starts_with("a.holo: 1,000,000 samples"), "{text}");
        let worker = text.lines().find(|line| line.starts_with("rtworker 1")).unwrap();
        let words: Vec<_> = worker.split_whitespace().collect();
        assert_eq!(words[2..], ["7", "4", "1234", "3", "2", "250", "ms", "99"], "{text}");
        assert!(text.contains("loads") && text.contains("read-only"), "{text}");
        assert!(!text.contains("samples wait in memory"), "{text}");
        assert!(text.contains("dropped: rtworker 3 (no. 9): its red light"), "{text}");
        assert!(text.contains("holodeck forget a.holo --worker 9"), "{text}");
        assert!(text.contains("holodeck tokens --revoke GkdS3h6pXzU"), "{text}");
    }

    #[test]
    fn prometheus_reads_a_value_for_each_worker_and_display() {
        let text = metrics(&report()).unwrap();
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
