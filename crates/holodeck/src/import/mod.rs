//! Makes a holodeck of captured pictures: each pixel of a panorama with depths is a stored ray
//! (Larson & Simmons 1999, §4).
//!
//! Invariants:
//! - All pictures are read before the file is made, so that a fault in one leaves no file.
//! - One picture is in memory at a time.

mod camera;
mod extent;
mod list;
mod panorama;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use glam::DVec3;
use holo_picture::{Look, Picture, ViewKind};
use holo_proto::control::{Engine, MAX_VIEWS, RenderSettings};
use holo_server::{CapturedCounts, Holodeck, HolodeckDescription};
use serde::Serialize;

pub use camera::{DepthAlong, Projection};
pub use list::{ImportList, MAX_PANORAMAS};
pub use panorama::{PanoramaSource, PixelCounts};

use crate::{
    config::HolodeckConfig,
    import::{extent::RayExtent, panorama::Panorama},
    prepare::spec,
};

/// Most rays of all pictures by which a section is chosen.
const EXTENT_RAYS: u64 = 2_000_000;

/// Horizontal angle of the view that each panorama gives, degrees.
const ANGLE: f64 = 90.0;

/// Most bytes of a view's name, before a number that makes it different.
const MAX_NAME: usize = 50;

/// What became of one picture.
#[derive(Clone, Debug, Serialize)]
pub struct ImportedPanorama {
    /// Its colours.
    pub picture: PathBuf,
    /// Its pixels.
    #[serde(flatten)]
    pub pixels: PixelCounts,
    /// Its rays.
    #[serde(flatten)]
    pub rays: CapturedCounts,
}

/// What was imported.
#[derive(Clone, Debug, Serialize)]
pub struct ImportReport {
    /// The file.
    pub file: PathBuf,
    /// Its samples.
    pub samples: u64,
    /// The pictures.
    pub panoramas: Vec<ImportedPanorama>,
}

/// What the first reading of all pictures finds.
#[derive(Default)]
struct ImportSurvey {
    extent: RayExtent,
    views: Vec<(String, String)>,
    exposure: Option<f32>,
    /// Sum of the sky's radiance, and its pixels.
    sky: ([f64; 3], u64),
}

/// Makes the file `output` of captured pictures. Calls `progress` with the share that is done.
///
/// # Errors
/// If the file exists or cannot be written, a picture cannot be used, or no section stores any of
/// its rays.
pub fn import(
    list: &ImportList,
    output: &Path,
    progress: &mut dyn FnMut(f64),
) -> Result<ImportReport> {
    list.check()?;
    // It is found out again when the file is made, after all pictures were read.
    ensure!(!output.exists(), "{} exists already: name a new file", output.display());
    let up = list.up.map_or(DVec3::Z, |up| DVec3::from_array(up.0));
    let count = list.panorama.len() as f64;
    let mut survey = ImportSurvey::default();
    for (number, source) in list.panorama.iter().enumerate() {
        progress(number as f64 / (2.0 * count));
        survey.add(source, &read(list, source, up)?, list.panorama.len() as u64)?;
    }
    let about = describe(list, survey, up)?;
    let panoramas = Holodeck::capture(output, about, |file| {
        let sources = list.panorama.iter().enumerate();
        let stored = sources.map(|(number, source)| {
            progress(0.5 + number as f64 / (2.0 * count));
            store(file, source, &read(list, source, up)?)
        });
        stored.collect::<Result<Vec<_>>>()
    })?;
    let samples = panoramas.iter().map(|panorama| panorama.rays.stored).sum();
    Ok(ImportReport { file: output.to_owned(), samples, panoramas })
}

fn read(list: &ImportList, source: &PanoramaSource, up: DVec3) -> Result<Panorama> {
    let projection = source.projection.or(list.projection);
    Panorama::read(&PanoramaSource { projection, ..source.clone() }, up, list.meaning())
}

impl ImportSurvey {
    /// Adds one of `count` pictures.
    fn add(&mut self, source: &PanoramaSource, panorama: &Panorama, count: u64) -> Result<()> {
        let pixels = panorama.colours.pixels.len() as u64;
        let step = (pixels * count).div_ceil(EXTENT_RAYS).max(1);
        let mut number = 0;
        let used = panorama.for_each_ray(&mut |ray| {
            if number % step == 0 {
                self.extent.add(ray);
            }
            number += 1;
            if ray.distance.is_infinite() {
                let sums = self.sky.0.iter_mut().zip(ray.radiance);
                sums.for_each(|(sum, channel)| *sum += f64::from(channel));
                self.sky.1 += 1;
            }
        });
        let name = source.colour.display();
        ensure!(used.used > 0, "no pixel of {name} has both a colour and a depth");
        if self.exposure.is_none() {
            self.exposure = exposure(&panorama.colours);
        }
        if self.views.len() < MAX_VIEWS {
            self.views.push((self.view_name(&source.colour), view_options(panorama)));
        }
        Ok(())
    }

