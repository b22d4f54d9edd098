//! The Delaunay triangulation of directions on the sphere (Larson & Simmons 1999, §2.4.5).
//!
//! A new direction is located by a walk from a vertex near it. It splits its triangle into three,
//! and edges are swapped until no cone of a triangle contains another vertex. A direction on an
//! edge needs no case of its own: it makes a triangle without area, whose edge is swapped at once.
//! To remove a vertex, edges at it are swapped until it has three, and then its three triangles
//! become one.
//!
//! Invariants:
//! - The triangles tile the sphere: V - E + F = 2, and none has a determinant of 0 or below.
//! - They are a function of the set of directions alone ([`direction`](crate::direction)).
//! - The twelve corners of an icosahedron are never removed. So no triangle is larger than a face of
//!   the icosahedron, and no star of a vertex reaches half around the sphere.

use glam::DVec3;

use crate::direction::{GridDirection, HullPoint, determinant, is_in_cone};
use crate::index::DirectionIndex;

/// Corners of the icosahedron, the first vertices.
pub const BASE: u32 = 12;
/// The golden ratio, to double precision.
const GOLDEN: f64 = 1.618_033_988_749_895;

/// A triangle: its corners, counterclockwise from outside, and the triangle opposite to each.
#[derive(Clone, Copy, Debug)]
pub struct MeshTriangle {
    /// Numbers of vertices.
    pub corners: [u32; 3],
    /// Numbers of triangles: beyond the edge that does not touch the corner.
    beyond: [u32; 3],
}

/// A vertex: its direction, and one of its triangles.
#[derive(Clone, Copy, Debug)]
struct MeshVertex {
    point: HullPoint,
    triangle: u32,
}

/// Triangles on the sphere.
pub struct SphereTriangulation {
    vertices: Vec<MeshVertex>,
    triangles: Vec<MeshTriangle>,
    /// Numbers of vertices that were removed.
    free: Vec<u32>,
    /// Numbers of triangles that were removed. Their corners are equal.
    free_triangles: Vec<u32>,
    index: DirectionIndex,
    /// Edges to test, as a triangle and a corner opposite to the edge.
    suspects: Vec<(u32, usize)>,
    /// Number of edges swapped so far.
    pub swaps: u64,
}

impl Default for SphereTriangulation {
    fn default() -> SphereTriangulation {
        SphereTriangulation::new()
    }
}

/// Returns the corner after this one, counterclockwise.
const fn next(corner: usize) -> usize {
    if corner == 2 { 0 } else { corner + 1 }
}

impl SphereTriangulation {
    /// Returns an icosahedron.
    pub fn new() -> SphereTriangulation {
        let mut corners = Vec::new();
        for long in [1.0, -1.0] {
            for short in [1.0, -1.0] {
                let [long, short] = [long * GOLDEN, short];
                corners.push(DVec3::new(0.0, short, long));
                corners.push(DVec3::new(short, long, 0.0));
                corners.push(DVec3::new(long, 0.0, short));
            }
        }
        let mut mesh = SphereTriangulation {
            vertices: Vec::new(),
            triangles: Vec::new(),
            free: Vec::new(),
            free_triangles: Vec::new(),
            index: DirectionIndex::default(),
            suspects: Vec::new(),
            swaps: 0,
        };
        for direction in corners.iter().filter_map(|&corner| GridDirection::nearest(corner)) {
            let vertex = mesh.vertices.len() as u32;
            mesh.vertices.push(MeshVertex { point: direction.into(), triangle: 0 });
            mesh.index.insert(direction, vertex);
        }
        mesh.add_faces(&corners);
        mesh
    }

    /// Adds the icosahedron's faces: its corners at distance 2 from each other.
    fn add_faces(&mut self, corners: &[DVec3]) {
        let adjacent = |a: usize, b: usize| corners[a].distance_squared(corners[b]) < 4.5;
        for a in 0..corners.len() {
            for b in a + 1..corners.len() {
                for c in b + 1..corners.len() {
                    if adjacent(a, b) && adjacent(b, c) && adjacent(a, c) {
                        let [a, b, c] = [a, b, c].map(|corner| corner as u32);
                        let turned =
                            if self.determinant([a, b, c]) > 0 { [a, b, c] } else { [a, c, b] };
                        self.triangles.push(MeshTriangle { corners: turned, beyond: [0; 3] });
                    }
                }
            }
        }
        for number in 0..self.triangles.len() as u32 {
            for corner in 0..3 {
                let [from, to] = self.edge(number, corner);
                let other = self.triangles.iter().position(|other| {
                    (0..3).any(|at| other.corners[at] == to && other.corners[next(at)] == from)
                });
                self.triangles[number as usize].beyond[corner] = other.unwrap_or(0) as u32;
                self.vertices[from as usize].triangle = number;
            }
        }
    }

