//! Determines whether a beam sees anything, once for each beam, before its first ray is traced.
//!
//! Invariant: no ray of an unseen beam hits anything beyond the point where its section lets rays
//! begin.

use std::sync::atomic::{AtomicU64, Ordering};

use holo_raycast::{Raycaster, Shaft};
use holo_section::{BeamId, CellIndex, CellPair, DVec3, Section, ViewClass};

/// Number of stored answers, of 8 bytes each. A view has thousands of beams, and most sections have
/// fewer than this.
const ANSWERS: usize = 1 << 20;

/// Answers for beams, shared by all threads. Two beams may share a slot. The answer that was
/// overwritten is computed again.
pub struct UnseenCache(Box<[AtomicU64]>);

impl UnseenCache {
    /// Returns a cache without answers.
    pub fn new() -> UnseenCache {
        UnseenCache((0..ANSWERS).map(|_| AtomicU64::new(0)).collect())
    }

    /// Returns true if no ray of the beam hits anything.
    pub fn is_unseen(
        &self,
        raycaster: &Raycaster,
        section: &Section,
        number: u16,
        beam: BeamId,
    ) -> bool {
        let Some(pair) = section.cells(beam) else { return false };
        // A section has 16 bits and a beam is below 2²⁹. A name is never 0, and its lowest bit is
        // free for the answer.
        let name = (u64::from(number) << 40 | beam.0) << 2 | 2;
        let slot = name.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - ANSWERS.trailing_zeros());
        let Some(slot) = self.0.get(slot as usize) else { return false };
        // A slot is one word, so that the order between threads does not matter.
        let known = slot.load(Ordering::Relaxed);
        if known & !1 == name {
            return known & 1 == 1;
        }
        let unseen = !raycaster.may_hit(&shaft(section, pair));
        slot.store(name | u64::from(unseen), Ordering::Relaxed);
        unseen
    }
}

/// Returns the shaft of all rays of a beam, from the points where its section lets them begin.
pub fn shaft(section: &Section, pair: CellPair) -> Shaft {
    let spec = section.spec();
    // The same rule as in `Section::trace_start`.
    let between = spec.obstructions || spec.class == ViewClass::Exterior;
    Shaft { from: corners(section, pair.entry), through: corners(section, pair.exit), between }
}

