//! The surfaces of a scene as the page draws them: quantised triangles with a colour each. The
//! splats light them.
//!
//! Triangles are in chunks that lie close together. A corner has three 16-bit coordinates in the
//! chunk's box and the number of a paint, 8 bytes. A triangle has the numbers of three corners, 6
//! bytes.

use std::collections::HashMap;

use glam::{DVec3, UVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Scene};
use serde::Serialize;

use super::piece::Piece;
use crate::splats::{drawn_colour, pane_transmittance};

/// Most triangles that are exported: up to 12 MB. Larger scenes are drawn by splats alone.
const MOST_TRIANGLES: u32 = 1_000_000;

/// Triangles of a chunk. Their corners have 16-bit numbers.
const CHUNK_TRIANGLES: usize = 8192;

const _: () = assert!(CHUNK_TRIANGLES * 3 <= 1 << 16);

/// Length from which a piece is full.
const PIECE_BYTES: usize = 1 << 19;

/// Most mirrors whose reflections are drawn, and the least area of one in square metres. Others
/// show the mean of their light.
const MIRRORS: (usize, f64) = (4, 0.05);

/// Most planes that are searched for mirrors.
const PLANES: usize = 64;

/// Greatest distance between the planes of one mirror, metres, and least cosine of their normals.
const SAME_PLANE: (f64, f64) = (0.002, 0.999_99);

/// Greatest quantised coordinate.
const FINEST: f32 = 65535.0;

/// Surfaces, as the page's manifest lists them.
#[derive(Serialize)]
pub(super) struct DrawnSurfaces {
    pub pieces: Vec<SurfacePiece>,
    paints: Vec<Paint>,
    mirrors: Vec<MirrorPlane>,
    /// Colours of the first splats, which are drawn before the surfaces have arrived.
    pub colours: Piece,
}

impl DrawnSurfaces {
    /// Returns all pieces in the order of their data.
    pub fn all_pieces(&self) -> impl Iterator<Item = &Piece> {
        self.pieces.iter().map(|piece| &piece.piece).chain([&self.colours])
    }

    /// Returns how surfaces differ from those of the scene, for people.
    pub fn notes(&self) -> Vec<String> {
        let chunks = self.pieces.iter().flat_map(|piece| &piece.chunks);
        let mirrors = match self.mirrors.len() {
            0 => "No mirror is large and flat enough to show a reflection.".to_owned(),
            1 => "One flat mirror shows the mirrored room.".to_owned(),
            count => format!("{count} flat mirrors show the mirrored room."),
        };
        let triangles: usize = chunks.map(|chunk| chunk.triangles).sum();
        vec![
            format!("{triangles} triangles are lit by the splats. Textures are as fine as these."),
            format!(
                "{mirrors} Other mirrors, solid glass and bare metal show the mean of their light \
                 over directions, as if painted. Panes of glass reflect nothing."
            ),
        ]
    }
}

/// A piece of triangles: chunks that follow each other.
#[derive(Serialize)]
pub(super) struct SurfacePiece {
    #[serde(flatten)]
    pub piece: Piece,
    chunks: Vec<SurfaceChunk>,
}

/// Triangles in a box.
#[derive(Serialize)]
struct SurfaceChunk {
    corners: usize,
    triangles: usize,
    /// The box's lowest corner, from the origin of the splats.
    low: [f32; 3],
    /// Size of a step of a coordinate.
    step: [f32; 3],
    is_glass: bool,
}

/// The look of a surface: red, green, blue, and the number of a mirror or -1.
#[derive(Clone, Copy, PartialEq, Serialize)]
struct Paint([f32; 3], i32);

/// A flat mirror: points p with p·normal = offset, from the origin of the splats, in a sphere.
#[derive(Clone, Copy, Serialize)]
struct MirrorPlane {
    normal: [f64; 3],
    offset: f64,
    centre: [f32; 3],
    radius: f32,
    #[serde(skip)]
    area: f64,
}

/// Returns why the surfaces of a scene are not drawn; `None` if they are.
pub(super) fn obstacle(scene: &Scene) -> Option<String> {
    let triangles = scene.triangles().len();
    let covers = scene.shading.as_ref().is_some_and(|shading| !shading.covers.is_empty());
    if triangles > MOST_TRIANGLES as usize {
        return Some(format!("the scene has {triangles} triangles, more than {MOST_TRIANGLES}"));
    }
    (scene.has_cut_outs() || covers).then(|| "the scene has surfaces with holes".to_owned())
}

