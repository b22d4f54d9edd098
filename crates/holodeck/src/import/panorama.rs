//! A captured picture: its colours, its depths, and the rays of its pixels.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_picture::{Picture, View};
use holo_server::CapturedRay;
use serde::{Deserialize, Serialize};

use crate::import::camera::{DepthAlong, PanoramaCamera, PixelRay, Projection};

/// Stands for the name of a face in the names of a cube's files.
const FACE: &str = "{face}";

/// The faces of a cube, in their order from the left.
const FACES: [&str; 6] = ["right", "left", "up", "down", "front", "back"];

/// Where and how one picture was taken.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanoramaSource {
    /// The picture of radiances.
    #[serde(alias = "color")]
    pub colour: PathBuf,
    /// The picture of depths.
    pub depth: PathBuf,
    /// The eye, scene units.
    pub vp: Option<[f64; 3]>,
    /// The direction of the picture's middle.
    pub vd: Option<[f64; 3]>,
    /// Up in the picture. `None`: the up axis.
    pub vu: Option<[f64; 3]>,
    /// How it shows directions. `None`: by its view or its shape.
    pub projection: Option<Projection>,
}

/// The meaning of depths of all pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthMeaning {
    /// What they are measured along.
    pub along: DepthAlong,
    /// Scene units in a unit of depth.
    pub scale: f64,
    /// Depth from which on a pixel shows the sky, in units of depth.
    pub sky: f64,
}

impl Default for DepthMeaning {
    fn default() -> DepthMeaning {
        DepthMeaning { along: DepthAlong::Ray, scale: 1.0, sky: f64::INFINITY }
    }
}

/// Counts of a picture's pixels by what they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PixelCounts {
    /// Pixels with a ray, a radiance and a distance.
    pub used: u64,
    /// Those of them that show the sky.
    pub sky: u64,
    /// Pixels whose depth is 0, negative or no number.
    pub without_depth: u64,
    /// Pixels whose colour is negative, infinite or no number.
    pub without_colour: u64,
}

/// A captured picture in memory.
pub struct Panorama {
    /// Its colours.
    pub colours: Picture,
    depths: Picture,
    camera: PanoramaCamera,
    meaning: DepthMeaning,
}

impl Panorama {
    /// Reads a picture. `up` is the up axis.
    ///
    /// # Errors
    /// If a file cannot be read, the sizes differ, or it is not known where the picture was taken.
    pub fn read(source: &PanoramaSource, up: DVec3, meaning: DepthMeaning) -> Result<Panorama> {
        let (colours, depths) = (read(&source.colour)?, read(&source.depth)?);
        let names = (source.colour.display(), source.depth.display());
        let ((width, height), (depth_width, depth_height)) = (colours.size(), depths.size());
        ensure!(
            colours.size() == depths.size(),
            "{} has {depth_width}x{depth_height} pixels, and {} has {width}x{height}: each pixel \
             needs its depth",
            names.1,
            names.0
        );
        let camera = camera(source, &colours, up).with_context(|| names.0.to_string())?;
        ensure!(
            meaning.along == DepthAlong::Ray || camera.projection() != Projection::Equirectangular,
            "{}: an equirectangular panorama has no axis along which depths could be",
            names.0
        );
        Ok(Panorama { colours, depths, camera, meaning })
    }

    /// Returns where it was taken.
    pub fn camera(&self) -> &PanoramaCamera {
        &self.camera
    }

    /// Calls `each` with the rays of all pixels that have one, in their order. Counts all pixels.
    pub fn for_each_ray(&self, each: &mut dyn FnMut(CapturedRay)) -> PixelCounts {
        let mut counts = PixelCounts::default();
        let width = self.colours.width;
        let pixels = self.colours.pixels.iter().zip(&self.depths.pixels);
        for (at, (&radiance, &[depth, _, _])) in (0..).zip(pixels) {
            let (column, row): (u32, u32) = (at % width, at / width);
            let Some(ray) = self.camera.ray(column, row) else { continue };
            let Some(distance) = self.distance(&ray, f64::from(depth)) else {
                counts.without_depth += 1;
                continue;
            };
            if !radiance.iter().all(|channel| channel.is_finite() && *channel >= 0.0) {
                counts.without_colour += 1;
                continue;
            }
            counts.used += 1;
            counts.sky += u64::from(distance.is_infinite());
            let PixelRay { eye, direction, .. } = ray;
            each(CapturedRay { eye, direction, distance, radiance });
        }
        counts
    }

    /// Returns the distance along a ray, scene units; `None` if the depth is none.
    fn distance(&self, ray: &PixelRay, depth: f64) -> Option<f64> {
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        if depth >= self.meaning.sky {
            return Some(f64::INFINITY);
        }
        let cosine = match self.meaning.along {
            DepthAlong::Ray => 1.0,
            DepthAlong::Axis => ray.cosine.filter(|cosine| *cosine > 0.0)?,
        };
        Some(depth * self.meaning.scale / cosine)
    }
}

