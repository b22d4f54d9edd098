//! Finds the nodes of the hierarchy that a view shows.

use std::ops::AddAssign;

use glam::{DVec3, Mat3, Vec3};
use holo_display::Camera;
use holo_picture::Clip;
use holo_splats::{LightCode, SplatError, SplatFile, SplatNode};
use rayon::prelude::*;

/// Nodes from which on branches are followed on several threads.
const PARALLEL: usize = 512;

/// Least size of a sphere over its distance for which its middle does not stand for all of it.
const NEAR: f32 = 0.05;

/// A disc to draw, in camera coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DrawnSplat {
    pub centre: Vec3,
    pub normal: Vec3,
    pub radius: f32,
    pub light: LightCode,
    /// Where the picture shows its centre, pixels.
    pub place: (f32, f32),
    /// Its radius in the picture, pixels.
    pub reach: f32,
}

/// Nodes that a view does not show, and how many were visited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Culled {
    /// Nodes that were visited.
    pub visited: u64,
    /// Of these, nodes outside the picture.
    pub outside: u64,
    /// Of these, nodes that face away.
    pub facing_away: u64,
}

impl AddAssign for Culled {
    fn add_assign(&mut self, other: Culled) {
        self.visited += other.visited;
        self.outside += other.outside;
        self.facing_away += other.facing_away;
    }
}

/// The nodes that a view shows.
#[derive(Default)]
pub struct SplatCut {
    pub(crate) splats: Vec<DrawnSplat>,
    /// Counts of nodes.
    pub culled: Culled,
    /// The damage that was found.
    pub damage: Option<SplatError>,
}

impl SplatCut {
    /// Returns the number of splats to draw.
    pub fn len(&self) -> usize {
        self.splats.len()
    }

    /// Returns true if there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }

    fn extend(&mut self, other: SplatCut) {
        self.splats.extend(other.splats);
        self.culled += other.culled;
        self.damage = self.damage.take().or(other.damage);
    }
}

/// Goes down a hierarchy for one view.
pub struct Traversal<'a> {
    file: &'a SplatFile,
    camera: &'a Camera,
    size: (f32, f32),
    /// From the file's coordinates to those of the camera.
    rotation: Mat3,
    offset: Vec3,
    /// Diameter in pixels from which on a node's children are drawn in its place.
    finest: f32,
    /// Inward normals of the picture's edges, in a perspective view.
    edges: Option<[Vec3; 4]>,
    is_clipped: bool,
}

