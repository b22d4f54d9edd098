//! The raycaster: a scene, its hierarchy, and queries.

mod covers;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_mapped::Array;
use holo_scene::{Scene, SceneError, Sky, Sun};

use crate::build;
use crate::coincident::Coincident;
use crate::dispatch::RayIsa;
use crate::facet::{BuildError, Facet, facets};
use crate::instances::{self, Instances};
use crate::kernel::Query;
use crate::node::Hierarchy;
use crate::prepared::Prepared;
use crate::simd::RAYS;
use crate::surface::{SurfacePoint, interpolate, keep_off_edges, spawn};
use crate::{Hit, MAX_TILE, MAX_TOGETHER, NO_TRIANGLE, Ray};

/// What rays do at surfaces that are not there everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Covers {
    /// There are none.
    None,
    /// Rays pass only where nothing is there.
    Holes,
    /// Rays meet a surface with the probability of its opacity.
    Chance,
}

/// What a raycaster makes of the triangles that belong to no instance.
#[derive(Clone, Debug)]
pub(crate) struct CastGeometry {
    pub facets: Arc<Array<Facet>>,
    pub hierarchy: Arc<Hierarchy>,
    /// Half the side of the cube around the scene's origin that contains all vertices.
    pub reach: f32,
}

/// Answers ray queries on one scene. Threads share it by `Arc`.
#[derive(Clone, Debug)]
pub struct Raycaster {
    scene: Arc<Scene>,
    facets: Arc<Array<Facet>>,
    /// Over the triangles that belong to no instance; `facets` has these alone.
    hierarchy: Arc<Hierarchy>,
    /// Hierarchies of shared meshes, if the scene has instances.
    instances: Option<Arc<Instances>>,
    isa: RayIsa,
    /// Half the side of the cube around the scene's origin that contains all vertices.
    reach: f32,
    covers: Covers,
    /// Faces at one place, if there are any.
    coincident: Option<Arc<Coincident>>,
}

impl Raycaster {
    /// Builds the hierarchy of a scene.
    ///
    /// # Errors
    /// Too many triangles, a coordinate beyond [`MAX_COORDINATE`](crate::MAX_COORDINATE), or a
    /// scene that is not valid.
    pub fn build(scene: Arc<Scene>) -> Result<Self, BuildError> {
        let facets = facets(&scene.own())?;
        let reach = facets
            .iter()
            .flat_map(|f| f.vertices)
            .fold(0.0, |reach: f32, v| reach.max(v.abs().max_element()));
        let boxes = instances::boxes(&scene);
        let reach = boxes.iter().fold(reach, |reach, bounds| {
            reach.max(bounds.min.abs().max(bounds.max.abs()).max_element())
        });
        let mut hierarchy = build::hierarchy(&facets, reach);
        let mut instances = None;
        if !boxes.is_empty() {
            instances = Some(Arc::new(Instances::build(&scene, &boxes, reach)?));
            // Without boxes of its own, a query could not go on to the instances.
            hierarchy.few = None;
        }
        let coincident = Coincident::find(&scene, &facets, &hierarchy, reach);
        let geometry =
            CastGeometry { facets: Arc::new(facets.into()), hierarchy: Arc::new(hierarchy), reach };
        Ok(Self { instances, ..Self::over(scene, geometry, coincident) })
    }

    /// Casts rays at a scene without instances, with what was made of its geometry before.
    pub(crate) fn over(
        scene: Arc<Scene>,
        geometry: CastGeometry,
        coincident: Option<Coincident>,
    ) -> Self {
        let covers = if scene.has_covers() { Covers::Holes } else { Covers::None };
        let CastGeometry { facets, hierarchy, reach } = geometry;
        let (isa, coincident) = (RayIsa::detect(), coincident.map(Arc::new));
        Self { scene, facets, hierarchy, instances: None, isa, reach, covers, coincident }
    }

    /// Replaces the sky and the suns of the scene. The hierarchy stays, because sky and suns have
    /// no place in it.
    ///
    /// # Errors
    /// As [`Scene::with_suns`].
    pub fn with_sky(self, sky: Sky, suns: Vec<Sun>) -> Result<Self, SceneError> {
        let mut scene = Arc::unwrap_or_clone(self.scene).with_suns(suns)?;
        scene.sky = sky;
        Ok(Self { scene: Arc::new(scene), ..self })
    }

