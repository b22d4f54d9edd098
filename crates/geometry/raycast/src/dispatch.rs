//! Chooses the code for this processor once: the same traversal with AVX-512, AVX2 or plain
//! instructions.
//!
//! Invariant: the results are equal bit for bit. Triangles are tested by the same operations
//! without fused multiply-add, boxes only decide what is tested, and equal distances are decided by
//! the triangle's index.

use crate::instances::{Instances, traverse_instances};
use crate::kernel::{Query, sweep, traverse};
use crate::node::{Hierarchy, LARGE_STACK, SMALL_STACK};
use crate::packet::traverse_many;
use crate::simd::{Portable, RAYS, Simd};
use crate::tile::{Bundle, traverse_tile};
#[cfg(target_arch = "x86_64")]
use crate::x86::{Avx2, Avx512};
use crate::{Hit, NO_TRIANGLE, Ray};
use holo_scene::Instance;

/// The instruction set for tracing on this processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RayIsa {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl RayIsa {
    pub(crate) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            let narrow = Avx2::detect().map(Self::Avx2);
            Avx512::detect().map(Self::Avx512).or(narrow).unwrap_or(Self::Portable)
        }
        #[cfg(not(target_arch = "x86_64"))]
        Self::Portable
    }

    /// Returns all instruction sets of this processor.
    #[cfg(test)]
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        all.extend(
            Avx2::detect().map(Self::Avx2).into_iter().chain(Avx512::detect().map(Self::Avx512)),
        );
        all
    }

    /// Returns the triangle of any hit. Separate from `trace`, so that the place of the hit need
    /// not be computed.
    #[inline]
    #[allow(unsafe_code)]
    pub(crate) fn any(self, hierarchy: &Hierarchy, query: &Query) -> Option<u32> {
        match self {
            Self::Portable => single::<_, true>(Portable, hierarchy, query).map(|hit| hit.triangle),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has AVX2 and FMA.
            Self::Avx2(simd) => unsafe { avx2_any(simd, hierarchy, query) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has these parts of AVX-512.
            Self::Avx512(simd) => unsafe { avx512_any(simd, hierarchy, query) },
        }
    }

    /// Returns the nearest hit.
    #[inline]
    #[allow(unsafe_code)]
    pub(crate) fn trace(self, hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
        match self {
            Self::Portable => single::<_, false>(Portable, hierarchy, query),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has AVX2 and FMA.
            Self::Avx2(simd) => unsafe { avx2(simd, hierarchy, query) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has these parts of AVX-512.
            Self::Avx512(simd) => unsafe { avx512(simd, hierarchy, query) },
        }
    }
}

impl RayIsa {
    /// Finds the nearest hits of at most [`MAX_TILE`](crate::MAX_TILE) rays from one eye. Returns
    /// `false` if they are not from one eye.
    #[allow(unsafe_code)]
    pub(crate) fn trace_tile(
        self,
        hierarchy: &Hierarchy,
        reach: f32,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) -> bool {
        match self {
            Self::Portable => tile(Portable, hierarchy, reach, rays, hits),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has AVX2 and FMA.
            Self::Avx2(simd) => unsafe { avx2_tile(simd, hierarchy, reach, rays, hits) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has these parts of AVX-512.
            Self::Avx512(simd) => unsafe { avx512_tile(simd, hierarchy, reach, rays, hits) },
        }
    }

    /// Finds the nearest hits of at most [`RAYS`] queries. `best` must have [`Query::nothing`] of
    /// each.
    #[allow(unsafe_code)]
    pub(crate) fn trace_many(
        self,
        hierarchy: &Hierarchy,
        queries: &[Query],
        best: &mut [Hit; RAYS],
    ) {
        match self {
            Self::Portable => many(Portable, hierarchy, queries, best),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has AVX2 and FMA.
            Self::Avx2(simd) => unsafe { avx2_many(simd, hierarchy, queries, best) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has these parts of AVX-512.
            Self::Avx512(simd) => unsafe { avx512_many(simd, hierarchy, queries, best) },
        }
    }
}

impl RayIsa {
    /// Replaces `best` by the nearest hit on an instance that is nearer, or with `ANY` by some hit.
    #[allow(unsafe_code)]
    pub(crate) fn trace_instances<const ANY: bool>(
        self,
        hierarchies: &Instances,
        instances: &[Instance],
        query: &Query,
        best: &mut Hit,
    ) {
        match self {
            Self::Portable => {
                traverse_instances::<_, ANY>(Portable, hierarchies, instances, query, best);
            }
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has AVX2 and FMA.
            Self::Avx2(simd) => unsafe {
                avx2_instances::<ANY>(simd, hierarchies, instances, query, best);
            },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the value proves that the processor has these parts of AVX-512.
            Self::Avx512(simd) => unsafe {
                avx512_instances::<ANY>(simd, hierarchies, instances, query, best);
            },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn avx2_instances<const ANY: bool>(
    simd: Avx2,
    hierarchies: &Instances,
    instances: &[Instance],
    query: &Query,
    best: &mut Hit,
) {
    traverse_instances::<_, ANY>(simd, hierarchies, instances, query, best);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512_instances<const ANY: bool>(
    simd: Avx512,
    hierarchies: &Instances,
    instances: &[Instance],
    query: &Query,
    best: &mut Hit,
) {
    traverse_instances::<_, ANY>(simd, hierarchies, instances, query, best);
}

#[inline(always)]
fn many<S: Simd>(simd: S, hierarchy: &Hierarchy, queries: &[Query], best: &mut [Hit; RAYS]) {
    if hierarchy.nodes.is_empty() {
    } else if hierarchy.stack_need <= SMALL_STACK {
        traverse_many::<S, SMALL_STACK>(simd, hierarchy, queries, best);
    } else {
        traverse_many::<S, LARGE_STACK>(simd, hierarchy, queries, best);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn avx2_many(simd: Avx2, hierarchy: &Hierarchy, queries: &[Query], best: &mut [Hit; RAYS]) {
    many(simd, hierarchy, queries, best);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512_many(simd: Avx512, hierarchy: &Hierarchy, queries: &[Query], best: &mut [Hit; RAYS]) {
    many(simd, hierarchy, queries, best);
}

#[inline(always)]
fn tile<S: Simd>(
    simd: S,
    hierarchy: &Hierarchy,
    reach: f32,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
) -> bool {
    if hierarchy.nodes.is_empty() || rays.is_empty() {
        hits.fill(None);
        return true;
    }
    let Some(bundle) = Bundle::new(rays, reach) else { return false };
    if hierarchy.stack_need <= SMALL_STACK {
        traverse_tile::<S, SMALL_STACK>(simd, hierarchy, &bundle, hits);
    } else {
        traverse_tile::<S, LARGE_STACK>(simd, hierarchy, &bundle, hits);
    }
    true
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn avx2_tile(
    simd: Avx2,
    hierarchy: &Hierarchy,
    reach: f32,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
) -> bool {
    tile(simd, hierarchy, reach, rays, hits)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512_tile(
    simd: Avx512,
    hierarchy: &Hierarchy,
    reach: f32,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
) -> bool {
    tile(simd, hierarchy, reach, rays, hits)
}

#[inline(always)]
fn single<S: Simd, const ANY: bool>(simd: S, hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    if hierarchy.nodes.is_empty() {
        return None;
    }
    let mut best = query.nothing();
    if let Some(few) = &hierarchy.few {
        sweep::<S, ANY>(simd, few, query, &mut best);
    } else if hierarchy.stack_need <= SMALL_STACK {
        traverse::<S, SMALL_STACK, ANY>(simd, hierarchy, query, 0, &mut best);
    } else {
        traverse::<S, LARGE_STACK, ANY>(simd, hierarchy, query, 0, &mut best);
    }
    (best.triangle != NO_TRIANGLE).then_some(best)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn avx2(simd: Avx2, hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    single::<_, false>(simd, hierarchy, query)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn avx2_any(simd: Avx2, hierarchy: &Hierarchy, query: &Query) -> Option<u32> {
    single::<_, true>(simd, hierarchy, query).map(|hit| hit.triangle)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512(simd: Avx512, hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    single::<_, false>(simd, hierarchy, query)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512_any(simd: Avx512, hierarchy: &Hierarchy, query: &Query) -> Option<u32> {
    single::<_, true>(simd, hierarchy, query).map(|hit| hit.triangle)
}