/// Returns the surfaces of a scene and the bytes of their pieces, and last those of `colours`: the
/// colours of the first splats. `origin` is that of the splats, and `unit` has metres.
pub(super) fn drawn_surfaces(
    raycaster: &Raycaster,
    origin: DVec3,
    unit: f64,
    colours: &[[f32; 3]],
) -> (DrawnSurfaces, Vec<Vec<u8>>) {
    let scene = raycaster.scene();
    let offset = (scene.origin - origin).as_vec3();
    let mirrors = mirrors(scene, offset, unit);
    let mut paints = PaintTable::default();
    let mut open: Vec<(SurfacePiece, Vec<u8>)> = Vec::new();
    for (is_glass, triangles) in by_place(scene) {
        for triangles in triangles.chunks(CHUNK_TRIANGLES) {
            let paint = |triangle| paint(scene, triangle, offset, &mirrors, unit);
            let numbered =
                triangles.iter().map(|&triangle| (triangle, paints.number(paint(triangle))));
            let numbered: Vec<(u32, u16)> = numbered.collect();
            let (chunk, bytes) = chunk(scene, &numbered, offset, is_glass);
            match open.last_mut().filter(|(_, bytes)| bytes.len() < PIECE_BYTES) {
                Some((piece, all)) => {
                    piece.chunks.push(chunk);
                    all.extend(bytes);
                }
                None => {
                    open.push((
                        SurfacePiece { piece: Piece::default(), chunks: vec![chunk] },
                        bytes,
                    ));
                }
            }
        }
    }
    let mut data = Vec::with_capacity(open.len() + 1);
    let pieces = open.into_iter().enumerate().map(|(number, (mut piece, bytes))| {
        piece.piece = Piece::new(format!("surfaces-{number:03}"), &bytes);
        data.push(bytes);
        piece
    });
    let pieces = pieces.collect();
    let coded: Vec<u8> = colours.iter().flat_map(|&colour| coded(colour).to_le_bytes()).collect();
    let colours = Piece::new("colours".to_owned(), &coded);
    data.push(coded);
    (DrawnSurfaces { pieces, paints: paints.paints, mirrors, colours }, data)
}

/// Returns a colour as 5, 6 and 5 bits of the square root of each channel.
fn coded(colour: [f32; 3]) -> u16 {
    let [red, green, blue] = colour.map(|share| share.clamp(0.0, 1.0).sqrt());
    let bits = |share: f32, most: f32| (share * most).round() as u16;
    bits(red, 31.0) | bits(green, 63.0) << 5 | bits(blue, 31.0) << 11
}

/// Returns all triangles in the order of a curve through space: those of panes of glass last.
fn by_place(scene: &Scene) -> [(bool, Vec<u32>); 2] {
    let middle = |triangle: u32| scene.corners(triangle).iter().sum::<Vec3>() / 3.0;
    let (low, high) = scene
        .triangles()
        .map(middle)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| {
            (low.min(place), high.max(place))
        });
    let step = (high - low).max_element().max(f32::MIN_POSITIVE) / 1023.0;
    let place = |triangle: &u32| morton(((middle(*triangle) - low) / step).as_uvec3());
    let (mut glass, mut opaque): (Vec<u32>, Vec<u32>) =
        scene.triangles().partition(|&triangle| is_pane(scene, triangle));
    glass.sort_by_cached_key(place);
    opaque.sort_by_cached_key(place);
    [(false, opaque), (true, glass)]
}

/// Returns the place of a cell on the Z curve. Coordinates have 10 bits.
fn morton(cell: UVec3) -> u32 {
    let spread = |axis: u32| (0..10).fold(0, |bits, bit| bits | (axis >> bit & 1) << (3 * bit));
    spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}

fn is_pane(scene: &Scene, triangle: u32) -> bool {
    matches!(scene.material(triangle).bsdf, Bsdf::ThinGlass { .. })
}

/// Returns a chunk and its bytes.
fn chunk(
    scene: &Scene,
    triangles: &[(u32, u16)],
    offset: Vec3,
    is_glass: bool,
) -> (SurfaceChunk, Vec<u8>) {
    let corners = |triangle: u32| scene.corners(triangle).map(|corner| corner + offset);
    let all = triangles.iter().flat_map(|&(triangle, _)| corners(triangle));
    let (low, high) = all.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    let step = ((high - low) / FINEST).max(Vec3::splat(f32::MIN_POSITIVE));
    let mut numbers: HashMap<[u16; 4], u16> = HashMap::new();
    let (mut places, mut indices) = (Vec::new(), Vec::new());
    for &(triangle, paint) in triangles {
        for corner in corners(triangle) {
            let [x, y, z] = ((corner - low) / step).to_array().map(|axis| axis.round() as u16);
            let key = [x, y, z, paint];
            let next = numbers.len() as u16;
            let number = *numbers.entry(key).or_insert_with(|| {
                places.extend(key.iter().flat_map(|value| value.to_le_bytes()));
                next
            });
            indices.extend(number.to_le_bytes());
        }
    }
    let (low, step) = (low.to_array(), step.to_array());
    let facts =
        SurfaceChunk { corners: numbers.len(), triangles: triangles.len(), low, step, is_glass };
    places.extend(indices);
    (facts, places)
}

