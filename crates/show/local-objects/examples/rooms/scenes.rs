//! Rooms of boxes, each with an object that is carried in. The up axis is z, and the unit a metre.

use glam::DVec3;
use holo_scene::{Bsdf, Material, Scene, Sky};

/// A room, an object that stands in it, and a view.
pub struct Case {
    pub name: &'static str,
    room: Boxes,
    object: Boxes,
    sky: [f32; 3],
    pub eye: DVec3,
    pub towards: DVec3,
    /// Horizontal angle, degrees.
    pub angle: f64,
}

/// Faces of boxes, each with its material.
#[derive(Clone, Default)]
struct Boxes {
    faces: Vec<([DVec3; 4], usize)>,
    materials: Vec<Material>,
}

impl Case {
    /// Returns the room, without the object or with it.
    pub fn room(&self, has_object: bool) -> Scene {
        let mut all = self.room.clone();
        if has_object {
            let before = all.materials.len();
            all.materials.extend(self.object.materials.iter().cloned());
            all.faces.extend(self.object.faces.iter().map(|(face, m)| (*face, m + before)));
        }
        all.scene(self.sky)
    }

    /// Returns the object alone, in the room's coordinates.
    pub fn object(&self) -> Scene {
        self.object.scene([0.0; 3])
    }
}