    /// Returns a name for the view of a picture that no view has yet.
    fn view_name(&self, picture: &Path) -> String {
        let stem = picture.file_stem().unwrap_or_default().to_string_lossy();
        let end = stem.char_indices().map(|(at, c)| at + c.len_utf8());
        let end = end.take_while(|end| *end <= MAX_NAME).last().unwrap_or(0);
        let stem = stem[..end].to_owned();
        let numbered = (2..).map(|number: u32| format!("{stem} {number}"));
        let is_free = |name: &String| self.views.iter().all(|(known, _)| known != name);
        std::iter::once(stem.clone()).chain(numbered).find(is_free).unwrap_or_default()
    }
}

/// Returns a view from where a picture was taken, as Radiance options. A person begins with a
/// perspective one, whatever the picture's projection.
fn view_options(panorama: &Panorama) -> String {
    let (camera, view) = (panorama.camera(), panorama.camera().view());
    if camera.projection() == Projection::View && view.kind == ViewKind::Perspective {
        return view.to_vf_options();
    }
    let triple = |v: DVec3| format!("{} {} {}", v.x, v.y, v.z);
    format!("-vp {} -vd {} -vu {} -vh {ANGLE}", triple(view.vp), triple(view.vd), triple(view.vu))
}

/// Returns the factor from radiance to display light that suits a picture, if it has light.
fn exposure(picture: &Picture) -> Option<f32> {
    let usable = |channel: f32| if channel.is_finite() { channel.max(0.0) } else { 0.0 };
    let pixels = picture.pixels.iter().map(|pixel| pixel.map(usable)).collect::<Vec<_>>();
    let has_light = pixels.iter().flatten().any(|channel| *channel > 0.0);
    let usable = Picture { pixels, ..Picture::new(picture.width, picture.height) };
    Look::default().show(&usable).exposure.filter(|_| has_light)
}

/// Describes the file.
fn describe(list: &ImportList, survey: ImportSurvey, up: DVec3) -> Result<HolodeckDescription> {
    let ImportSurvey { extent, views, exposure, sky } = survey;
    let mut choices = Vec::new();
    let tables = match list.section.is_empty() {
        false => list.section.clone(),
        true => {
            let section = extent.section()?;
            choices.push(format!(
                "section: around the eyes and what they saw near them (--section \"{}\")",
                section.to_option()
            ));
            vec![section]
        }
    };
    let config = HolodeckConfig::default();
    let spec = |(index, table)| {
        spec(&config, None, table, index).with_context(|| format!("section {index}"))
    };
    let sections = tables.iter().enumerate().map(spec).collect::<Result<Vec<_>>>()?;
    let settings = RenderSettings { engine: Engine::Captured, ..RenderSettings::default() };
    let source = match list.panorama.as_slice() {
        [only] => only.colour.display().to_string(),
        all => format!("{} pictures", all.len()),
    };
    let mut about = HolodeckDescription::new(sections, settings, &[], source);
    about.up = up.to_array();
    about.unit = list.unit.map_or(1.0, |unit| unit.0);
    let (sums, pixels) = sky;
    about.sky = sums.map(|sum| (sum / (pixels as f64).max(1.0)) as f32);
    (about.views, about.exposure, about.choices) = (views, exposure, choices);
    Ok(about)
}

/// Stores the rays of a picture.
fn store(
    file: &Holodeck,
    source: &PanoramaSource,
    panorama: &Panorama,
) -> Result<ImportedPanorama> {
    let mut rays = Vec::with_capacity(panorama.colours.pixels.len());
    let pixels = panorama.for_each_ray(&mut |ray| rays.push(ray));
    let name = source.colour.display().to_string();
    let rays = file.store_captured(&name, rays)?;
    ensure!(rays.kept > 0, "no section stores any ray of {name}: state another (--section)");
    Ok(ImportedPanorama { picture: source.colour.clone(), pixels, rays })
}