    /// Returns the scene.
    #[must_use]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns the first surface along the ray, seen from either side.
    #[must_use]
    #[inline]
    pub fn nearest(&self, ray: &Ray) -> Option<Hit> {
        self.query(ray, [NO_TRIANGLE; 2])
    }

    /// Returns the first surface along a ray that leaves triangle `from`, which it cannot meet
    /// again.
    #[must_use]
    #[inline]
    pub fn nearest_from(&self, ray: &Ray, from: u32) -> Option<Hit> {
        self.query(ray, [from, NO_TRIANGLE])
    }

    /// Finds the first surface along each of many rays: the same bits as [`nearest`](Self::nearest)
    /// of each.
    ///
    /// Traces [`MAX_TOGETHER`] rays at a time, which is faster if these have similar directions, as
    /// the rays of a beam do. The number of rays is the length of the shorter slice.
    pub fn nearest_many(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (rays, hits) in rays.chunks(MAX_TOGETHER).zip(hits.chunks_mut(MAX_TOGETHER)) {
            self.nearest_together(rays, &[NO_TRIANGLE; MAX_TOGETHER], hits);
        }
    }

    /// Finds the first surface along each of many rays, where each leaves the triangle of the same
    /// index in `from`. The same bits as [`nearest_from`](Self::nearest_from) of each. The number
    /// of rays is the length of the shortest slice.
    pub fn nearest_many_from(&self, rays: &[Ray], from: &[u32], hits: &mut [Option<Hit>]) {
        let chunks = rays
            .chunks(MAX_TOGETHER)
            .zip(from.chunks(MAX_TOGETHER))
            .zip(hits.chunks_mut(MAX_TOGETHER));
        chunks.for_each(|((rays, from), hits)| self.nearest_together(rays, from, hits));
    }

    fn nearest_together(&self, rays: &[Ray], from: &[u32], hits: &mut [Option<Hit>]) {
        let nothing = Hit { t: 0.0, triangle: NO_TRIANGLE, u: 0.0, v: 0.0 };
        let mut queries = [Query::NONE; MAX_TOGETHER];
        let mut best = [nothing; RAYS];
        let mut slots = [0; MAX_TOGETHER];
        let mut count = 0;
        for (slot, ((ray, &from), hit)) in rays.iter().zip(from).zip(hits.iter_mut()).enumerate() {
            *hit = None;
            if self.is_far(ray) {
                *hit = self.nearest_from(ray, from);
            } else if let Some(query) =
                query(Prepared::new(ray.origin, ray.direction), ray, [from, NO_TRIANGLE])
            {
                (queries[count], best[count], slots[count]) = (query, query.nothing(), slot);
                count += 1;
            }
        }
        self.isa.trace_many(&self.hierarchy, &queries[..count], &mut best);
        if let Some(instances) = &self.instances {
            for (query, best) in queries[..count].iter().zip(&mut best) {
                let list = self.scene.instances();
                self.isa.trace_instances::<false>(instances, list, query, best);
            }
        }
        for (slot, best) in slots[..count].iter().zip(best) {
            hits[*slot] = (best.triangle != NO_TRIANGLE).then_some(best);
        }
        if self.has_choices() {
            for ((ray, &from), hit) in rays.iter().zip(from).zip(hits.iter_mut()) {
                *hit = hit.and_then(|hit| self.choose(ray, [from, NO_TRIANGLE], hit));
            }
        }
    }

