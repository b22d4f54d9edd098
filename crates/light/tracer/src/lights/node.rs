//! Nodes of the light tree: eight children as a structure of arrays, so that vector instructions
//! weigh all of them at once.
//!
//! Invariant: an importance is finite and not negative. It is 0 for unused children, for children
//! wholly below the surface's horizon, and for children none of whose emitters faces the point.

use glam::Vec3;

/// Children of a node. A binary tree weighs two children at each of three times as many levels, one
/// after the other.
pub(crate) const WIDTH: usize = 8;
/// Set in a reference to an emitter; the other bits are an index.
const LEAF: u32 = 1 << 31;

/// Least squared distance, so that divisions stay finite.
const LEAST: f32 = 1e-30;

/// The position of a node or emitter in its parent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Child {
    pub node: u32,
    pub slot: u32,
}

/// Bounds of a child.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    pub center: Vec3,
    /// Half the size of a box around `center` that contains everything.
    pub half: Vec3,
    /// Squared radius of such a sphere around `center`.
    pub radius2: f32,
    pub axis: Vec3,
    /// Greatest angle between `axis` and a normal, in radians.
    pub angle: f32,
    /// Least cosine between a normal and the directions into which it emits: 0 for surfaces.
    pub edge: f32,
    /// Points whose `axis · p` is at most this see only backs; negative infinity if unknown.
    pub plane: f32,
    pub two_sided: bool,
    /// Luminance times area, relative to the strongest emitter's.
    pub power: f32,
}

/// A node with eight children.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct LightNode {
    center: [[f32; WIDTH]; 3],
    half: [[f32; WIDTH]; 3],
    axis: [[f32; WIDTH]; 3],
    radius2: [f32; WIDTH],
    cos: [f32; WIDTH],
    sin: [f32; WIDTH],
    edge: [f32; WIDTH],
    plane: [f32; WIDTH],
    power: [f32; WIDTH],
    /// 1 if some emitter has two sides, 0 if none has.
    two_sided: [f32; WIDTH],
    children: [u32; WIDTH],
    used: u32,
    pub parent: Child,
}

impl LightNode {
    pub(crate) fn new(parent: Child) -> Self {
        Self {
            center: [[0.0; WIDTH]; 3],
            half: [[0.0; WIDTH]; 3],
            axis: [[0.0; WIDTH]; 3],
            radius2: [0.0; WIDTH],
            cos: [1.0; WIDTH],
            sin: [0.0; WIDTH],
            edge: [0.0; WIDTH],
            plane: [0.0; WIDTH],
            power: [0.0; WIDTH],
            two_sided: [0.0; WIDTH],
            children: [0; WIDTH],
            used: 0,
            parent,
        }
    }

    /// Fills a slot. `child` is the index of a node, or of an emitter as the error.
    pub(crate) fn set(&mut self, slot: usize, bound: &Bound, child: Result<usize, usize>) {
        for axis in 0..3 {
            self.center[axis][slot] = bound.center[axis];
            self.half[axis][slot] = bound.half[axis];
            self.axis[axis][slot] = bound.axis[axis];
        }
        self.used = self.used.max(slot as u32 + 1);
        self.radius2[slot] = bound.radius2;
        (self.sin[slot], self.cos[slot]) = bound.angle.sin_cos();
        self.edge[slot] = bound.edge;
        self.plane[slot] = bound.plane;
        self.power[slot] = bound.power;
        self.two_sided[slot] = if bound.two_sided { 1.0 } else { 0.0 };
        self.children[slot] = match child {
            Ok(node) => node as u32,
            Err(emitter) => emitter as u32 | LEAF,
        };
    }

    /// Returns the index of a node, or of an emitter as the error.
    #[inline]
    pub(crate) fn child(&self, slot: usize) -> Result<usize, usize> {
        let child = self.children[slot];
        if child & LEAF == 0 { Ok(child as usize) } else { Err((child & !LEAF) as usize) }
    }

    /// Returns the number of children.
    pub(crate) fn used(&self) -> usize {
        self.used as usize
    }

    /// Returns the luminance times area of a child.
    pub(crate) fn power(&self, slot: usize) -> f32 {
        self.power[slot]
    }

    /// Returns a sphere around a child.
    pub(crate) fn sphere(&self, slot: usize) -> (Vec3, f32) {
        (Vec3::from(self.center.map(|row| row[slot])), self.radius2[slot].sqrt())
    }

    /// Returns the squared radius of a sphere around a child.
    pub(crate) fn radius2(&self, slot: usize) -> f32 {
        self.radius2[slot]
    }

