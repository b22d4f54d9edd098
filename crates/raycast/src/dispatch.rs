//! Chooses the code for this processor once: the same traversal compiled for AVX2, or for the baseline.
//!
//! Always true: both are the same Rust source without fused multiply-add, so their results are equal bit for bit.

use crate::Hit;
use crate::kernel::{Query, traverse};
use crate::node::Hierarchy;

/// Stack of ordinary hierarchies; small, since it is cleared for every ray.
pub(crate) const SMALL_STACK: usize = 96;
/// Stack of the deepest hierarchies that are accepted.
pub(crate) const LARGE_STACK: usize = 512;

/// How to trace on this processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Isa {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Isa {
    pub(crate) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// Nearest hit, or some hit with `ANY`.
    #[inline]
    pub(crate) fn trace<const ANY: bool>(self, hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
        match self {
            Self::Portable => portable::<ANY>(hierarchy, query),
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)]
            // SAFETY: `Avx2` is only ever made by `detect`, after the processor said that it has AVX2.
            Self::Avx2 => unsafe { avx2::<ANY>(hierarchy, query) },
        }
    }
}

#[inline(always)]
fn sized<const ANY: bool>(hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    if hierarchy.stack_need <= SMALL_STACK {
        traverse::<SMALL_STACK, ANY>(hierarchy, query)
    } else {
        traverse::<LARGE_STACK, ANY>(hierarchy, query)
    }
}

fn portable<const ANY: bool>(hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    sized::<ANY>(hierarchy, query)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<const ANY: bool>(hierarchy: &Hierarchy, query: &Query) -> Option<Hit> {
    sized::<ANY>(hierarchy, query)
}
