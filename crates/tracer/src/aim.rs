//! Where samples of wide materials are aimed, besides where the material sends them: at secondary
//! sources ([`secondary`](crate::secondary)) and at caustics ([`caustics`](crate::caustics)).
//!
//! Always true: one sample combines all ways of choosing its direction (Veach 1997, §9.2.4, balance
//! heuristic), so any sources and caustics give the same expectation. A vertex that has neither
//! takes no number and pays nothing.

use glam::Vec3;
use holo_raycast::{Hit, Raycaster, SurfacePoint};

use crate::caustics::CausticVertex;
use crate::engine::PathEngine;
use crate::sampler::Sampler;
use crate::secondary::AimedVertex;

/// Share of a vertex's samples for secondary sources. With 0.25, error and time differ by a few
/// percent.
const SHARE: f32 = 0.15;

/// What a vertex aims at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aims<'a> {
    sources: Option<AimedVertex<'a>>,
    caustics: Option<CausticVertex<'a>>,
}

/// What the next sample of a vertex is drawn from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Choice {
    /// The material.
    Material,
    /// A point on a source.
    Source(SurfacePoint),
    /// A unit direction from which a caustic may come.
    Caustic(Vec3),
    /// Neither: no source or caustic can contribute.
    Nothing,
}

/// The weight of a sample once it is known what it met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weight {
    /// Factor to value over density by the material.
    pub weight: f32,
    /// Whether the sample may have been aimed at what it met.
    pub is_aimed: bool,
}

impl PathEngine {
    /// Returns what a surface aims at that is lit on the side of `normal`. `None` if it sees
    /// nothing of the kind.
    #[inline]
    pub(crate) fn aims(&self, point: &SurfacePoint, normal: Vec3) -> Option<Aims<'_>> {
        let sources = self.secondary.as_ref().and_then(|s| s.aimed(point, normal));
        let caustics = self.caustics.as_ref().and_then(|c| c.seen_from(point.point, normal));
        (sources.is_some() || caustics.is_some()).then_some(Aims { sources, caustics })
    }
}

impl Aims<'_> {
    /// Chooses what the next sample is drawn from, by numbers of
    /// [`Purpose::Aim`](crate::sampler::Purpose::Aim).
    #[inline]
    pub(crate) fn choose(&self, raycaster: &Raycaster, sampler: &mut Sampler) -> Choice {
        let (mut first, second) = sampler.pairs(1).at(0);
        let share = f64::from(SHARE);
        if let Some(sources) = &self.sources {
            if first < share {
                let target = sources.target(raycaster, first / share, second);
                return target.map_or(Choice::Nothing, Choice::Source);
            }
            first -= share;
        }
        match &self.caustics {
            Some(caustics) if first < f64::from(caustics.share()) => caustics
                .choose(first / f64::from(caustics.share()), second)
                .map_or(Choice::Nothing, Choice::Caustic),
            _ => Choice::Material,
        }
    }

    /// Returns the weight of a sample towards `direction` that met `met` and whose direction the
    /// material samples with density `pdf`. `None` if the sample was aimed and something else is in
    /// front of its target.
    #[inline]
    pub(crate) fn weight(
        &self,
        raycaster: &Raycaster,
        (direction, pdf): (Vec3, f32),
        choice: &Choice,
        met: Option<&Hit>,
    ) -> Option<Weight> {
        let is_met = match choice {
            Choice::Source(target) => met.is_some_and(|met| met.triangle == target.triangle),
            Choice::Caustic(_) => met.is_some_and(|met| {
                self.caustics.is_some_and(|caustics| caustics.caustics.may_show(met.triangle))
            }),
            Choice::Material | Choice::Nothing => true,
        };
        if !is_met {
            return None;
        }
        let (mut density, mut rest) = (0.0, 1.0);
        if let Some(sources) = &self.sources {
            density += SHARE * met.map_or(0.0, |met| sources.density(raycaster, met));
            rest -= SHARE;
        }
        if let Some(caustics) = &self.caustics {
            density += caustics.share() * met.map_or(0.0, |met| caustics.density(direction, met));
            rest -= caustics.share();
        }
        Some(Weight { weight: pdf / (rest * pdf + density), is_aimed: density > 0.0 })
    }
}