impl Boxes {
    fn scene(&self, sky: [f32; 3]) -> Scene {
        let (mut points, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
        for (face, material) in &self.faces {
            let first = points.len() as u32;
            points.extend(face);
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            ids.extend([*material as u32; 2]);
        }
        let sky = Sky::from(sky);
        Scene::from_world(&points, &triangles, &ids, self.materials.clone(), sky).unwrap().0
    }

    fn material(&mut self, kd: [f32; 3], emission: [f32; 3]) -> usize {
        let bsdf = Bsdf::Diffuse { kd };
        self.materials.push(Material { bsdf, emission, ..Material::grey("box") });
        self.materials.len() - 1
    }

    /// Adds a box. Its faces look outwards, or inwards. `kd` is the colour of all faces or of each,
    /// in the order x-, x+, y-, y+, z-, z+; one without colour is left out.
    fn add(
        mut self,
        [low, high]: [[f64; 3]; 2],
        is_inward: bool,
        kd: [Option<[f32; 3]>; 6],
    ) -> Boxes {
        for (face, kd) in kd.into_iter().enumerate() {
            let Some(kd) = kd else { continue };
            let material = self.material(kd, [0.0; 3]);
            self.face([low, high], face, is_inward, material);
        }
        self
    }

    fn solid(self, low: [f64; 3], high: [f64; 3], kd: [f32; 3]) -> Boxes {
        self.add([low, high], false, [Some(kd); 6])
    }

    /// Adds a lamp: a rectangle that shines downwards.
    fn lamp(mut self, low: [f64; 3], high: [f64; 3], emission: [f32; 3]) -> Boxes {
        let material = self.material([0.0; 3], emission);
        self.face([low, high], 4, false, material);
        self
    }

    fn face(&mut self, [low, high]: [[f64; 3]; 2], face: usize, is_inward: bool, material: usize) {
        let (axis, is_high) = (face / 2, face % 2 == 1);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |at: [bool; 2]| {
            let mut point = low;
            point[axis] = if is_high { high[axis] } else { low[axis] };
            point[u] = if at[0] { high[u] } else { low[u] };
            point[v] = if at[1] { high[v] } else { low[v] };
            DVec3::from_array(point)
        };
        let corners = [[false, false], [true, false], [true, true], [false, true]];
        let mut corners = corners.map(corner);
        if is_high == is_inward {
            corners.reverse();
        }
        self.faces.push((corners, material));
    }
}

const WHITE: [f32; 3] = [0.7; 3];
const WOOD: [f32; 3] = [0.45, 0.3, 0.2];
const CLAY: [f32; 3] = [0.6, 0.55, 0.5];
const BLUE: [f32; 3] = [0.2, 0.3, 0.6];

fn stool(at: [f64; 2]) -> Boxes {
    let [x, y] = at;
    let mut boxes = Boxes::default();
    for dx in [-0.25, 0.2] {
        for dy in [-0.25, 0.2] {
            let (x, y) = (x + dx, y + dy);
            boxes = boxes.solid([x, y, 0.001], [x + 0.05, y + 0.05, 0.45], CLAY);
        }
    }
    boxes.solid([x - 0.3, y - 0.3, 0.45], [x + 0.3, y + 0.3, 0.5], CLAY).solid(
        [x - 0.12, y - 0.12, 0.5],
        [x + 0.12, y + 0.12, 0.74],
        BLUE,
    )
}

/// Returns all cases.
pub fn cases() -> Vec<Case> {
    let inside = |low: [f64; 3], high: [f64; 3], kd| Boxes::default().add([low, high], true, kd);
    let (red, green) = (Some([0.6, 0.15, 0.1]), Some([0.15, 0.5, 0.2]));
    let white = Some(WHITE);
    let closed = inside([0.0; 3], [4.0, 5.0, 2.7], [red, green, white, white, white, white])
        .lamp([1.5, 2.0, 2.6], [2.5, 3.0, 2.65], [12.0, 11.0, 9.0])
        .solid([0.3, 4.0, 0.0], [1.3, 4.8, 0.75], WOOD)
        .solid([3.2, 1.0, 0.0], [3.9, 2.5, 0.5], WOOD);
    // The Cornell box, turned upright: its open side is y = 0.
    let cornell = || {
        inside([0.0; 3], [5.5; 3], [red, green, None, white, white, white]).lamp(
            [2.1, 2.1, 5.45],
            [3.4, 3.4, 5.46],
            [15.0, 11.0, 6.0],
        )
    };
    let cube = |low: [f64; 3], side: f64| {
        let high = low.map(|c| c + side);
        Boxes::default().solid(low, high, WHITE)
    };
    // A window in the wall x = 0, as an opening, and a table by the wall.
    let window = inside([0.0; 3], [5.0, 4.0, 2.6], [None, white, white, white, Some(WOOD), white])
        .solid([-0.2, 0.0, 0.0], [0.0, 4.0, 0.9], WHITE)
        .solid([-0.2, 0.0, 2.2], [0.0, 4.0, 2.6], WHITE)
        .solid([-0.2, 0.0, 0.9], [0.0, 1.2, 2.2], WHITE)
        .solid([-0.2, 2.8, 0.9], [0.0, 4.0, 2.2], WHITE)
        .solid([2.4, 3.2, 0.0], [3.8, 3.9, 0.7], BLUE);
    // Two rooms, with a door between them and a lamp in each.
    let rooms = inside([0.0; 3], [6.0, 3.5, 2.5], [white, green, white, red, Some(CLAY), white])
        .solid([3.0, 0.0, 0.0], [3.1, 2.3, 2.5], WHITE)
        .solid([3.0, 2.3, 2.1], [3.1, 3.5, 2.5], WHITE)
        .lamp([1.2, 1.4, 2.45], [1.8, 2.0, 2.46], [14.0, 14.0, 14.0])
        .lamp([4.4, 0.6, 2.45], [4.8, 1.0, 2.46], [20.0, 14.0, 8.0])
        .solid([0.1, 2.4, 0.0], [0.7, 3.4, 1.6], WOOD);
    let shelf = Boxes::default()
        .solid([1.0, 2.9, 0.001], [1.06, 3.4, 1.1], WOOD)
        .solid([1.94, 2.9, 0.001], [2.0, 3.4, 1.1], WOOD)
        .solid([1.06, 2.9, 0.3], [1.94, 3.4, 0.34], WOOD)
        .solid([1.06, 2.9, 0.8], [1.94, 3.4, 0.84], WOOD)
        .solid([1.3, 3.0, 0.34], [1.6, 3.3, 0.6], BLUE);
    vec![
        Case {
            name: "closed",
            room: closed,
            object: stool([2.2, 2.6]),
            sky: [0.0; 3],
            eye: DVec3::new(0.5, 0.6, 1.6),
            towards: DVec3::new(1.7, 2.0, -1.1),
            angle: 60.0,
        },
        Case {
            name: "cornell-floor",
            room: cornell(),
            object: cube([1.2, 2.8, 0.001], 1.6),
            sky: [0.0; 3],
            eye: DVec3::new(2.75, -6.0, 2.75),
            towards: DVec3::new(-0.1, 1.0, -0.2),
            angle: 30.0,
        },
        Case {
            name: "cornell-open",
            room: cornell(),
            object: cube([2.6, 0.3, 0.8], 1.2),
            sky: [0.0; 3],
            eye: DVec3::new(2.0, -6.0, 3.0),
            towards: DVec3::new(0.12, 1.0, -0.2),
            angle: 30.0,
        },
        Case {
            name: "window",
            room: window,
            object: stool([1.5, 3.5]),
            sky: [3.0, 3.5, 4.0],
            eye: DVec3::new(3.6, 0.4, 1.6),
            towards: DVec3::new(-2.1, 3.1, -1.2),
            angle: 45.0,
        },
        Case {
            name: "rooms",
            room: rooms,
            object: shelf,
            sky: [0.0; 3],
            eye: DVec3::new(2.6, 0.4, 1.6),
            towards: DVec3::new(-1.1, 2.6, -1.0),
            angle: 55.0,
        },
    ]
}
