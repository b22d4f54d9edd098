//! Fills a file with samples of a scene, without a viewer.

use std::{
    ffi::OsString,
    io::Write,
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Context, Result};
use holo_net::Shutdown;
use holo_server::{HolodeckDescription, Outside, Shard, Summary};
use tempfile::NamedTempFile;

use crate::{
    config::HolodeckConfig,
    listening::ListenOptions,
    prepare::{self, OtherScene},
    processes::LocalServer,
    seen::seen_beams,
    worker::{KeptWorker, NICE},
};

/// A fill: what is traced, into which file, and when it ends.
#[derive(Clone, Debug)]
pub struct FillRequest {
    /// The program that contains server and worker: `holodeck`.
    pub program: PathBuf,
    /// The holodeck; made if it does not exist.
    pub file: PathBuf,
    /// The scene, its sections, and the settings of samples. The limits of a fill in it are not
    /// used.
    pub config: HolodeckConfig,
    /// What becomes of a file of another scene.
    pub other_scene: OtherScene,
    /// Where workers and displays of other machines join.
    pub listen: ListenOptions,
    /// Time of tracing. Loading does not count.
    pub time: Option<Duration>,
    /// Number of samples to trace; those traced again count.
    pub samples: Option<u64>,
    /// Longest file, bytes.
    pub disk: Option<u64>,
    /// Number of samples in the file from which known samples are traced again.
    pub enough: Option<u64>,
    /// The share of the beams to fill.
    pub shard: Option<Shard>,
    /// A file of views. Only the beams that they see are filled.
    pub views: Option<PathBuf>,
    /// Threads that trace. `None`: one per core.
    pub threads: Option<u16>,
    /// Memory for beams, MiB.
    pub cache: Option<u64>,
    /// True if beams whose rays cannot hit anything are traced, too.
    pub traces_unseen: bool,
    /// Hides progress.
    pub quiet: bool,
}

impl FillRequest {
    /// Returns a fill without an end, by this program.
    pub fn new(program: PathBuf, file: PathBuf, config: HolodeckConfig) -> FillRequest {
        FillRequest {
            program,
            file,
            config,
            other_scene: OtherScene::Refuse,
            listen: ListenOptions::default(),
            time: None,
            samples: None,
            disk: None,
            enough: None,
            shard: None,
            views: None,
            threads: None,
            cache: None,
            traces_unseen: false,
            quiet: true,
        }
    }

    /// Returns the server's arguments.
    fn server_arguments(&self) -> Vec<OsString> {
        let numbers = [
            ("--time", self.time.map(|time| time.as_secs_f64().to_string())),
            ("--samples", self.samples.map(|samples| samples.to_string())),
            ("--disk", self.disk.map(|bytes| bytes.to_string())),
            ("--enough", self.enough.map(|enough| enough.to_string())),
            ("--shard", self.shard.map(|shard| shard.to_string())),
            ("--cache", self.cache.map(|cache| cache.to_string())),
        ];
        let mut arguments: Vec<OsString> = vec![self.file.clone().into(), "--fill".into()];
        for (name, number) in numbers {
            arguments.extend(number.into_iter().flat_map(|number| [name.into(), number.into()]));
        }
        arguments.extend(self.listen.arguments());
        if self.traces_unseen {
            arguments.push("--no-skip-unseen".into());
        }
        if self.quiet {
            arguments.push("--quiet".into());
        }
        arguments
    }
}

/// Fills a file until it has what the request asks for, or `shutdown` is triggered, and returns
/// what was traced. `None` if `shutdown` was triggered before tracing began. Calls `invite` if
/// other machines may join.
///
/// # Errors
/// If the scene cannot be loaded or the file cannot be written, or the server or its worker fails.
pub async fn fill(
    request: &FillRequest,
    shutdown: &Shutdown,
    invite: impl FnOnce(&Outside),
) -> Result<Option<Summary>> {
    let FillRequest { program, file, config, other_scene, quiet, .. } = request;
    // The file is only made, checked and closed here, because the server writes it.
    let about = prepare::make_unless_ended(file, config, *other_scene, *quiet, shutdown).await?;
    let list = request.views.as_deref().map(|views| list_of_beams(views, &about)).transpose()?;
    let mut arguments = request.server_arguments();
    if let Some(list) = &list {
        arguments.extend(["--beams".into(), list.path().into()]);
    }
    let mut server = tokio::select! {
        server = LocalServer::start(program, &arguments) => server?,
        // The server ends with its standard input.
        () = shutdown.wait() => return Ok(None),
    };
    if let Some(outside) = &server.outside {
        invite(outside);
    }
    let mut worker = KeptWorker::start(program, server.address, request.threads, NICE, *quiet)?;
    let failed = tokio::select! {
        ended = server.process.wait() => ended.err(),
        // After Ctrl-C, the server stores everything and reports what it has.
        () = shutdown.wait() => None,
        error = worker.keep() => Some(error),
    };
    let ended = server.process.end().await;
    worker.end().await;
    if let Some(error) = failed {
        return Err(error);
    }
    ended?;
    Ok(server.summary.await?)
}

/// Writes the list of the beams that the views in a file see. The list lasts as long as the result.
fn list_of_beams(views: &Path, about: &HolodeckDescription) -> Result<NamedTempFile> {
    let beams = seen_beams(views, about)?;
    let mut file = NamedTempFile::new().context("making a temporary file")?;
    write!(file, "{beams}").and_then(|()| file.flush()).context("writing a temporary file")?;
    Ok(file)
}
