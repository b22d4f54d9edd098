//! Aims samples of wide materials at secondary sources ([`secondary`](crate::secondary)) and at
//! caustics ([`caustics`](crate::caustics)), in addition to the directions that the material
//! samples.
//!
//! Invariant: one sample combines all ways of choosing its direction (Veach 1997, §9.2.4, balance
//! heuristic), so any sources and caustics give the same expectation. A vertex without sources and
//! caustics uses no random numbers for this and costs nothing.

use glam::Vec3;
use holo_raycast::{Hit, Raycaster, SurfacePoint};

use crate::caustics::CausticVertex;
use crate::engine::PathEngine;
use crate::sampler::Sampler;
use crate::secondary::AimedVertex;

/// Share of a vertex's samples for secondary sources. With 0.25, error and time differ by a few
/// percent.
const SHARE: f32 = 0.15;

/// The targets of a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aims<'a> {
    sources: Option<AimedVertex<'a>>,
    caustics: Option<CausticVertex<'a>>,
}

/// The distribution of a vertex's next sample.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LobeChoice {
    /// The material.
    Material,
    /// A point on a source.
    Source(SurfacePoint),
    /// A unit direction in which a caustic may lie.
    Caustic(Vec3),
    /// None of these: no source or caustic can contribute.
    Nothing,
}

/// The weight of a sample once its hit is known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampleWeight {
    /// Factor to value over density by the material.
    pub weight: f32,
    /// True if aiming could have produced the sample.
    pub is_aimed: bool,
}

impl PathEngine {
    /// Returns the targets of a surface that is lit on the side of `normal`. `None` if it sees no
    /// source and no caustic.
    #[inline]
    pub(crate) fn aims(&self, point: &SurfacePoint, normal: Vec3) -> Option<Aims<'_>> {
        let sources = self.secondary.as_ref().and_then(|s| s.aimed(point, normal));
        let caustics = self.caustics.as_ref().and_then(|c| c.seen_from(point.point, normal));
        (sources.is_some() || caustics.is_some()).then_some(Aims { sources, caustics })
    }
}

impl Aims<'_> {
    /// Chooses the distribution of the next sample, with numbers of
    /// [`Purpose::Aim`](crate::sampler::NumberPurpose::Aim).
    #[inline]
    pub(crate) fn choose(&self, raycaster: &Raycaster, sampler: &mut Sampler) -> LobeChoice {
        let (mut first, second) = sampler.pairs(1).at(0);
        let share = f64::from(SHARE);
        if let Some(sources) = &self.sources {
            if first < share {
                let target = sources.target(raycaster, first / share, second);
                return target.map_or(LobeChoice::Nothing, LobeChoice::Source);
            }
            first -= share;
        }
        match &self.caustics {
            Some(caustics) if first < f64::from(caustics.share()) => caustics
                .choose(first / f64::from(caustics.share()), second)
                .map_or(LobeChoice::Nothing, LobeChoice::Caustic),
            _ => LobeChoice::Material,
        }
    }

    /// Returns the weight of a sample towards `direction` that hit `met`. The material samples this
    /// direction with density `pdf`. `None` if the sample was aimed and hits something in front of
    /// its target.
    #[inline]
    pub(crate) fn weight(
        &self,
        raycaster: &Raycaster,
        (direction, pdf): (Vec3, f32),
        choice: &LobeChoice,
        met: Option<&Hit>,
    ) -> Option<SampleWeight> {
        let is_met = match choice {
            LobeChoice::Source(target) => met.is_some_and(|met| met.triangle == target.triangle),
            LobeChoice::Caustic(_) => met.is_some_and(|met| {
                self.caustics.is_some_and(|caustics| caustics.caustics.may_show(met.triangle))
            }),
            LobeChoice::Material | LobeChoice::Nothing => true,
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
        Some(SampleWeight { weight: pdf / (rest * pdf + density), is_aimed: density > 0.0 })
    }
}
