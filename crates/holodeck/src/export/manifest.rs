//! What a page of an export knows besides the splats: their header, views, rooms and colours.

use anyhow::Result;
use glam::DVec3;
use holo_picture::{Look, Picture, Scale, Scaling, ViewSpec};
use holo_section::Section;
use holo_server::Holodeck;
use holo_splats::SplatFile;
use serde::Serialize;

use super::{piece::Piece, surfaces::DrawnSurfaces};
use crate::splats::SplatReport;

/// Display light of a grey card of 18 %.
const KEY: f32 = 0.18;

/// The manifest, as the page reads it.
#[derive(Serialize)]
pub(super) struct Manifest<'a> {
    format: u32,
    title: String,
    nodes: u64,
    levels: Vec<u64>,
    origin: [f64; 3],
    centre: [f32; 3],
    radius: f32,
    peak: f32,
    spacing: f64,
    unit: f64,
    up: [f64; 3],
    sky: [f32; 3],
    exposure: f32,
    pub pieces: Vec<Piece>,
    /// The surfaces that the splats light; without them, splats are surfaces themselves.
    surfaces: Option<&'a DrawnSurfaces>,
    views: Vec<SiteView>,
    /// The floor of each section, as four corners.
    rooms: Vec<[[f64; 3]; 4]>,
    /// How the export differs from the holodeck.
    pub notes: Vec<String>,
    /// Colours of false-colour pictures, from the low end, as RRGGBB.
    colours: Vec<String>,
}

/// A view by name.
#[derive(Serialize)]
struct SiteView {
    name: String,
    vp: [f64; 3],
    vd: [f64; 3],
    vh: f64,
}

impl<'a> Manifest<'a> {
    pub fn new(
        holodeck: &Holodeck,
        splats: &SplatFile,
        report: &SplatReport,
        data: &[&[u8]],
    ) -> Result<Manifest<'a>> {
        let (about, header) = (&holodeck.about, splats.header());
        let pieces = data.iter().enumerate();
        let pieces = pieces.map(|(number, bytes)| Piece::new(format!("{number:05}"), bytes));
        let title = holodeck.path().file_stem().unwrap_or_default().to_string_lossy();
        let mean = splats.root()?.packed.disc().light.luminance(header.peak);
        let mut views: Vec<SiteView> = about.views.iter().filter_map(site_view).collect();
        if views.is_empty() {
            views.extend(holodeck.sections.first().map(|section| middle_view(section, about.up)));
        }
        Ok(Manifest {
            format: 1,
            title: title.into_owned(),
            nodes: header.nodes,
            levels: header.levels.clone(),
            origin: header.origin.to_array(),
            centre: header.sphere.centre.to_array(),
            radius: header.sphere.radius,
            peak: header.peak,
            spacing: header.spacing,
            unit: header.unit,
            up: header.up,
            sky: header.sky,
            exposure: about.exposure.unwrap_or(KEY / mean.max(f32::MIN_POSITIVE)),
            pieces: pieces.collect(),
            surfaces: None,
            views,
            rooms: holodeck.sections.iter().map(|section| floor(section, about.up)).collect(),
            notes: notes(report, about.unit),
            colours: colours()?,
        })
    }

    /// Adds the surfaces, or the reason why there are none.
    pub fn add_surfaces(&mut self, surfaces: Option<&'a DrawnSurfaces>, obstacle: Option<String>) {
        self.surfaces = surfaces;
        self.notes.extend(match (surfaces, obstacle) {
            (Some(surfaces), _) => surfaces.notes(),
            (None, Some(obstacle)) => vec![
                format!("Surfaces are drawn as splats, because {obstacle}: edges are blurred."),
                "Mirrors, glass and bare metal show the mean of their light over directions, as \
                 if painted."
                    .to_owned(),
            ],
            (None, None) => Vec::new(),
        });
    }

    /// Returns all pieces in the order of their data.
    pub fn all_pieces(&self) -> impl Iterator<Item = &Piece> {
        let surfaces = self.surfaces.into_iter().flat_map(DrawnSurfaces::all_pieces);
        self.pieces.iter().chain(surfaces)
    }
}

/// Returns a named view; `None` if its options are no view.
fn site_view((name, options): &(String, String)) -> Option<SiteView> {
    let mut spec = ViewSpec::default();
    spec.apply_line(options).ok()?;
    let (vp, vd) = (spec.vp?.to_array(), spec.vd?.to_array());
    Some(SiteView { name: name.clone(), vp, vd, vh: spec.vh.unwrap_or(60.0) })
}

/// Returns a view from the middle of a section, along its longest level axis.
fn middle_view(section: &Section, up: [f64; 3]) -> SiteView {
    let up = DVec3::from_array(up).normalize_or(DVec3::Z);
    let level = section.spec().axes.map(DVec3::from_array).map(|axis| axis - up * axis.dot(up));
    let longest = level.into_iter().max_by(|a, b| a.length().total_cmp(&b.length()));
    let vd = longest.unwrap_or(DVec3::X).normalize_or(up.any_orthonormal_vector());
    let vp = section.local_to_world(DVec3::splat(0.5));
    SiteView { name: "middle".into(), vp: vp.to_array(), vd: vd.to_array(), vh: 75.0 }
}

/// Returns the corners of a section's lowest wall, in order.
fn floor(section: &Section, up: [f64; 3]) -> [[f64; 3]; 4] {
    let up = DVec3::from_array(up);
    let axes = section.spec().axes.map(|axis| DVec3::from_array(axis).normalize_or_zero().dot(up));
    let upright = (0..3).max_by(|&a, &b| axes[a].abs().total_cmp(&axes[b].abs())).unwrap_or(2);
    let (u, v) = ((upright + 1) % 3, (upright + 2) % 3);
    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(a, b)| {
        let mut local = DVec3::ZERO;
        (local[u], local[v]) = (a, b);
        local[upright] = if axes[upright] < 0.0 { 1.0 } else { 0.0 };
        section.local_to_world(local).to_array()
    })
}

/// Returns how the export differs from the holodeck, for people.
fn notes(report: &SplatReport, unit: f64) -> Vec<String> {
    let mut notes = vec![
        format!(
            "{} splats, {:.1} mm apart, with the light of {} samples. Light with few samples is \
             smoothed along its surface; standard errors are those of the smoothed light.",
            report.surfels,
            1000.0 * report.spacing * unit,
            report.samples
        ),
        "Gleams on glossy surfaces are left out.".to_owned(),
        "Of the tones, soft and linear are here; camera and human are left out.".to_owned(),
    ];
    if report.unplaced > 0 {
        notes.push(format!("{} samples lie on no surface and are left out.", report.unplaced));
    }
    notes
}

/// Returns the colours of false-colour pictures: those of a picture whose luminance grows evenly.
fn colours() -> Result<Vec<String>> {
    let mut picture = Picture::new(256, 1);
    for (at, pixel) in (0_u16..).zip(&mut picture.pixels) {
        *pixel = [(f32::from(at) + 1.0) / holo_color::EFFICACY; 3];
    }
    let scaling = Scaling::Fixed(Scale::new(1.0, 256.0, false)?);
    let image = Look { false_color: true, scaling, ..Look::default() }.show(&picture);
    let pixels = image.rgb.chunks_exact(3);
    Ok(pixels.map(|rgb| rgb.iter().map(|byte| format!("{byte:02x}")).collect()).collect())
}