    /// Finds the first surface along each of many rays from one eye: the same bits as
    /// [`nearest`](Self::nearest) of each.
    ///
    /// Traces [`MAX_TILE`] rays at a time, which is fastest if these go through a square of pixels.
    /// Rays that do not begin at one point, or that differ in their main axis, are traced as by
    /// [`nearest_many`](Self::nearest_many).
    pub fn nearest_tile(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (rays, hits) in rays.chunks(MAX_TILE).zip(hits.chunks_mut(MAX_TILE)) {
            let used = rays.len().min(hits.len());
            if self.instances.is_some()
                || !self.isa.trace_tile(
                    &self.hierarchy,
                    self.reach,
                    &rays[..used],
                    &mut hits[..used],
                )
            {
                self.nearest_many(rays, hits);
            } else if self.has_choices() {
                for (ray, hit) in rays.iter().zip(hits.iter_mut()) {
                    *hit = hit.and_then(|hit| self.choose(ray, [NO_TRIANGLE; 2], hit));
                }
            }
        }
    }

    /// Returns whether anything lies on the ray between `t_min` and `t_max`.
    #[must_use]
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.any(ray, [NO_TRIANGLE; 2]).is_some()
    }

    /// Returns whether anything lies on a ray that leaves triangle `from`, which does not count.
    #[must_use]
    #[inline]
    pub fn occluded_from(&self, ray: &Ray, from: u32) -> bool {
        self.any(ray, [from, NO_TRIANGLE]).is_some()
    }

    /// Returns a triangle between two points on surfaces, whichever is found first. The points' own
    /// triangles do not count.
    ///
    /// The segment ends before the error bound of either point.
    #[must_use]
    #[inline]
    pub fn blocker(&self, from: &SurfacePoint, to: &SurfacePoint) -> Option<u32> {
        self.any(&between(from, to), [from.triangle, to.triangle])
    }

    /// Returns the first hit between two points on surfaces, without their own triangles. Its `t`
    /// is a share of the segment.
    #[must_use]
    #[inline]
    pub fn nearest_between(&self, from: &SurfacePoint, to: &SurfacePoint) -> Option<Hit> {
        self.query(&between(from, to), [from.triangle, to.triangle])
    }

    /// Returns whether anything separates two nearby points on surfaces, each seen from the side of
    /// its normal.
    ///
    /// Both ends are lifted off the surface by a twentieth of the distance between them. A slightly
    /// uneven surface is then no obstacle.
    #[must_use]
    pub fn parted(&self, from: &SurfacePoint, normal: Vec3, to: Vec3, to_normal: Vec3) -> bool {
        let lift = 0.05 * from.point.distance(to) + 4.0 * from.error.max_element();
        let origin = from.point + normal * lift;
        let direction = to + to_normal * lift - origin;
        self.occluded(&Ray { origin, direction, t_min: 0.0, t_max: 1.0 })
    }

    /// Returns the unit normal on the counter-clockwise side of a triangle; 0 for a triangle
    /// without area.
    ///
    /// # Panics
    /// If the scene has no such triangle.
    #[must_use]
    #[inline]
    pub fn geometric_normal(&self, triangle: u32) -> Vec3 {
        self.facet(triangle, |facet| facet.normal)
    }

    /// Returns the three vertices of a triangle.
    ///
    /// # Panics
    /// If the scene has no such triangle.
    #[must_use]
    #[inline]
    pub fn vertices(&self, triangle: u32) -> [Vec3; 3] {
        self.facet(triangle, |facet| facet.vertices)
    }

    /// Returns the point of a hit, and a bound on its error by axis.
    ///
    /// # Panics
    /// If the scene has no such triangle.
    #[must_use]
    #[inline]
    pub fn surface_point(&self, hit: &Hit) -> (Vec3, Vec3) {
        self.facet(hit.triangle, |facet| interpolate(facet.vertices, hit.u, hit.v))
    }

    /// Returns the point at barycentrics `u`, `v` of a triangle, exact up to rounding. Use it for
    /// distances and directions to the point. Rays that start there need
    /// [`surface`](Self::surface).
    ///
    /// # Panics
    /// If the scene has no such triangle.
    #[must_use]
    #[inline]
    pub fn point(&self, triangle: u32, u: f32, v: f32) -> Vec3 {
        self.facet(triangle, |facet| interpolate(facet.vertices, u, v).0)
    }

    /// Returns point, error bound and normal at barycentrics `u`, `v` of a triangle.
    ///
    /// A point within rounding of an edge is moved off it by several roundings. Otherwise a ray
    /// might start beyond the adjacent face, and leak.
    ///
    /// # Panics
    /// If the scene has no such triangle.
    #[must_use]
    #[inline]
    pub fn surface(&self, triangle: u32, u: f32, v: f32) -> SurfacePoint {
        self.facet(triangle, |facet| {
            let (u, v) = keep_off_edges(u, v, facet.margin);
            let (point, error) = interpolate(facet.vertices, u, v);
            SurfacePoint { point, error, normal: facet.normal, triangle }
        })
    }

    /// Converts a world ray to the scene's f32 coordinates. Returns the ray and the distance along
    /// the world ray at which it begins.
    ///
    /// A far eye would lose its precision in f32. So the ray's origin is moved, in f64, to where
    /// the ray comes near the scene. `None` if it never does, or is not finite. `direction` has
    /// unit length.
    #[must_use]
    pub fn localize(&self, origin: DVec3, direction: DVec3) -> Option<(Ray, f64)> {
        let local = origin - self.scene.origin;
        if !local.is_finite() || !direction.is_finite() {
            return None;
        }
        let skipped = self.approach(local, direction)?;
        Some((Ray::new((local + direction * skipped).as_vec3(), direction.as_vec3()), skipped))
    }

    /// Returns the distance along a ray at which it is within twice the scene's reach; 0 if it
    /// already is. `None` if it never is.
    fn approach(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let limit = f64::from(self.reach) * 2.0;
        if origin.abs().max_element() <= limit {
            return Some(0.0);
        }
        // Use the cube of 1.5 times the reach, so that rounding leaves a margin on both sides.
        let (mut first, mut last) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            let bound = limit * 0.75;
            if d == 0.0 {
                if o.abs() > bound {
                    return None;
                }
                continue;
            }
            let (t0, t1) = ((-bound - o) / d, (bound - o) / d);
            first = first.max(t0.min(t1));
            last = last.min(t0.max(t1));
        }
        (first <= last && first.is_finite()).then_some(first)
    }

    #[inline]
    fn query(&self, ray: &Ray, skip: [u32; 2]) -> Option<Hit> {
        let hit = self.query_whole(ray, skip)?;
        if self.has_choices() { self.choose(ray, skip, hit) } else { Some(hit) }
    }

    /// Returns the first hit, as if all surfaces were whole.
    #[inline]
    fn query_whole(&self, ray: &Ray, skip: [u32; 2]) -> Option<Hit> {
        if self.is_far(ray) {
            let (near, skipped) = self.brought_near(ray)?;
            let hit = self.trace(&self.prepare(&near, skip)?)?;
            return Some(Hit { t: (f64::from(hit.t) + skipped) as f32, ..hit });
        }
        self.trace(&self.prepare(ray, skip)?)
    }

    #[inline]
    fn trace(&self, query: &Query) -> Option<Hit> {
        let hit = self.isa.trace(&self.hierarchy, query);
        match &self.instances {
            None => hit,
            Some(instances) => self.with_instances::<false>(instances, query, hit),
        }
    }

    /// Returns the nearer one of a hit and the nearest hit on instances, or with `ANY` some hit.
    #[cold]
    fn with_instances<const ANY: bool>(
        &self,
        instances: &Instances,
        query: &Query,
        hit: Option<Hit>,
    ) -> Option<Hit> {
        let mut best = hit.unwrap_or(query.nothing());
        self.isa.trace_instances::<ANY>(instances, self.scene.instances(), query, &mut best);
        (best.triangle != NO_TRIANGLE).then_some(best)
    }

    /// Reads the facet of a triangle.
    ///
    /// # Panics
    /// If the scene has no such triangle.
    #[inline]
    fn facet<T>(&self, triangle: u32, read: impl Fn(&Facet) -> T) -> T {
        match self.facets.get(triangle as usize) {
            Some(facet) => read(facet),
            None => self.facet_of_instance(triangle, read),
        }
    }

    #[cold]
    #[inline(never)]
    fn facet_of_instance<T>(&self, triangle: u32, read: impl Fn(&Facet) -> T) -> T {
        read(&Facet::new(self.scene.corners(triangle)))
    }

    #[inline]
    fn any(&self, ray: &Ray, skip: [u32; 2]) -> Option<u32> {
        if self.has_choices() {
            return self.query(ray, skip).map(|hit| hit.triangle);
        }
        let any = |ray: &Ray| self.prepare(ray, skip).and_then(|query| self.any_of(&query));
        if self.is_far(ray) {
            self.brought_near(ray).and_then(|(near, _)| any(&near))
        } else {
            any(ray)
        }
    }

    #[inline]
    fn any_of(&self, query: &Query) -> Option<u32> {
        match (self.isa.any(&self.hierarchy, query), &self.instances) {
            (None, Some(instances)) => {
                self.with_instances::<true>(instances, query, None).map(|hit| hit.triangle)
            }
            (any, _) => any,
        }
    }

    /// Prepares a query of one ray; `None` if the ray cannot hit anything. Small scenes have no
    /// boxes.
    #[inline(always)]
    fn prepare(&self, ray: &Ray, skip: [u32; 2]) -> Option<Query> {
        let prepared = match self.hierarchy.few {
            None => Prepared::new(ray.origin, ray.direction),
            Some(_) => Prepared::for_triangles(ray.origin, ray.direction),
        };
        query(prepared, ray, skip)
    }

    #[inline]
    fn is_far(&self, ray: &Ray) -> bool {
        ray.origin.abs().max_element() > 2.0 * self.reach
    }

    /// Moves a ray's origin near the scene, in f64, because boxes are padded for origins near the
    /// scene. Returns the ray and the change of `t`.
    #[cold]
    fn brought_near(&self, ray: &Ray) -> Option<(Ray, f64)> {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        if !origin.is_finite() || !direction.is_finite() || direction.length() == 0.0 {
            return None;
        }
        let skipped = self.approach(origin, direction)?;
        let shift = |t: f32| (f64::from(t) - skipped) as f32;
        let origin = (origin + direction * skipped).as_vec3();
        Some((
            Ray {
                origin,
                direction: ray.direction,
                t_min: shift(ray.t_min),
                t_max: shift(ray.t_max),
            },
            skipped,
        ))
    }

    /// Returns the hierarchies of shared meshes.
    pub(crate) fn instances(&self) -> Option<&Instances> {
        self.instances.as_deref()
    }

    /// Returns what was made of the triangles that belong to no instance.
    pub(crate) fn geometry(&self) -> CastGeometry {
        let (facets, hierarchy) = (Arc::clone(&self.facets), Arc::clone(&self.hierarchy));
        CastGeometry { facets, hierarchy, reach: self.reach }
    }

    /// Returns the faces at one place, if there are any.
    pub(crate) fn faces_at_one_place(&self) -> Option<&Coincident> {
        self.coincident.as_deref()
    }

    /// Returns the hierarchy of triangles that belong to no instance, and half the side of the cube
    /// around the scene's origin that contains all vertices.
    pub(crate) fn hierarchy(&self) -> (&Hierarchy, f32) {
        (&self.hierarchy, self.reach)
    }
}

/// Returns the segment between two points on surfaces, shortened by the error bound of each.
#[inline]
fn between(from: &SurfacePoint, to: &SurfacePoint) -> Ray {
    let towards = to.point - from.point;
    let start = spawn(from.point, from.error, from.normal, towards);
    let end = spawn(to.point, to.error, to.normal, -towards);
    Ray { origin: start, direction: end - start, t_min: 0.0, t_max: 1.0 }
}

/// Returns the query of a ray; `None` if the ray cannot hit anything.
#[inline(always)]
fn query(prepared: Option<Prepared>, ray: &Ray, skip: [u32; 2]) -> Option<Query> {
    let prepared = prepared?;
    // Adding 0 turns -0 into 0: stack entries are sorted by their bits.
    let t_min = ray.t_min.max(0.0) + 0.0;
    if ray.t_min.is_nan() || ray.t_max.is_nan() || t_min >= ray.t_max {
        return None;
    }
    Some(Query { ray: prepared, t_min, t_max: ray.t_max, skip })
}

#[cfg(test)]
#[path = "raycaster_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "instances_tests.rs"]
mod instances_tests;