fn corners(section: &Section, cell: CellIndex) -> [DVec3; 4] {
    let grid = section.spec().grid;
    let (u, v) = cell.directions();
    [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
        let mut local = DVec3::ZERO;
        local[cell.axis()] = f64::from(cell.side());
        local[u] = f64::from(u32::from(cell.u) + du) / f64::from(grid[u]);
        local[v] = f64::from(u32::from(cell.v) + dv) / f64::from(grid[v]);
        section.local_to_world(local)
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use holo_scene::{Material, Scene};
    use holo_section::{SectionSpec, seed};

    use super::*;

    /// A deterministic stream of random numbers.
    struct Random(u64);

    impl Random {
        fn bits(&mut self) -> u64 {
            self.0 += 1;
            seed(3, BeamId(self.0), 0)
        }

        fn unit(&mut self) -> f64 {
            (self.bits() >> 11) as f64 / (1u64 << 53) as f64
        }

        fn vector(&mut self, size: f64) -> DVec3 {
            DVec3::new(self.unit() - 0.5, self.unit() - 0.5, self.unit() - 0.5) * size
        }
    }

    fn raycaster(triangles: &[[DVec3; 3]]) -> Raycaster {
        let positions: Vec<_> = triangles.iter().flatten().copied().collect();
        let indices: Vec<[u32; 3]> =
            (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let materials = vec![Material::grey("grey")];
        let (scene, _) =
            Scene::from_world(&positions, &indices, &vec![0; triangles.len()], materials, [0.0; 3])
                .unwrap();
        Raycaster::build(Arc::new(scene)).unwrap()
    }

    /// Returns a section of about `size` around `centre`. Half of them are sheared.
    fn section(
        random: &mut Random,
        centre: DVec3,
        size: f64,
        class: ViewClass,
        obstructions: bool,
    ) -> Section {
        loop {
            let shear = if random.bits().is_multiple_of(2) { 0.6 * size } else { 0.0 };
            let axes = DVec3::AXES
                .map(|axis| axis * (size * (0.5 + random.unit())) + random.vector(shear));
            let origin = centre - (axes[0] + axes[1] + axes[2]) / 2.0;
            let grid = [0; 3].map(|_| 1 + (random.bits() % 5) as u32);
            let axes = axes.map(|axis| axis.to_array());
            let spec = SectionSpec { origin: origin.to_array(), axes, grid, class, obstructions };
            if let Ok(section) = Section::new(spec) {
                return section;
            }
        }
    }

    /// Returns how many of the first `rays` rays of a beam hit something.
    fn hits(raycaster: &Raycaster, section: &Section, beam: BeamId, rays: u32) -> usize {
        let sampler = section.beam_sampler(0, beam, None).unwrap();
        let meets = |number: &u32| {
            let ray = sampler.ray(sampler.coords(*number));
            let start = ray.origin + ray.direction * section.trace_start(&ray);
            raycaster
                .localize(start, ray.direction)
                .is_some_and(|(ray, _)| raycaster.nearest(&ray).is_some())
        };
        (0..rays).filter(meets).count()
    }

    #[test]
    fn an_unseen_beam_has_no_sample_that_hits_anything() {
        let mut random = Random(0);
        let cache = UnseenCache::new();
        let (mut unseen, mut seen, mut doubtful) = (0, 0, 0);
        for round in 0..80u16 {
            // Scenes have all sizes and places, from a thimble far away to a city.
            let size = 10f64.powf(random.unit() * 6.0 - 3.0);
            let away = size * 10f64.powf(random.unit() * 4.0);
            let place = random.vector(away);
            let count = 1 + random.bits() % 30;
            let scatter = size * (0.3 + 3.0 * random.unit());
            let triangles: Vec<_> = (0..count)
                .map(|_| {
                    let corner = place + random.vector(scatter);
                    [corner, corner + random.vector(size * 0.4), corner + random.vector(size * 0.4)]
                })
                .collect();
            let raycaster = raycaster(&triangles);
            let class = if round % 2 == 0 { ViewClass::Interior } else { ViewClass::Exterior };
            let section = section(&mut random, place, size, class, round % 3 == 0);
            for _ in 0..60 {
                let beam = BeamId(random.bits() % section.beam_count());
                let is_unseen = cache.is_unseen(&raycaster, &section, round, beam);
                let hits = hits(&raycaster, &section, beam, if is_unseen { 256 } else { 4096 });
                assert!(
                    !is_unseen || hits == 0,
                    "{hits} rays of beam {beam:?} hit something: {:?}",
                    section.spec()
                );
                assert_eq!(
                    cache.is_unseen(&raycaster, &section, round, beam),
                    is_unseen,
                    "asked again"
                );
                unseen += usize::from(is_unseen);
                seen += usize::from(hits > 0);
                doubtful += usize::from(!is_unseen && hits == 0);
            }
        }
        assert!(unseen > 800 && seen > 800, "{unseen} unseen, {seen} seen");
        assert!(
            doubtful * 5 < unseen,
            "{doubtful} beams without a hit are not found, {unseen} are"
        );
    }

    #[test]
    fn in_a_closed_room_every_beam_sees_something() {
        let corner = |index: usize| {
            DVec3::new((index & 1) as f64, (index >> 1 & 1) as f64, (index >> 2) as f64) * 4.0
        };
        let quads =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let triangles: Vec<_> = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .map(|t| t.map(corner))
            .collect();
        let raycaster = raycaster(&triangles);
        let axes = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.5, 0.0, 2.0]];
        for obstructions in [false, true] {
            let spec = SectionSpec {
                origin: [1.0; 3],
                axes,
                grid: [3, 2, 4],
                class: ViewClass::Interior,
                obstructions,
            };
            let section = Section::new(spec).unwrap();
            let cache = UnseenCache::new();
            let all = (0..section.beam_count()).map(BeamId);
            assert_eq!(
                all.filter(|&beam| cache.is_unseen(&raycaster, &section, 0, beam)).count(),
                0
            );
        }
    }

    #[test]
    fn rays_that_begin_at_the_exit_do_not_see_objects_inside() {
        let triangle =
            [DVec3::new(0.4, 0.4, 0.5), DVec3::new(0.6, 0.4, 0.5), DVec3::new(0.5, 0.6, 0.5)];
        let raycaster = raycaster(&[triangle]);
        let with = |class, obstructions| {
            let spec = SectionSpec {
                origin: [0.0; 3],
                axes: DVec3::AXES.map(|a| a.to_array()),
                grid: [4; 3],
                class,
                obstructions,
            };
            let section = Section::new(spec).unwrap();
            let cache = UnseenCache::new();
            let all = (0..section.beam_count()).map(BeamId);
            all.filter(|&beam| !cache.is_unseen(&raycaster, &section, 0, beam)).count()
        };
        assert_eq!(with(ViewClass::Interior, false), 0);
        let seen = with(ViewClass::Interior, true);
        assert!(seen > 0);
        assert_eq!(with(ViewClass::Exterior, false), seen);
    }
}