/// Paints and their numbers.
#[derive(Default)]
struct PaintTable {
    paints: Vec<Paint>,
    numbers: HashMap<([u32; 3], i32), u16>,
}

impl PaintTable {
    /// Returns the number of a paint. Once all numbers are used, paints are the last one.
    fn number(&mut self, paint: Paint) -> u16 {
        let key = (paint.0.map(f32::to_bits), paint.1);
        let next = self.paints.len().min(usize::from(u16::MAX)) as u16;
        let paints = &mut self.paints;
        *self.numbers.entry(key).or_insert_with(|| {
            if paints.len() <= usize::from(u16::MAX) {
                paints.push(paint);
            }
            next
        })
    }
}

/// Returns the look of a triangle.
fn paint(scene: &Scene, triangle: u32, offset: Vec3, mirrors: &[MirrorPlane], unit: f64) -> Paint {
    let surface = &scene.material(triangle).bsdf;
    // The page knows one colour of a pane: that of a look straight through.
    if let Some(share) = pane_transmittance(surface, 1.0) {
        return Paint(share.to_array(), -1);
    }
    match *surface {
        Bsdf::Mirror { ks } => {
            let plane = plane(scene, triangle, offset);
            match mirrors.iter().position(|mirror| is_same(mirror, &plane, unit)) {
                Some(mirror) => Paint(ks, mirror as i32),
                None => Paint([1.0; 3], -1),
            }
        }
        _ => Paint(drawn_colour(scene, triangle), -1),
    }
}

/// Returns the largest flat mirrors of a scene.
fn mirrors(scene: &Scene, offset: Vec3, unit: f64) -> Vec<MirrorPlane> {
    let mut planes: Vec<MirrorPlane> = Vec::new();
    for triangle in scene.triangles() {
        let is_mirror = matches!(scene.material(triangle).bsdf, Bsdf::Mirror { .. })
            && scene.smooth_normal(triangle, 0.3, 0.3).is_none();
        if !is_mirror {
            continue;
        }
        let plane = plane(scene, triangle, offset);
        match planes.iter().position(|other| is_same(other, &plane, unit)) {
            Some(at) => planes[at].join(&plane),
            None if planes.len() < PLANES => planes.push(plane),
            None => {}
        }
    }
    let (most, least) = MIRRORS;
    planes.retain(|plane| plane.area * unit * unit >= least);
    planes.sort_by(|a, b| b.area.total_cmp(&a.area));
    planes.truncate(most);
    planes
}

fn plane(scene: &Scene, triangle: u32, offset: Vec3) -> MirrorPlane {
    let normal = scene.normal(triangle).as_dvec3();
    let corners = scene.corners(triangle).map(|corner| corner + offset);
    let centre = corners.iter().sum::<Vec3>() / 3.0;
    let corner = corners[0].as_dvec3();
    MirrorPlane {
        normal: normal.to_array(),
        offset: normal.dot(corner),
        centre: centre.to_array(),
        radius: corners.map(|corner| corner.distance(centre)).into_iter().fold(0.0, f32::max),
        area: scene.area(triangle),
    }
}

impl MirrorPlane {
    /// Adds another part of the mirror.
    fn join(&mut self, other: &MirrorPlane) {
        let (a, b) = (Vec3::from(self.centre), Vec3::from(other.centre));
        let distance = a.distance(b);
        if distance + other.radius > self.radius {
            let radius = (0.5 * (distance + self.radius + other.radius)).max(other.radius);
            let share =
                if distance > 0.0 { (radius - self.radius).max(0.0) / distance } else { 0.0 };
            (self.centre, self.radius) = (a.lerp(b, share.min(1.0)).to_array(), radius);
        }
        self.area += other.area;
    }
}

fn is_same(one: &MirrorPlane, other: &MirrorPlane, unit: f64) -> bool {
    let turn = DVec3::from_array(one.normal).dot(DVec3::from_array(other.normal));
    let other_offset = if turn < 0.0 { -other.offset } else { other.offset };
    turn.abs() > SAME_PLANE.1 && (one.offset - other_offset).abs() * unit < SAME_PLANE.0
}