/// Returns the camera by what is stated for a picture, or else by what the picture states.
fn camera(source: &PanoramaSource, picture: &Picture, up: DVec3) -> Result<PanoramaCamera> {
    let is_stated = source.vp.is_some() || source.vd.is_some() || source.vu.is_some();
    let projection = match (source.projection, &picture.view) {
        (Some(projection), _) => projection,
        (None, Some(_)) if !is_stated => Projection::View,
        (None, _) => PanoramaCamera::guess(picture.size())?,
    };
    if projection == Projection::View {
        ensure!(!is_stated, "its own view says where it was taken: leave out vp, vd and vu");
        let view = picture.view.context("it states no view: say where it was taken")?;
        return PanoramaCamera::new(projection, view, picture.size());
    }
    let (Some(vp), Some(vd)) = (source.vp, source.vd) else {
        bail!("say where it was taken: vp, the eye, and vd, the direction of its middle");
    };
    let vu = source.vu.map_or(up, DVec3::from_array);
    let view = View::new(vp.into(), vd.into(), vu, Some(90.0), None, (1, 1))?;
    PanoramaCamera::new(projection, view, picture.size())
}

/// Reads a picture. A name with `{face}` stands for the six faces of a cube.
fn read(path: &Path) -> Result<Picture> {
    let pattern = path.to_str().filter(|name| name.contains(FACE));
    let Some(pattern) = pattern else { return Ok(Picture::read(path)?) };
    let face = |name: &&str| {
        let path = pattern.replace(FACE, name);
        let face = Picture::read(&path)?;
        let (width, height) = face.size();
        ensure!(
            width == height,
            "{path} has {width}x{height} pixels: the face of a cube is square"
        );
        Ok(face)
    };
    let faces = FACES.iter().map(face).collect::<Result<Vec<Picture>>>()?;
    let side = faces[0].width;
    if let Some((name, face)) = FACES.iter().zip(&faces).find(|(_, face)| face.width != side) {
        bail!(
            "{pattern}: the face `{name}` has {0}x{0} pixels, and `{1}` has {side}x{side}",
            face.width,
            FACES[0]
        );
    }
    let row = |row: usize| {
        let columns = row * side as usize..(row + 1) * side as usize;
        faces.iter().flat_map(move |face| face.pixels[columns.clone()].iter().copied())
    };
    let pixels = (0..side as usize).flat_map(row).collect();
    Ok(Picture::from_pixels(6 * side, side, pixels)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes a picture of one colour.
    fn write(path: &Path, size: (u32, u32), value: f32) {
        let picture = Picture {
            pixels: vec![[value; 3]; (size.0 * size.1) as usize],
            ..Picture::new(size.0, size.1)
        };
        picture.write(path).unwrap();
    }

    fn source(folder: &Path) -> PanoramaSource {
        PanoramaSource {
            colour: folder.join("colour.exr"),
            depth: folder.join("depth.pfm"),
            vp: Some([1.0, 2.0, 3.0]),
            vd: Some([0.0, 1.0, 0.0]),
            ..PanoramaSource::default()
        }
    }

    fn panorama(source: &PanoramaSource, meaning: DepthMeaning) -> Result<Panorama> {
        Panorama::read(source, DVec3::Z, meaning)
    }

    fn rays(panorama: &Panorama) -> (Vec<CapturedRay>, PixelCounts) {
        let mut rays = Vec::new();
        let counts = panorama.for_each_ray(&mut |ray| rays.push(ray));
        (rays, counts)
    }

    #[test]
    fn pixels_without_a_depth_or_a_colour_are_left_out_and_infinite_ones_are_sky() {
        let folder = tempfile::tempdir().unwrap();
        let source = source(folder.path());
        write(&source.colour, (8, 4), 2.0);
        let mut colours = Picture::read(&source.colour).unwrap();
        colours.pixels[0] = [1.0, f32::NAN, 0.0];
        colours.pixels[1] = [1.0, f32::INFINITY, 0.0];
        colours.pixels[2] = [1.0, -0.5, 0.0];
        colours.write(&source.colour).unwrap();
        let mut depths = Picture { pixels: vec![[2.5; 3]; 32], ..Picture::new(8, 4) };
        for (pixel, depth) in
            [(10, f32::NAN), (11, 0.0), (12, -1.0), (13, f32::INFINITY), (14, 1e10), (15, 99.0)]
        {
            depths.pixels[pixel] = [depth; 3];
        }
        depths.write(&source.depth).unwrap();
        let meaning = DepthMeaning { scale: 2.0, sky: 1e10, ..DepthMeaning::default() };
        let (rays, counts) = rays(&panorama(&source, meaning).unwrap());
        let expected = PixelCounts { used: 26, sky: 2, without_depth: 3, without_colour: 3 };
        assert_eq!(counts, expected);
        assert_eq!(rays.len(), 26);
        // The fourth pixel is the first one that is used.
        assert_eq!((rays[0].distance, rays[0].radiance), (5.0, [2.0; 3]));
        let far: Vec<f64> = rays.iter().map(|ray| ray.distance).filter(|d| *d > 5.0).collect();
        assert_eq!(far, [f64::INFINITY, f64::INFINITY, 198.0]);
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_the_file_and_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let good = source(folder.path());
        let refused = |source: &PanoramaSource, meaning| {
            format!("{:#}", panorama(source, meaning).err().expect("it is refused"))
        };
        let usual = DepthMeaning::default();
        let said = refused(&good, usual);
        assert!(said.contains("colour.exr"), "{said}");
        write(&good.colour, (8, 4), 1.0);
        write(&good.depth, (8, 3), 1.0);
        let said = refused(&good, usual);
        assert!(said.contains("8x3") && said.contains("8x4"), "{said}");
        write(&good.depth, (8, 4), 1.0);
        assert!(panorama(&good, usual).is_ok());
        let bytes = std::fs::read(&good.depth).unwrap();
        std::fs::write(&good.depth, &bytes[..bytes.len() - 7]).unwrap();
        let said = refused(&good, usual);
        assert!(said.contains("depth.pfm") && said.contains("ends within its pixels"), "{said}");
        std::fs::write(&good.depth, bytes).unwrap();
        let said = refused(&PanoramaSource { vp: None, ..good.clone() }, usual);
        assert!(said.contains("colour.exr") && said.contains("where it was taken"), "{said}");
        let said = refused(&PanoramaSource { vd: Some([0.0; 3]), ..good.clone() }, usual);
        assert!(said.contains("-vd has length zero"), "{said}");
        let said = refused(&PanoramaSource { vp: Some([f64::NAN; 3]), ..good.clone() }, usual);
        assert!(said.contains("finite"), "{said}");
        let along = DepthMeaning { along: DepthAlong::Axis, ..usual };
        assert!(refused(&good, along).contains("no axis"));
        let view = PanoramaSource { projection: Some(Projection::View), ..good.clone() };
        assert!(refused(&view, usual).contains("leave out"));
        let view = PanoramaSource { vp: None, vd: None, ..view };
        assert!(refused(&view, usual).contains("states no view"));
    }

    #[test]
    fn six_files_are_a_cube_and_depths_along_its_axes_become_distances() {
        let folder = tempfile::tempdir().unwrap();
        let named = |name: &str| folder.path().join(name);
        for (face, name) in (1_u8..).zip(FACES) {
            write(&named(&format!("c-{name}.exr")), (5, 5), f32::from(face));
            write(&named(&format!("d-{name}.exr")), (5, 5), 3.0);
        }
        let source = PanoramaSource {
            colour: named("c-{face}.exr"),
            depth: named("d-{face}.exr"),
            ..source(folder.path())
        };
        let along = DepthMeaning { along: DepthAlong::Axis, ..DepthMeaning::default() };
        let (rays, counts) = rays(&panorama(&source, along).unwrap());
        assert_eq!(counts.used, 150);
        for ray in rays {
            // The walls of a cube with edges of 6 units, of which each has its own colour.
            let end = ray.direction * ray.distance;
            assert!((end.abs().max_element() - 3.0).abs() < 1e-9, "{end}");
            let face = match end.to_array().map(|c| (c / 2.9999) as i32) {
                [1, 0, 0] => 1.0,
                [-1, 0, 0] => 2.0,
                [0, 0, 1] => 3.0,
                [0, 0, -1] => 4.0,
                [0, 1, 0] => 5.0,
                _ => 6.0,
            };
            assert_eq!(ray.radiance, [face; 3], "{end}");
        }
        write(&named("c-back.exr"), (4, 4), 1.0);
        let said = format!("{:#}", panorama(&source, along).err().unwrap());
        assert!(said.contains("`back` has 4x4"), "{said}");
        std::fs::remove_file(named("c-up.exr")).unwrap();
        let said = format!("{:#}", panorama(&source, along).err().unwrap());
        assert!(said.contains("c-up.exr"), "{said}");
    }

    #[test]
    fn a_picture_that_states_its_view_says_where_it_was_taken() {
        let folder = tempfile::tempdir().unwrap();
        let source = PanoramaSource { vp: None, vd: None, ..source(folder.path()) };
        let (size, eye) = ((12, 8), DVec3::new(1.0, 2.0, 3.0));
        let view = View::new(eye, DVec3::X, DVec3::Z, Some(60.0), None, size).unwrap();
        let pixels = vec![[1.0; 3]; 96];
        let picture = Picture { view: Some(view), pixels, ..Picture::new(size.0, size.1) };
        picture.write(&source.colour).unwrap();
        write(&source.depth, size, 2.0);
        let (rays, _) = rays(&panorama(&source, DepthMeaning::default()).unwrap());
        let (x, y) = View::pixel_centre(size, 3, 1);
        assert!(rays[15].direction.distance(view.ray(x, y).1) < 1e-9);
        assert_eq!((rays[15].eye, rays[15].distance), (eye, 2.0));
    }
}
