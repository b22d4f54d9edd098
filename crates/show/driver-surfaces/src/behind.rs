//! Light of surfaces behind panes.
//!
//! A sample through a pane shows what is behind the pane and what the pane mirrors. The store holds
//! its whole radiance as light of the surface behind. Pictures add the mirrored light from its own
//! sums. So it is first subtracted from the sums of the squares behind the pane.
//!
//! Invariant: without panes, nothing is computed.

use crate::ambient::AmbientGuess;
use crate::estimate::LightSums;
use crate::filter::OfSquares;
use crate::light_store::{LEAST_REFLECTANCE, Sums, luminance};
use crate::squares::{SquareLayer, Squares};
use crate::view::SurfaceView;
use crate::visible::VisiblePoint;
use glam::Vec3;
use rayon::prelude::*;

/// Least share of light that a pane is taken to let pass, so that nothing is divided by 0.
const LEAST_PASSED: f32 = 0.01;

/// Turns the stored light of a square behind a pane into that of the surface alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BehindPane {
    /// Light that the pane lets pass or mirrors, relative to what it lets pass.
    share: Vec3,
    /// The mirrored light, as light of the surface behind.
    mirrored: Vec3,
}

/// The mirrored light in each square. Empty without panes.
#[derive(Default)]
pub(crate) struct BehindPanes(Vec<Option<BehindPane>>);

impl BehindPane {
    /// Returns the light of the surface alone, which noise may make negative.
    pub fn light(&self, light: Vec3) -> Vec3 {
        self.share * light - self.mirrored
    }

    fn lit(&self, lit: &LightSums) -> LightSums {
        if lit.count <= 0.0 {
            return *lit;
        }
        let (before, light) = (lit.mean(), self.light(lit.mean()));
        let bright = |light: Vec3| luminance(light.to_array());
        let variance = (lit.square / lit.count - bright(before) * bright(before)).max(0.0);
        let share = bright(self.share);
        let square = share * share * variance + bright(light) * bright(light);
        LightSums { light: lit.count * light, square: lit.count * square, ..*lit }
    }
}

impl BehindPanes {
    /// Finds what panes mirror into each square. `mirrored` are the surfaces that they mirror
    /// there, and `in_panes` has their light. If a pane mirrors a lamp into a square, the square
    /// loses its `sums`, because they depend on a few very bright samples.
    pub fn new(
        view: &SurfaceView,
        (squares, mirrored): (&Squares, &[VisiblePoint]),
        (in_panes, around): (&SquareLayer, &AmbientGuess),
        sums: &mut OfSquares,
    ) -> BehindPanes {
        let of_square = |number: usize| {
            let (seen, mirrored) = (&squares.seen[number], &mirrored[number]);
            let way = view.way(seen);
            if !seen.is_surface() || way.is_mirrored || way.pane <= 0.0 {
                return None;
            }
            let light = view.light_at(around, Some(in_panes), squares.middle(number), mirrored);
            let (scale, radiance) = view.paint(mirrored);
            let passes = Vec3::from_array(way.share).max(Vec3::splat(LEAST_PASSED));
            let through = Vec3::from_array(view.paint(seen).0).max(passes * LEAST_REFLECTANCE);
            let shown =
                Vec3::from_array(scale) * light.light + Vec3::from_array(radiance) / view.unit();
            let share = Vec3::ONE + way.pane / passes;
            Some(BehindPane { share, mirrored: shown / through })
        };
        for sums in std::iter::once(&mut sums.towards_eye).chain(&mut sums.from_all) {
            for ((sums, seen), behind) in sums.iter_mut().zip(mirrored).zip(&squares.seen) {
                let way = view.way(behind);
                if way.pane > 0.0 && !way.is_mirrored && view.way(seen).to_lamp.is_finite() {
                    *sums = Sums::default();
                }
            }
        }
        BehindPanes((0..squares.seen.len()).into_par_iter().map(of_square).collect())
    }

    /// Returns what to take out of a square.
    pub fn of(&self, square: usize) -> Option<&BehindPane> {
        self.0.get(square)?.as_ref()
    }

    /// Returns a square's sums without mirrored light.
    pub fn taken_out(&self, square: usize, lit: LightSums) -> LightSums {
        self.of(square).map_or(lit, |behind| behind.lit(&lit))
    }
}