    /// Fills a slot with another node's child. `emitter` becomes the slot's child.
    pub(crate) fn copy(&mut self, slot: usize, from: &Self, which: usize, emitter: usize) {
        for axis in 0..3 {
            self.center[axis][slot] = from.center[axis][which];
            self.half[axis][slot] = from.half[axis][which];
            self.axis[axis][slot] = from.axis[axis][which];
        }
        self.used = self.used.max(slot as u32 + 1);
        self.radius2[slot] = from.radius2[which];
        (self.sin[slot], self.cos[slot]) = (from.sin[which], from.cos[which]);
        self.edge[slot] = from.edge[which];
        self.plane[slot] = from.plane[which];
        self.power[slot] = from.power[which];
        self.two_sided[slot] = from.two_sided[which];
        self.children[slot] = emitter as u32 | LEAF;
    }

    /// Multiplies a child's power.
    pub(crate) fn scale(&mut self, slot: usize, by: f32) {
        self.power[slot] *= by;
    }

    /// Returns a child's power times the square of its size.
    pub(crate) fn extent(&self, slot: usize) -> f32 {
        self.power[slot] * self.radius2[slot]
    }

    /// Returns the light that each child may bring to a point, approximately as irradiance. It is
    /// the power over the squared distance, times the greatest cosine at the emitters and about the
    /// greatest at the surface.
    ///
    /// Obstacles are ignored. Choosing a quarter by power alone, for lamps behind nearby walls, was
    /// worse (docs/notes/path-tracing.md).
    ///
    /// Inside a child's sphere the radius replaces the distance; otherwise the square law would
    /// favour the child without reason (Pharr et al. 2023, §12.6.3). A `normal` of 0 means light
    /// from everywhere.
    #[inline]
    #[allow(unsafe_code)]
    pub(crate) fn importances(&self, p: Vec3, normal: Vec3) -> [f32; WIDTH] {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.importances_avx2(p, normal) };
        }
        self.weigh(p, normal)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn importances_avx2(&self, p: Vec3, normal: Vec3) -> [f32; WIDTH] {
        self.weigh(p, normal)
    }

    /// Implements [`importances`](Self::importances) in loops that the compiler vectorises as wide
    /// as the caller allows. All widths give the same bits.
    #[inline(always)]
    fn weigh(&self, p: Vec3, normal: Vec3) -> [f32; WIDTH] {
        let mut importances = [0.0; WIDTH];
        let above = normal.abs();
        let open = if normal == Vec3::ZERO { 1.0 } else { 0.0 };
        for (i, importance) in importances.iter_mut().enumerate() {
            let (dx, dy, dz) =
                (self.center[0][i] - p.x, self.center[1][i] - p.y, self.center[2][i] - p.z);
            let d2 = dx * dx + dy * dy + dz * dz;
            let r2 = self.radius2[i];
            let near2 = larger(larger(d2, r2), LEAST);
            let inverse = 1.0 / larger(d2, LEAST).sqrt();
            // At the emitters: the angle minus that of the cone and minus that of the sphere seen
            // from the point.
            let (wx, wy, wz) = (self.axis[0][i], self.axis[1][i], self.axis[2][i]);
            let towards = -(dx * wx + dy * wy + dz * wz) * inverse;
            let cos_w = smaller(larger(towards, -towards * self.two_sided[i]), 1.0);
            let sin_w = larger(1.0 - cos_w * cos_w, 0.0).sqrt();
            let (cos_o, sin_o) = (self.cos[i], self.sin[i]);
            let within = cos_w >= cos_o;
            let cos_x = if within { 1.0 } else { cos_w * cos_o + sin_w * sin_o };
            let sin_x = if within { 0.0 } else { sin_w * cos_o - cos_w * sin_o };
            let sin2_b = smaller(r2 * inverse * inverse, 1.0);
            let (cos_b, sin_b) = ((1.0 - sin2_b).sqrt(), sin2_b.sqrt());
            let reached = (cos_x >= cos_b) | (d2 <= r2);
            let beside = cos_x * cos_b + sin_x * sin_b;
            let within_edge = if beside > self.edge[i] { beside } else { 0.0 };
            let emitted = if reached { 1.0 } else { within_edge };
            let along = wx * p.x + wy * p.y + wz * p.z;
            let front = if along > self.plane[i] { emitted } else { 0.0 };
            // At the surface: the highest point of the box.
            let above =
                above.x * self.half[0][i] + above.y * self.half[1][i] + above.z * self.half[2][i];
            let height = normal.x * dx + normal.y * dy + normal.z * dz + above;
            let cosine = larger(smaller(larger(height, 0.0) / near2.sqrt(), 1.0), open);
            *importance = self.power[i] / near2 * front * cosine;
        }
        importances
    }
}

/// `f32::max` takes three instructions even if neither argument is NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