impl<'a> Traversal<'a> {
    /// Returns the traversal for a picture of `size` pixels. Nodes whose diameter is less than
    /// `finest` pixels are drawn, and their children are not.
    pub fn new(
        file: &'a SplatFile,
        camera: &'a Camera,
        size: (u32, u32),
        finest: f32,
        is_clipped: bool,
    ) -> Traversal<'a> {
        let axis = |vector: DVec3| camera.to_camera(vector).as_vec3();
        let rotation = Mat3::from_cols(axis(DVec3::X), axis(DVec3::Y), axis(DVec3::Z));
        let offset = camera.to_camera(file.header().origin - camera.eye).as_vec3();
        let size = (size.0 as f32, size.1 as f32);
        Traversal {
            file,
            camera,
            size,
            rotation,
            offset,
            finest,
            edges: camera.is_perspective().then(|| edges(camera, size)),
            is_clipped,
        }
    }

    /// Returns the nodes to draw. Their order does not depend on the number of threads.
    pub fn cut(&self) -> SplatCut {
        let mut cut = SplatCut::default();
        let mut open = match self.file.root() {
            Ok(root) => vec![root],
            Err(error) => return SplatCut { damage: Some(error), ..cut },
        };
        while !open.is_empty() && open.len() < PARALLEL {
            let mut below = Vec::with_capacity(4 * open.len());
            for node in open {
                self.visit(&node, &mut cut, &mut below);
            }
            open = below;
        }
        let branches = open.par_iter().map(|node| {
            let (mut cut, mut stack) = (SplatCut::default(), vec![*node]);
            while let Some(node) = stack.pop() {
                self.visit(&node, &mut cut, &mut stack);
            }
            cut
        });
        let branches: Vec<SplatCut> = branches.collect();
        branches.into_iter().for_each(|branch| cut.extend(branch));
        cut
    }

    /// Draws a node, leaves it out, or adds its children to `open`.
    fn visit(&self, node: &SplatNode, cut: &mut SplatCut, open: &mut Vec<SplatNode>) {
        cut.culled.visited += 1;
        let centre = self.rotation * node.sphere.centre + self.offset;
        let radius = node.sphere.radius;
        if self.is_outside(centre, radius) {
            cut.culled.outside += 1;
            return;
        }
        let disc = node.packed.disc();
        let normal = self.rotation * disc.normal;
        let sight = self.camera.sight(centre);
        let distance = sight.length();
        if self.faces_away(normal, disc.cone, sight, distance, radius) {
            cut.culled.facing_away += 1;
            return;
        }
        let pixel =
            self.camera.pixel_width.at(centre.normalize_or_zero() * (distance - radius).max(0.0));
        let is_fine = 2.0 * radius < self.finest * pixel;
        if node.packed.children() > 0 && !is_fine {
            match self.file.children(node) {
                Ok(children) => return open.extend(children),
                Err(error) => cut.damage = cut.damage.take().or(Some(error)),
            }
        }
        let Some(place) = self.camera.pixel(centre) else { return };
        if self.is_clipped && self.camera.clip(centre.as_dvec3()) != Clip::Shown {
            return;
        }
        let width = self.camera.pixel_width.at(centre).max(f32::MIN_POSITIVE);
        let reach = radius / width;
        cut.splats.push(DrawnSplat { centre, normal, radius, light: disc.light, place, reach });
    }

    /// Returns whether a sphere lies outside the picture.
    fn is_outside(&self, centre: Vec3, radius: f32) -> bool {
        if let Some(edges) = &self.edges {
            return edges.iter().any(|edge| edge.dot(centre) < -radius);
        }
        let distance = self.camera.sight(centre).length();
        if radius > NEAR * distance {
            return false;
        }
        let Some((x, y)) = self.camera.pixel(centre) else { return true };
        let margin = 4.0 * radius / self.camera.pixel_width.at(centre).max(f32::MIN_POSITIVE) + 2.0;
        x < -margin || y < -margin || x > self.size.0 + margin || y > self.size.1 + margin
    }

    /// Returns whether all surfaces in a sphere face away from the eye.
    fn faces_away(&self, normal: Vec3, cone: f32, sight: Vec3, distance: f32, radius: f32) -> bool {
        if cone >= 1.0 || distance <= radius {
            return false;
        }
        let spread = if self.camera.pixel_width.grows { (radius / distance).asin() } else { 0.0 };
        let turn = cone.asin() + spread;
        turn < std::f32::consts::FRAC_PI_2 && normal.dot(sight) > turn.sin() * distance
    }
}

/// Returns the inward normals of the planes through the eye and the picture's edges.
fn edges(camera: &Camera, size: (f32, f32)) -> [Vec3; 4] {
    let (focal, centre) = (camera.focal, camera.centre);
    let left = (-centre.0 / focal.0) as f32;
    let right = ((f64::from(size.0) - centre.0) / focal.0) as f32;
    let top = (centre.1 / focal.1) as f32;
    let bottom = ((centre.1 - f64::from(size.1)) / focal.1) as f32;
    [
        Vec3::new(1.0, 0.0, -left).normalize(),
        Vec3::new(-1.0, 0.0, right).normalize(),
        Vec3::new(0.0, -1.0, top).normalize(),
        Vec3::new(0.0, 1.0, -bottom).normalize(),
    ]
}
