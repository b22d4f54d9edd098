//! Control messages: few, small, and encoded by bincode. No other module uses bincode, for the
//! reason in `deny.toml`.

use std::fmt;

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use holo_section::SectionSpec;
use serde::{Deserialize, Serialize};

use crate::{
    ProtoError,
    frame::{FrameKind, MAX_CONTROL_BYTES},
    printable,
    report::StatusReport,
};

/// Most sections in one holodeck: enough for the rooms of a large building.
pub const MAX_SECTIONS: usize = 1024;

/// Most named views in one holodeck.
pub const MAX_VIEWS: usize = 256;

/// Most bytes of a view's name.
pub const MAX_VIEW_NAME: usize = 60;

/// Most bytes of a view's options.
pub const MAX_VIEW_OPTIONS: usize = 512;

/// Most samples that a display requests in one part. A part delays the samples of a new view.
pub const MAX_PART: u32 = 1 << 18;

/// The method by which workers compute a ray's radiance and distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Engine {
    /// Unbiased path tracing.
    Path,
    /// Paths that end in shared cells of surface light.
    Gather,
    /// None: the rays are pixels of pictures with distances, and nothing is traced.
    Captured,
}

impl Engine {
    /// Returns its name, as in options and files.
    pub fn name(self) -> &'static str {
        match self {
            Engine::Path => "path",
            Engine::Gather => "gather",
            Engine::Captured => "captured",
        }
    }
}

/// Everything that determines a sample's radiance, except the scene itself.
///
/// The file stores it, because a holodeck is compared with pictures that were rendered with the
/// same settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// The engine that traces.
    pub engine: Engine,
    /// Most indirect bounces: 0 gives direct light only, `None` is no limit. Specular reflection
    /// and transmission do not count.
    pub bounces: Option<u32>,
    /// Paths averaged into one sample.
    pub paths_per_sample: u16,
    /// Seed that makes the random numbers of two files different.
    pub seed: u64,
    /// True if the distance in flat mirrors and flat glass is that of the surface that they show,
    /// along the straightened ray (Larson & Simmons 1999, §2.3, `VDISTANCE`). Otherwise it is that
    /// of the mirror or glass. Absent in older files: false.
    #[serde(default)]
    pub virtual_distance: bool,
}

impl Default for RenderSettings {
    /// Returns unbiased paths without a limit of bounces, one for each sample.
    fn default() -> RenderSettings {
        RenderSettings {
            engine: Engine::Path,
            bounces: None,
            paths_per_sample: 1,
            seed: 0,
            virtual_distance: false,
        }
    }
}

/// The hash and length of a packed scene. Workers fetch a scene once and cache it by its hash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneInfo {
    /// BLAKE3 of the packed scene.
    pub hash: [u8; 32],
    /// Its length, bytes.
    pub bytes: u64,
}

/// A description of the holodeck, for an accepted peer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// The server's name and version, for people.
    pub software: String,
    /// The sections, in the order of their numbers.
    pub sections: Vec<SectionSpec>,
    /// The settings of samples.
    pub settings: RenderSettings,
    /// The scene.
    pub scene: SceneInfo,
    /// The scene's up axis, for views that do not state one.
    pub up: [f64; 3],
    /// Named views, as Radiance view options. A display begins with the first.
    pub views: Vec<(String, String)>,
    /// Samples in the file.
    pub samples: u64,
    /// False if the file is only shown, and nothing is traced.
    pub tracing: bool,
    /// Radiance of rays that hit nothing, W·sr⁻¹·m⁻².
    pub sky: [f32; 3],
    /// True if that is only a mean: the scene describes the sky.
    pub sky_varies: bool,
    /// True if workers search for beams that see nothing, and do not trace them.
    pub skip_unseen: bool,
    /// Metres per scene unit, positive. It determines the walking speed.
    pub unit: f64,
}

/// Figures of the server, sent about twice a second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Samples in the file and in memory.
    pub samples: u64,
    /// Samples per second from workers, over the last few seconds.
    pub samples_per_second: f64,
    /// Workers connected.
    pub workers: u32,
    /// Displays connected.
    pub displays: u32,
}

