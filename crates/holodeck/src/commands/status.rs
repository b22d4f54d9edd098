//! `holodeck status`: shows the state of a running server, for people and for other programs.

use std::{fmt::Write, path::PathBuf};

use anyhow::Result;
use holo_net::{Destination, Identity};
use holo_progress::{HumanBytes, HumanCount};
use holo_proto::report::{FaultReport, StatusReport};
use holodeck::status::QueriedServer;

use crate::commands::metrics;

/// Show the state of a running server: its file, its workers and its displays
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck status --connect 127.0.0.1:7070\n  \
    holodeck status --connect 127.0.0.1:7070 --prometheus")]
pub struct StatusArgs {
    /// The holoserver: its address on this machine, or an administrator's string to join with (see
    /// `holodeck tokens --add admin`)
    #[arg(
        long,
        visible_alias = "join",
        value_name = "HOST:PORT|STRING",
        default_value = "127.0.0.1:7070"
    )]
    connect: String,
    /// Folder of the certificate and the tokens of a server on this machine that encrypts its
    /// connections [default: holodeck/server in the user's configuration folder]
    #[arg(long, value_name = "DIR")]
    identity: Option<PathBuf>,
    /// Print JSON
    #[arg(long, conflicts_with = "prometheus")]
    json: bool,
    /// Print the text that Prometheus reads
    #[arg(long)]
    prometheus: bool,
    /// Keep running, and answer Prometheus at http://HOST:PORT/metrics. On this machine alone
    #[arg(long, value_name = "HOST:PORT", conflicts_with_all = ["json", "prometheus"])]
    serve: Option<String>,
}

/// See [`StatusArgs`].
pub async fn run(args: StatusArgs) -> Result<()> {
    let destination = Destination::parse(&args.connect)?;
    let server =
        QueriedServer { destination, identity: args.identity.or_else(Identity::users_folder) };
    if let Some(address) = &args.serve {
        return metrics::serve(server, holo_net::loopback(address)?).await;
    }
    let report = server.report().await?;
    let text = if args.json {
        serde_json::to_string(&report)? + "\n"
    } else if args.prometheus {
        metrics::text_of(&report)?
    } else {
        table(&report)
    };
    holo_progress::print(format_args!("{text}"));
    Ok(())
}

/// Returns a report as a table for people.
fn table(report: &StatusReport) -> String {
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
        if !is_dropped {
            let _ = writeln!(text, "they differ: {name}: {reason}");
            continue;
        }
        let _ = writeln!(text, "dropped: {name} (no. {maker}): {reason}");
        if *maker > 0 {
            let file = &report.file;
            let _ = writeln!(text, "  remove its samples: holodeck forget {file} --worker {maker}");
        }
        if !token.is_empty() {
            let _ = writeln!(text, "  keep it out: holodeck tokens --revoke {token}");
        }
    }
    text
}

#[cfg(test)]
pub mod tests {
    use holo_proto::report::{DisplayReport, WorkerReport};

    use super::*;

    pub fn report() -> StatusReport {
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
        StatusReport {
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
            ..StatusReport::default()
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
}
