//! Options that choose the view.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use holo_picture::ViewSpec;

/// The view to show. The options have Radiance's names.
#[derive(Args, Clone, Debug, Default)]
pub struct ViewArgs {
    /// Type of the view: v perspective, l parallel, c cylindrical panorama, a angular fisheye, h
    /// hemispherical fisheye [default: v]
    #[arg(long, value_name = "v|l|c|a|h")]
    pub vt: Option<String>,
    /// Eye: where the view is seen from
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub vp: Option<String>,
    /// Direction of the view
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub vd: Option<String>,
    /// Up in the picture [default: the scene's up axis]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub vu: Option<String>,
    /// Horizontal angle, degrees; width in scene units for a parallel view
    #[arg(long, value_name = "DEGREES")]
    pub vh: Option<String>,
    /// Vertical angle, degrees, or height [default: follows from --vh and the picture's shape]
    #[arg(long, value_name = "DEGREES")]
    pub vv: Option<String>,
    /// Shift of the picture to the right, in its widths [default: 0]
    #[arg(long, value_name = "WIDTHS", allow_hyphen_values = true)]
    pub vs: Option<String>,
    /// Lift of the picture, in its heights [default: 0]
    #[arg(long, value_name = "HEIGHTS", allow_hyphen_values = true)]
    pub vl: Option<String>,
    /// Fore clipping distance, scene units: what is nearer is not shown [default: 0, none]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    pub vo: Option<String>,
    /// Aft clipping distance, scene units: what is farther is black [default: 0, none]
    #[arg(long, value_name = "LENGTH")]
    pub va: Option<String>,
    /// A Radiance view file, or a picture that states its view (.hdr .exr); the other options
    /// override it
    #[arg(long, value_name = "FILE")]
    pub vf: Option<PathBuf>,
    /// A view that the holodeck knows by name
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Size of the picture, pixels [default: 640x480; of a window 1280x720]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
}

/// Default size of a picture, pixels.
const SIZE: (u32, u32) = (640, 480);

impl ViewArgs {
    /// Returns the size of the picture, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size.unwrap_or(SIZE)
    }

    /// Returns the view that the options describe. They override a named view and a view file.
    ///
    /// # Errors
    /// If an option is malformed, the file cannot be read, or the name is not known.
    pub fn spec(&self, named: &[(String, String)]) -> Result<ViewSpec> {
        let mut spec = ViewSpec::default();
        if let Some(name) = &self.view {
            let known =
                || named.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            let view = named.iter().find(|(other, _)| other == name);
            let (_, line) =
                view.with_context(|| format!("no view is named `{name}` (known: {})", known()))?;
            spec.apply_line(line).with_context(|| format!("view `{name}`"))?;
        }
        if let Some(path) = &self.vf {
            spec = spec.overridden_by(&holo_picture::View::read_vf(path)?);
        }
        let mut said = ViewSpec::default();
        let (where_to, sides) = (
            [("vp", &self.vp), ("vd", &self.vd), ("vu", &self.vu)],
            [("vh", &self.vh), ("vv", &self.vv)],
        );
        let others = [
            ("vt", &self.vt),
            ("vs", &self.vs),
            ("vl", &self.vl),
            ("vo", &self.vo),
            ("va", &self.va),
        ];
        for (name, value) in where_to.into_iter().chain(sides).chain(others) {
            if let Some(value) = value {
                said.apply_option(name, value)?;
            }
        }
        Ok(spec.overridden_by(&said))
    }
}

/// Parses a size such as `640x480`.
///
/// # Errors
/// A text for the user, if the text is not a size or no picture can be so large.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let size = text
        .split_once('x')
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let (width, height) = size.ok_or_else(|| format!("`{text}` is not a size; write 640x480"))?;
    holo_picture::Picture::check_size(width, height).map_err(|error| error.to_string())?;
    Ok((width, height))
}