impl Status {
    /// Returns the figures in words, such as `1.20 M samples, 350.0 k/s, 2 workers`.
    pub fn words(&self) -> String {
        let workers = if self.workers == 1 {
            "1 worker".to_owned()
        } else {
            format!("{} workers", self.workers)
        };
        format!(
            "{} samples, {}/s, {workers}",
            short(self.samples as f64),
            short(self.samples_per_second)
        )
    }
}

/// Returns a count with three digits and a unit.
fn short(count: f64) -> String {
    match count {
        _ if count >= 1e9 => format!("{:.2} G", count / 1e9),
        _ if count >= 1e6 => format!("{:.2} M", count / 1e6),
        _ if count >= 1e3 => format!("{:.1} k", count / 1e3),
        _ => format!("{count:.0}"),
    }
}

/// The reason why a server ends a connection.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Farewell {
    /// The server ends in order.
    SessionOver,
    /// The peer broke the rules, or may no longer be there.
    Dropped {
        /// The violation, for people.
        reason: String,
    },
    /// The server ends, and another one takes its place: the peer may connect again.
    StartsAgain,
}

impl fmt::Display for Farewell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Farewell::SessionOver => "the session is over",
            Farewell::Dropped { reason } => reason,
            Farewell::StartsAgain => "the server starts again",
        })
    }
}

/// A control message, in either direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Control {
    /// Server: a description of the holodeck, right after the answer.
    Welcome(Box<Welcome>),
    /// Server to display: its figures.
    Status(Status),
    /// Server to display: all stored samples of this view's beams have been sent.
    StoredSent {
        /// The view's number, as the display gave it.
        view: u32,
    },
    /// Server to display: tracing for this view has stopped. All its samples are sent and on disk.
    Settled {
        /// The view's number.
        view: u32,
    },
    /// Server: leave.
    Bye(Farewell),
    /// Either direction: answer with `Pong` of the same number.
    Ping(u64),
    /// The answer to a `Ping`.
    Pong(u64),
    /// Worker or display: send the packed scene.
    SceneWanted,
    /// Worker: the scene is loaded, and packets may come.
    Ready {
        /// Number of threads that trace.
        threads: u16,
    },
    /// Worker: it cannot continue.
    Failed {
        /// The reason, for people.
        reason: String,
    },
    /// Display: stop tracing for this view, send all samples in progress, flush, then answer with
    /// `Settled`.
    Settle {
        /// The view's number.
        view: u32,
    },
    /// Worker: send the cells of surface light that others made, those that exist and all later
    /// estimates.
    CellsWanted,
    /// Server to display, before the requested scene or stand-ins: hash and length of the blob with
    /// the scene's stand-ins ([`crate::stand_ins`]). If stand-ins were requested and there are none,
    /// the length is 0 and no pieces follow.
    StandIns(SceneInfo),
    /// Display: send the stand-ins, in pieces as for the scene.
    StandInsWanted,
    /// Display: store a view in the file, in place of one with the same name.
    KeepView {
        /// Its name: 1 to [`MAX_VIEW_NAME`] bytes.
        name: String,
        /// The view, as Radiance's options, at most [`MAX_VIEW_OPTIONS`] bytes. Empty: remove the
        /// view of this name.
        options: String,
    },
    /// Server to display: all named views, after one was stored or removed.
    Views(Vec<(String, String)>),
    /// Server to display: a request was refused.
    Refused {
        /// The reason, for people.
        reason: String,
    },
    /// Administrator: send a report on the server's state.
    ReportWanted,
    /// Server to administrator: the report.
    Report(Box<StatusReport>),
    /// Display: send stored samples without a view. A display loads a whole file in such parts.
    PartWanted {
        /// The section whose beams are sent.
        section: u16,
        /// The number of the first beam.
        first: u64,
        /// About how many samples to send, at most [`MAX_PART`].
        samples: u32,
        /// True for the samples that the file held when the display last settled, and no later
        /// ones. So a display is done in time, however fast the file grows.
        as_settled: bool,
    },
    /// Server to display: all samples of the requested part have been sent.
    PartSent {
        /// The section.
        section: u16,
        /// The number of the next beam; `None` after the section's last one.
        next: Option<u64>,
    },
    /// Worker: from now on, its samples and cells may have surface light of this maker in them.
    CellsUsed {
        /// The maker, as the file numbers makers.
        maker: u16,
    },
}