    /// Returns the number of vertices that there are.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len() - self.free.len()
    }

    /// Returns one more than the largest number that a vertex has had.
    pub fn vertex_slots(&self) -> usize {
        self.vertices.len()
    }

    /// Returns a vertex's direction.
    pub fn direction(&self, vertex: u32) -> GridDirection {
        self.vertices[vertex as usize].point.direction
    }

    /// Returns the corners of all triangles, counterclockwise from outside.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let corners = self.triangles.iter().map(|triangle| triangle.corners);
        corners.filter(|[a, b, _]| a != b)
    }

    /// Calls `visit` with each vertex that an edge connects with this one, counterclockwise.
    pub fn for_neighbours(&self, vertex: u32, mut visit: impl FnMut(u32)) {
        let first = self.vertices[vertex as usize].triangle;
        let mut number = first;
        loop {
            let triangle = &self.triangles[number as usize];
            let at = corner_of(triangle, vertex);
            visit(triangle.corners[next(at)]);
            number = triangle.beyond[next(at)];
            if number == first {
                return;
            }
        }
    }

    /// Returns whether three neighbours are counterclockwise, seen from outside.
    pub fn is_left(&self, corners: [u32; 3]) -> bool {
        self.determinant(corners) > 0
    }

    /// Inserts a direction. Returns its vertex, which may have been there before.
    pub fn insert(&mut self, direction: GridDirection) -> u32 {
        let point = HullPoint::from(direction);
        let number = self.locate(&point);
        let MeshTriangle { corners, beyond } = self.triangles[number as usize];
        if let Some(&same) = corners.iter().find(|&&corner| self.direction(corner) == direction) {
            return same;
        }
        let vertex = self.add_vertex(point);
        let [a, b, c] = corners;
        let parts = [number, self.add_triangle(), self.add_triangle()];
        let [ab, bc, ca] = parts;
        // The new vertex is the first corner of each part.
        let part = |from, to, outside, next, before| MeshTriangle {
            corners: [vertex, from, to],
            beyond: [outside, next, before],
        };
        self.set(ab, part(a, b, beyond[2], bc, ca));
        self.set(bc, part(b, c, beyond[0], ca, ab));
        self.set(ca, part(c, a, beyond[1], ab, bc));
        self.repoint(beyond[0], number, bc);
        self.repoint(beyond[1], number, ca);
        self.index.insert(direction, vertex);
        self.suspects.extend(parts.map(|part| (part, 0)));
        self.swap_suspects();
        vertex
    }

    /// Removes a vertex. Corners of the icosahedron stay.
    pub fn remove(&mut self, vertex: u32) {
        if vertex < BASE {
            return;
        }
        let mut changed = Vec::new();
        while self.degree(vertex) > 3 {
            let Some((number, corner)) = self.ear(vertex) else { return };
            self.swap(number, corner);
            changed.extend([number, self.triangles[number as usize].beyond[corner]]);
        }
        changed.push(self.close(vertex));
        self.index.remove(self.direction(vertex), vertex);
        self.free.push(vertex);
        // All edges of changed triangles, some of them twice.
        for number in changed {
            let [a, b, _] = self.triangles[number as usize].corners;
            if a != b {
                self.suspects.extend((0..3).map(|corner| (number, corner)));
            }
        }
        self.swap_suspects();
    }

    /// Returns the triangle in which a direction is.
    fn locate(&self, point: &HullPoint) -> u32 {
        let near = self.index.near(point.direction).unwrap_or(0);
        let mut number = self.vertices[near as usize].triangle;
        // Each step enters a triangle whose plane is higher in this direction, so none comes twice.
        'walk: loop {
            let triangle = &self.triangles[number as usize];
            for corner in 0..3 {
                let [from, to] = self.edge(number, corner).map(|end| &self.vertices[end as usize]);
                if determinant(&from.point, &to.point, point) < 0 {
                    number = triangle.beyond[corner];
                    continue 'walk;
                }
            }
            return number;
        }
    }

    /// Swaps edges until no suspect's cone contains the vertex beyond it.
    fn swap_suspects(&mut self) {
        while let Some((number, corner)) = self.suspects.pop() {
            let triangle = self.triangles[number as usize];
            let other = triangle.beyond[corner];
            let at = self.corner_beyond(number, other);
            let [a, b, c] = triangle.corners.map(|end| &self.vertices[end as usize].point);
            let opposite = self.triangles[other as usize].corners[at];
            if a.direction == b.direction
                || !is_in_cone(a, b, c, &self.vertices[opposite as usize].point)
            {
                continue;
            }
            self.swap(number, corner);
            self.swaps += 1;
            // The two triangles now share the edge between the two vertices. The other four edges
            // may have become wrong.
            for (number, corner) in [(number, corner), (other, at)] {
                self.suspects.push((number, next(corner)));
                self.suspects.push((number, next(next(corner))));
            }
        }
    }

    /// Replaces the edge opposite to a corner by the edge from that corner to the vertex beyond.
    /// Both triangles keep their numbers. In triangle `number`, the new edge is opposite to `corner`.
    fn swap(&mut self, number: u32, corner: usize) {
        let near = self.triangles[number as usize];
        let other = near.beyond[corner];
        let at = self.corner_beyond(number, other);
        let far = self.triangles[other as usize];
        let (a, b, c) =
            (near.corners[corner], near.corners[next(corner)], near.corners[next(next(corner))]);
        let d = far.corners[at];
        // Beyond the edges a-b, b-d, d-c and c-a.
        let (ab, ca) = (near.beyond[next(next(corner))], near.beyond[next(corner)]);
        let (bd, dc) = (far.beyond[next(at)], far.beyond[next(next(at))]);
        let turned = |corners: [u32; 3], beyond: [u32; 3], first: usize| {
            let mut triangle = MeshTriangle { corners, beyond };
            triangle.corners.rotate_right(first);
            triangle.beyond.rotate_right(first);
            triangle
        };
        // Triangle b, d, a with the edge d-a opposite to b.
        self.set(number, turned([b, d, a], [other, ab, bd], corner));
        self.set(other, turned([c, a, d], [number, dc, ca], at));
        self.repoint(bd, other, number);
        self.repoint(ca, number, other);
    }

    /// Returns a triangle at a vertex and the corner opposite to an edge at that vertex that can be
    /// swapped, so that the vertex loses the edge.
    fn ear(&self, vertex: u32) -> Option<(u32, usize)> {
        let first = self.vertices[vertex as usize].triangle;
        let mut number = first;
        loop {
            let triangle = &self.triangles[number as usize];
            let at = corner_of(triangle, vertex);
            // Neighbours in order: before, middle, after. The edge to the middle one is tested.
            let (before, middle) = (triangle.corners[next(at)], triangle.corners[next(next(at))]);
            let following = triangle.beyond[next(at)];
            let other = &self.triangles[following as usize];
            let after = other.corners[next(next(corner_of(other, vertex)))];
            if self.determinant([before, middle, after]) > 0
                && self.determinant([vertex, before, after]) >= 0
            {
                return Some((number, next(at)));
            }
            number = following;
            if number == first {
                return None;
            }
        }
    }

    /// Replaces the three triangles of a vertex by one. Returns its number.
    fn close(&mut self, vertex: u32) -> u32 {
        let first = self.vertices[vertex as usize].triangle;
        let mut numbers = [first; 3];
        let (mut corners, mut outside) = ([0; 3], [0; 3]);
        for place in 0..3 {
            let triangle = self.triangles[numbers[place] as usize];
            let at = corner_of(&triangle, vertex);
            corners[place] = triangle.corners[next(at)];
            outside[place] = triangle.beyond[at];
            if place < 2 {
                numbers[place + 1] = triangle.beyond[next(at)];
            }
        }
        // The edge from corner 0 to corner 1 is opposite to corner 2.
        let beyond = [outside[1], outside[2], outside[0]];
        self.repoint(outside[1], numbers[1], first);
        self.repoint(outside[2], numbers[2], first);
        self.set(first, MeshTriangle { corners, beyond });
        for &number in &numbers[1..] {
            self.triangles[number as usize].corners = [0; 3];
            self.free_triangles.push(number);
        }
        first
    }

    fn degree(&self, vertex: u32) -> usize {
        let mut count = 0;
        self.for_neighbours(vertex, |_| count += 1);
        count
    }

    fn determinant(&self, corners: [u32; 3]) -> i64 {
        let [a, b, c] = corners.map(|corner| &self.vertices[corner as usize].point);
        determinant(a, b, c)
    }

    /// Returns the ends of the edge opposite to a corner, counterclockwise.
    fn edge(&self, number: u32, corner: usize) -> [u32; 2] {
        let corners = &self.triangles[number as usize].corners;
        [corners[next(corner)], corners[next(next(corner))]]
    }

    /// Returns the corner of triangle `other` that is opposite to triangle `number`.
    fn corner_beyond(&self, number: u32, other: u32) -> usize {
        let beyond = &self.triangles[other as usize].beyond;
        beyond.iter().position(|&beyond| beyond == number).unwrap_or(0)
    }

    /// Sets a triangle, and makes it the one that its corners name.
    fn set(&mut self, number: u32, triangle: MeshTriangle) {
        for corner in triangle.corners {
            self.vertices[corner as usize].triangle = number;
        }
        self.triangles[number as usize] = triangle;
    }

    /// Makes triangle `of` adjoin `to` where it adjoined `from`.
    fn repoint(&mut self, of: u32, from: u32, to: u32) {
        let at = self.corner_beyond(from, of);
        self.triangles[of as usize].beyond[at] = to;
    }

    fn add_vertex(&mut self, point: HullPoint) -> u32 {
        let vertex = MeshVertex { point, triangle: 0 };
        match self.free.pop() {
            Some(number) => {
                self.vertices[number as usize] = vertex;
                number
            }
            None => {
                self.vertices.push(vertex);
                self.vertices.len() as u32 - 1
            }
        }
    }

    fn add_triangle(&mut self) -> u32 {
        self.free_triangles.pop().unwrap_or_else(|| {
            self.triangles.push(MeshTriangle { corners: [0; 3], beyond: [0; 3] });
            self.triangles.len() as u32 - 1
        })
    }
}

/// Returns the place of a vertex among a triangle's corners.
fn corner_of(triangle: &MeshTriangle, vertex: u32) -> usize {
    triangle.corners.iter().position(|&corner| corner == vertex).unwrap_or(0)
}
