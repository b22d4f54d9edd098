//! Meshes and random numbers shared by the tests.
#![allow(clippy::expect_used, reason = "a test fails by it")]
#![allow(dead_code, reason = "each test binary uses a part")]

pub mod stress;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::Raycaster;
use holo_scene::{Material, Scene};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a number that is uniform in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 * (1.0 / (1 << 24) as f32)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// Returns a point that is uniform in the cube from -1 to 1.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            let l = v.length_squared();
            if l > 1e-4 && l <= 1.0 {
                return v / l.sqrt();
            }
        }
    }
}

#[derive(Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    pub fn scene(&self) -> Arc<Scene> {
        let ids = vec![0; self.triangles.len()];
        let scene = Scene::new(
            DVec3::ZERO,
            self.positions.clone(),
            self.triangles.clone(),
            ids,
            vec![Material::grey("m")],
            [0.0; 3],
        );
        Arc::new(scene.expect("a valid mesh"))
    }

    pub fn raycaster(&self) -> Raycaster {
        Raycaster::build(self.scene()).expect("a scene that can be traced")
    }

    pub fn vertex(&self, index: u32) -> Vec3 {
        self.positions[index as usize].into()
    }

    pub fn push(&mut self, corners: [Vec3; 3]) {
        let base = self.positions.len() as u32;
        self.positions.extend(corners.map(|c| c.to_array()));
        self.triangles.push([base, base + 1, base + 2]);
    }

    /// Returns a closed sphere of `8 * 4^level` triangles: a subdivided octahedron, at `centre`
    /// with `radius`.
    pub fn sphere(level: u32, centre: Vec3, radius: f32) -> Self {
        let mut corners: Vec<Vec3> = vec![Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        let mut triangles = vec![
            [0, 1, 2],
            [1, 3, 2],
            [3, 4, 2],
            [4, 0, 2],
            [1, 0, 5],
            [3, 1, 5],
            [4, 3, 5],
            [0, 4, 5_u32],
        ];
        for _ in 0..level {
            let mut middles = std::collections::HashMap::new();
            let mut middle = |a: u32, b: u32, corners: &mut Vec<Vec3>| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    corners.push((corners[a as usize] + corners[b as usize]).normalize());
                    corners.len() as u32 - 1
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let ab = middle(a, b, &mut corners);
                    let bc = middle(b, c, &mut corners);
                    let ca = middle(c, a, &mut corners);
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let positions = corners.iter().map(|&c| (centre + c * radius).to_array()).collect();
        Self { positions, triangles }
    }

    /// Returns a closed box around the origin whose faces are grids of `n` x `m` rectangles. The
    /// rectangles are slivers if `n` and `m` differ.
    pub fn sliver_box(half: Vec3, n: u32, m: u32) -> Self {
        let mut mesh = Self::default();
        let mut known = std::collections::HashMap::new();
        // Vertices on shared edges must be the same on both faces, so every axis has one grid of
        // steps.
        let steps = [n, m, n];
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [0, steps[axis]] {
                let mut id = |a: u32, b: u32, mesh: &mut Self| {
                    let mut grid = [0; 3];
                    (grid[axis], grid[j], grid[k]) = (side, a, b);
                    *known.entry(grid).or_insert_with(|| {
                        let at =
                            |i: usize| half[i] * (2.0 * grid[i] as f32 / steps[i] as f32 - 1.0);
                        mesh.positions.push([at(0), at(1), at(2)]);
                        mesh.positions.len() as u32 - 1
                    })
                };
                for a in 0..steps[j] {
                    for b in 0..steps[k] {
                        let q = [
                            id(a, b, &mut mesh),
                            id(a + 1, b, &mut mesh),
                            id(a + 1, b + 1, &mut mesh),
                            id(a, b + 1, &mut mesh),
                        ];
                        mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
                    }
                }
            }
        }
        mesh
    }

    /// Returns unconnected random triangles in the cube from -1 to 1.
    pub fn soup(count: usize, size: f32, random: &mut Random) -> Self {
        let mut mesh = Self::default();
        while mesh.triangles.len() < count {
            let a = random.cube();
            let (b, c) = (a + random.cube() * size, a + random.cube() * size);
            if (b - a).cross(c - a).length() > 1e-3 * size * size {
                mesh.push([a, b, c]);
            }
        }
        mesh
    }
}