type Wire = Configuration<LittleEndian, Fixint, Limit<{ MAX_CONTROL_BYTES as usize }>>;

fn wire() -> Wire {
    bincode::config::standard()
        .with_fixed_int_encoding()
        .with_limit::<{ MAX_CONTROL_BYTES as usize }>()
}

impl Control {
    /// Returns the payload of a control frame.
    ///
    /// # Errors
    /// [`ProtoError::TooLong`] if the message is longer than a control message may be.
    pub fn encode(&self) -> Result<Vec<u8>, ProtoError> {
        let bytes = bincode::serde::encode_to_vec(self, wire())
            .map_err(|e| ProtoError::Control(e.to_string()))?;
        // bincode applies its limit to decoding only.
        let length = bytes.len() as u64;
        if length > MAX_CONTROL_BYTES {
            return Err(ProtoError::TooLong {
                kind: FrameKind::Control,
                length,
                limit: MAX_CONTROL_BYTES,
            });
        }
        Ok(bytes)
    }

    /// Parses the payload of a control frame. Control characters in texts become spaces. It does
    /// not check whether sections are valid.
    ///
    /// # Errors
    /// [`ProtoError::Control`], [`ProtoError::Trailing`], [`ProtoError::TooMany`] sections, or
    /// [`ProtoError::Number`].
    pub fn decode(bytes: &[u8]) -> Result<Control, ProtoError> {
        let (mut message, used) = bincode::serde::decode_from_slice::<Control, _>(bytes, wire())
            .map_err(|error| ProtoError::Control(error.to_string()))?;
        if used != bytes.len() {
            return Err(ProtoError::Trailing(bytes.len() - used));
        }
        match &mut message {
            Control::Welcome(welcome) => welcome.check()?,
            Control::Report(report) => report.clean(),
            Control::Bye(Farewell::Dropped { reason })
            | Control::Failed { reason }
            | Control::Refused { reason } => *reason = printable(reason),
            Control::KeepView { name, options } => {
                (*name, *options) = (printable(name), printable(options));
                check_view(name, options)?;
            }
            Control::PartWanted { samples, .. } if *samples > MAX_PART => {
                return Err(ProtoError::TooMany {
                    what: "samples in a part",
                    found: u64::from(*samples),
                    limit: u64::from(MAX_PART),
                });
            }
            Control::Views(views) => {
                if views.len() > MAX_VIEWS {
                    let (found, limit) = (views.len() as u64, MAX_VIEWS as u64);
                    return Err(ProtoError::TooMany { what: "views", found, limit });
                }
                for text in views.iter_mut().flat_map(|(name, options)| [name, options]) {
                    *text = printable(text);
                }
            }
            _ => {}
        }
        Ok(message)
    }
}

/// Checks the lengths of a view's name and options.
fn check_view(name: &str, options: &str) -> Result<(), ProtoError> {
    if !(1..=MAX_VIEW_NAME).contains(&name.len()) {
        return Err(ProtoError::Number("the length of a view's name"));
    }
    if options.len() > MAX_VIEW_OPTIONS {
        return Err(ProtoError::Number("the length of a view's options"));
    }
    Ok(())
}

impl Welcome {
    fn check(&mut self) -> Result<(), ProtoError> {
        let found = self.sections.len();
        if found > MAX_SECTIONS {
            let (found, limit) = (found as u64, MAX_SECTIONS as u64);
            return Err(ProtoError::TooMany { what: "sections", found, limit });
        }
        if found == 0 {
            return Err(ProtoError::Number("the number of sections"));
        }
        if !self.up.iter().all(|x| x.is_finite()) || self.up == [0.0; 3] {
            return Err(ProtoError::Number("the up axis"));
        }
        if self.settings.paths_per_sample == 0 {
            return Err(ProtoError::Number("the number of paths per sample"));
        }
        if !self.sky.iter().all(|radiance| radiance.is_finite() && *radiance >= 0.0) {
            return Err(ProtoError::Number("the sky's radiance"));
        }
        if !(self.unit.is_finite() && self.unit > 0.0) {
            return Err(ProtoError::Number("the length of a scene unit"));
        }
        let texts = self.views.iter_mut().flat_map(|(name, options)| [name, options]);
        for text in texts.chain([&mut self.software]) {
            *text = printable(text);
        }
        Ok(())
    }
}
