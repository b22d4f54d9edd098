//! Caustics: light that mirrors, metal and glass throw onto wide surfaces.
//!
//! Paths from the eye find such light only by chance. When the scene is prepared, light paths are
//! traced from lamps, suns and the sky over what throws light, once (module `photons`). Each ends
//! as a photon on a wide surface. Photons that lie side by side make a [`Leaf`]. Surfaces within a
//! leaf aim some of their samples in the directions that its photons came from (Jensen 1995,
//! "Importance Driven Path Tracing using the Photon Map").
//!
//! A photon remembers a point that it seems to come from. So a leaf's directions change from place
//! to place as reflections do.
//!
//! Invariant: the photons are a function of the scene alone, and only decide where samples go. A
//! density counts only if the ray hits a surface that throws light ([`Caustics::may_show`]). It is
//! then the density of [`CausticVertex::choose`]. A scene without surfaces that throw light pays
//! nothing.

mod leaf;
mod photons;

use std::sync::Arc;

use glam::Vec3;
use holo_raycast::{Hit, Raycaster};

use crate::surface::TracedMaterial;
use leaf::{Leaf, LeafTree};
use photons::Casters;
pub(crate) use photons::LightSources;

/// The caustics of a scene.
#[derive(Debug)]
pub(crate) struct Caustics {
    casters: Casters,
    tree: LeafTree,
}

/// A vertex that photons reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CausticVertex<'a> {
    pub caustics: &'a Caustics,
    leaf: &'a Leaf,
    point: Vec3,
}

impl Caustics {
    /// Finds the caustics of a scene. `None` if there are none.
    pub(crate) fn find(
        raycaster: &Arc<Raycaster>,
        surfaces: &[TracedMaterial],
        sources: &LightSources,
    ) -> Option<Self> {
        let casters = Casters::new(raycaster.scene())?;
        let photons = photons::shoot(raycaster, surfaces, sources, &casters);
        let tree = LeafTree::new(photons, raycaster.scene())?;
        Some(Self { casters, tree })
    }

    /// Returns whether a triangle may throw light.
    #[inline]
    pub(crate) fn may_show(&self, triangle: u32) -> bool {
        self.casters.contain(triangle)
    }

    /// Returns the caustics as seen from a surface that is lit on the side of `normal`. `None` if
    /// no photons are near.
    #[inline]
    pub(crate) fn seen_from(&self, point: Vec3, normal: Vec3) -> Option<CausticVertex<'_>> {
        let leaf = self.tree.find(point, normal)?;
        Some(CausticVertex { caustics: self, leaf, point })
    }
}

impl CausticVertex<'_> {
    /// Returns the share of samples that are aimed.
    #[inline]
    pub(crate) fn share(&self) -> f32 {
        self.leaf.share
    }

    /// Returns a direction in which a caustic may lie, from two uniform numbers.
    #[inline]
    pub(crate) fn choose(&self, first: f64, second: f32) -> Option<Vec3> {
        self.leaf.choose(self.point, first, second)
    }

    /// Returns the density, per solid angle, with which [`choose`](Self::choose) returns this
    /// direction. It is 0 if the ray hits a surface `met` that throws no light.
    #[inline]
    pub(crate) fn density(&self, direction: Vec3, met: &Hit) -> f32 {
        if self.caustics.may_show(met.triangle) {
            self.leaf.density(self.point, direction)
        } else {
            0.0
        }
    }
}
