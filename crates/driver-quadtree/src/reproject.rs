//! Where samples land in a picture, and how near to the eye their rays pass.
//!
//! Invariant: everything that does not change within a beam is worked out once for it; positions are relative to the eye,
//! in double precision, before anything is subtracted, so sections far from the origin lose nothing.

use holo_display::{Camera, DistanceTable, PlacedSection};
use crate::bins::{FAR, depth_bin};
use crate::sums::NEAR_CLASSES;
use crate::wide::NARROW;
use glam::DVec3;
use holo_picture::Clip;
use holo_section::{CellIndex, CellPair, Sample, Section, distance};

/// Samples projected together, and whose sums are fetched together: they lie anywhere, and one after another each would wait for memory
/// twice.
pub(super) const BATCH: usize = 32;
/// Steps of a ray coordinate in a cell.
const STEPS: f64 = 256.0;
/// Weight of a ray that passes within its own footprint of the eye.
pub(super) const FULL_WEIGHT: u32 = 64;
/// What hit nothing counts as so many diagonals of the section away when its nearness is judged: the nearest class is then
/// within the footprint at one diagonal.
const FAR_DIAGONALS: f64 = 8.0;
/// Weight that every ray has at least.
const LEAST_WEIGHT: u32 = 8;

/// Where a sample lands.
pub(crate) struct Landing {
    /// Pixels from the left and from the top.
    pub column: usize,
    pub row: usize,
    /// Where in the pixel, in its 256ths from its left and from its top.
    pub within: [u8; 2],
    /// Distance from the eye; infinite for what is shown as nothing.
    pub depth: f32,
    pub bin: u16,
    /// 8 to 64, by nearness of the ray to the eye.
    pub weight: u32,
    /// How near the eye the ray passes, as [`Summed::near`](crate::sums::Summed::near) counts it; None: not near.
    pub near: Option<usize>,
    /// Whether the ray looks as the eye does ([`NARROW`]).
    pub narrow: bool,
    /// Whether it is beyond the aft clipping surface, and so black.
    pub is_black: bool,
}

/// Samples projected together. Of what there are fewer samples than room for, the rest is of no meaning.
pub(crate) struct Projected {
    coords: [[f64; BATCH]; 4],
    /// 0: it met nothing; else 1.
    hits: [f64; BATCH],
    /// From the ray's entry point.
    distance: [f64; BATCH],
    /// What was seen, and where: in camera coordinates, and in pixels of a perspective view.
    point: [[f64; BATCH]; 3],
    x: [f64; BATCH],
    y: [f64; BATCH],
    /// From the eye to the point.
    distance_squared: [f64; BATCH],
    /// From the eye to the ray.
    miss_squared: [f64; BATCH],
    /// Of the ray between its cells: its squared length, and its product with where the eye sees the point.
    length_squared: [f64; BATCH],
    sight_along: [f64; BATCH],
}

impl Projected {
    pub fn new() -> Self {
        let none = [0.0; BATCH];
        Self {
            coords: [none; 4],
            hits: none,
            distance: none,
            point: [none; 3],
            x: none,
            y: none,
            distance_squared: none,
            miss_squared: none,
            length_squared: none,
            sight_along: none,
        }
    }
}

/// A beam's set-up for reprojection.
pub(crate) struct BeamProjector<'a> {
    entry: (DVec3, DVec3, DVec3),
    exit: (DVec3, DVec3, DVec3),
    diagonal: f64,
    distances: &'a DistanceTable,
    camera: &'a Camera,
    is_perspective: bool,
    focal: (f64, f64),
    centre: (f64, f64),
    radius_squared: Option<f64>,
    size: (f64, f64),
    /// Whether its rays begin ahead of an eye that is in another section: what the eye sees before that they may pass by.
    begins_ahead: bool,
}

impl<'a> BeamProjector<'a> {
    pub fn new(
        section: &PlacedSection,
        pair: CellPair,
        camera: &'a Camera,
        size: (u32, u32),
        viewpoint_radius: Option<f64>,
        distances: &'a DistanceTable,
    ) -> Self {
        let (entry, exit) = (section.cell(pair.entry), section.cell(pair.exit));
        Self {
            begins_ahead: section.is_elsewhere && entry.0.dot(exit.0 - entry.0) > 0.0,
            entry,
            exit,
            diagonal: section.diagonal,
            distances,
            camera,
            is_perspective: camera.is_perspective(),
            focal: camera.focal,
            centre: camera.centre,
            radius_squared: viewpoint_radius.map(|radius| radius * radius),
            size: (f64::from(size.0), f64::from(size.1)),
        }
    }

    /// Projects up to [`BATCH`] samples, all of them alike and without branches: side by side. In packets of 21 or more a sample is summed in a
    /// tenth to a fifth less time than one by one; a single one takes half as much again, packets of ten as long. With room for eight, single
    /// ones took a third as much again, and those of 21 or more gained half as much.
    #[inline(always)]
    pub fn project(&self, samples: &[Sample], to: &mut Projected) {
        for (at, sample) in samples.iter().enumerate().take(BATCH) {
            for (all, own) in to.coords.iter_mut().zip(sample.coords.0) {
                all[at] = f64::from(own);
            }
            let code = sample.distance_code();
            to.hits[at] = if code == distance::NOTHING_HIT { 0.0 } else { 1.0 };
            to.distance[at] = self.distances.of(code) * self.diagonal;
        }
        let grows = self.camera.pixel_width.grows;
        let (entry_from, entry_u, entry_v) = self.entry;
        let (exit_from, exit_u, exit_v) = self.exit;
        let (focal, centre) = (self.focal, self.centre);
        for at in 0..BATCH {
            let [eu, ev, xu, xv] =
                [to.coords[0][at], to.coords[1][at], to.coords[2][at], to.coords[3][at]];
            let entry = entry_from + entry_u * eu + entry_v * ev;
            let exit = exit_from + exit_u * xu + exit_v * xv;
            let along = exit - entry;
            let length_squared = along.length_squared();
            // A ray that hit nothing sees the same in its direction from everywhere: a parallel view sees it where it leaves the section.
            let hits = to.hits[at] != 0.0;
            let from = if hits | !grows { 1.0 } else { 0.0 };
            let part = to.distance[at] / length_squared.sqrt();
            let part = if hits { part } else { 1.0 };
            let point = entry * from + along * part;
            let inverse_depth = 1.0 / point.z;
            to.x[at] = centre.0 + focal.0 * point.x * inverse_depth;
            to.y[at] = centre.1 - focal.1 * point.y * inverse_depth;
            let flat = if grows { 0.0 } else { 1.0 };
            let eye = DVec3::new(point.x * flat, point.y * flat, 0.0);
            to.distance_squared[at] = (point - eye).length_squared();
            to.miss_squared[at] = (entry - eye).cross(along).length_squared() / length_squared;
            let sight = if grows { point } else { DVec3::Z };
            to.sight_along[at] = sight.dot(along);
            to.length_squared[at] = length_squared;
            to.point[0][at] = point.x;
            to.point[1][at] = point.y;
            to.point[2][at] = point.z;
        }
    }

    /// Where a sample lands that is the one of this number of those projected. None when its surface is behind the eye, before the fore
    /// clipping surface or outside the picture, or when its ray comes towards the eye: what such a ray meets is turned away from it, as
    /// the other side of a wall is.
    #[inline(always)]
    pub fn land(&self, projected: &Projected, at: usize) -> Option<Landing> {
        let point = DVec3::from_array(projected.point.map(|all| all[at]));
        let (mut x, mut y) = (projected.x[at], projected.y[at]);
        if !self.is_perspective {
            (x, y) = self.camera.project(point)?;
        }
        // Also refuses NaN.
        let is_ahead = point.z > 0.0 || !self.is_perspective;
        if !(is_ahead && x >= 0.0 && x < self.size.0 && y >= 0.0 && y < self.size.1) {
            return None;
        }
        let hits = projected.hits[at] != 0.0;
        let (distance_squared, miss_squared) =
            (projected.distance_squared[at], projected.miss_squared[at]);
        let sight_along = projected.sight_along[at];
        let is_along = miss_squared <= NARROW * NARROW * distance_squared;
        if hits && is_along && sight_along < 0.0 {
            return None;
        }
        // What a parallel view does not look along is nowhere in it.
        let grows = self.camera.pixel_width.grows;
        let is_level =
            sight_along * sight_along >= (1.0 - NARROW * NARROW) * projected.length_squared[at];
        if !(hits || grows || is_level) {
            return None;
        }
        let is_black = match self.camera.clip(point) {
            // What met nothing has no place but a direction.
            _ if !hits => self.camera.clips_sky(),
            Clip::Before => return None,
            clip => clip == Clip::Beyond,
        };
        let footprint_squared =
            if hits { self.camera.pixel_width.squared_at(distance_squared) } else { f64::INFINITY };
        let shown = hits && !is_black;
        Some(Landing {
            column: x as usize,
            row: y as usize,
            within: [x, y].map(|at| ((at - f64::from(at as u32)) * STEPS) as u8),
            depth: if shown { (distance_squared as f32).sqrt() } else { f32::INFINITY },
            bin: if shown { depth_bin(distance_squared) } else { FAR },
            weight: nearness_weight(miss_squared / footprint_squared),
            // What hit nothing is seen from everywhere alike.
            narrow: (!hits || is_along) && !self.begins_ahead,
            is_black,
            near: near_class(match self.radius_squared {
                _ if self.begins_ahead => f64::INFINITY,
                Some(radius_squared) => miss_squared / radius_squared,
                None if hits => miss_squared / footprint_squared,
                None => {
                    miss_squared
                        / self
                            .camera
                            .pixel_width
                            .squared_at((FAR_DIAGONALS * self.diagonal).powi(2))
                }
            }),
        })
    }
}

/// Class of nearness of a ray that misses the eye by r radii, given r²: class n within 1/2ⁿ of the radius.
#[inline(always)]
fn near_class(miss_in_radii_squared: f64) -> Option<usize> {
    [1.0 / 64.0, 1.0 / 16.0, 1.0 / 4.0, 1.0]
        .iter()
        .position(|&bound| miss_in_radii_squared <= bound)
        .map(|class| NEAR_CLASSES - 1 - class)
}

/// Weight of a ray that misses the eye by r footprints, given r².
///
/// 64 to r = 1, then falling as 1/√r to 8 at r = 64. The paper lets the nearer ray replace the other (§2.4.2), which is
/// right for samples without noise. Rays of a batch miss the eye by tens of footprints nearly all; had the few near ones
/// 64 times their weight, they would alone decide the mean: with 2 % of them near, it would be as noisy as 6 % of the
/// samples. With this law it is as noisy as 57 %.
#[inline(always)]
fn nearness_weight(miss_in_footprints_squared: f64) -> u32 {
    // The exponent is the logarithm of r² to base 2; r² doubles while 1/√r falls by 2^(1/4).
    const FALL: [u32; 12] = [59, 49, 42, 35, 29, 25, 21, 17, 15, 12, 10, 9];
    let bits = (miss_in_footprints_squared as f32).to_bits();
    let doublings = (bits >> 23).saturating_sub(127) as usize;
    if miss_in_footprints_squared <= 1.0 {
        return FULL_WEIGHT;
    }
    FALL.get(doublings).copied().unwrap_or(LEAST_WEIGHT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_cpu::Instructions;
    use holo_cpu::{Isa, Kernel};
    use crate::room;
    use holo_picture::{ViewKind, ViewSpec};
    use holo_section::{BeamId, RayCoords};

    struct Project<'a>(&'a BeamProjector<'a>, &'a [Sample]);

    impl Kernel for Project<'_> {
        type Output = Vec<Option<[u64; 8]>>;

        #[inline(always)]
        fn run(self) -> Self::Output {
            let mut projected = Projected::new();
            self.0.project(self.1, &mut projected);
            let bits =
                |Landing { column, row, within, depth, bin, weight, near, narrow, is_black }| {
                    let flags = u64::from(narrow) << 1 | u64::from(is_black);
                    let [across, down] = within.map(u64::from);
                    let near = near.map_or(9, |near| near as u64);
                    [
                        column as u64,
                        row as u64,
                        across << 8 | down,
                        depth.to_bits().into(),
                        bin.into(),
                        weight.into(),
                        near,
                        flags,
                    ]
                };
            (0..self.1.len()).map(|at| self.0.land(&projected, at).map(bits)).collect()
        }
    }

    #[test]
    fn samples_land_where_they_land_with_all_instructions_and_where_they_were_seen() {
        let (section, size, distances) = (room(), (40, 30), DistanceTable::new());
        let mut state = 5_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.rotate_left(13)
        };
        for (kind, vh) in [
            (ViewKind::Perspective, 70.0),
            (ViewKind::Parallel, 2.5),
            (ViewKind::Hemispherical, 170.0),
        ] {
            let (vp, vd, vu) = (DVec3::new(1.0, 1.5, 1.4), DVec3::X, DVec3::Z);
            let spec = ViewSpec {
                kind: Some(kind),
                vp: Some(vp),
                vd: Some(vd),
                vu: Some(vu),
                vh: Some(vh),
                ..ViewSpec::default()
            };
            let view = spec.resolve(size).unwrap().0;
            let camera = Camera::new(&view, size);
            let placed = PlacedSection::new(&section, &camera);
            let mut landed = [0; 2];
            for beam in (0..section.beam_count()).step_by(7) {
                let pair = section.cells(BeamId(beam)).unwrap();
                let projector = BeamProjector::new(&placed, pair, &camera, size, None, &distances);
                let samples: Vec<Sample> = (0..1 + beam as usize % BATCH)
                    .map(|number| {
                        let code = if number % 5 == 0 {
                            distance::NOTHING_HIT
                        } else {
                            (random() % 3000) as u16
                        };
                        Sample::from_codes(RayCoords(random().to_le_bytes()), [90; 4], code)
                    })
                    .collect();
                let expected = Project(&projector, &samples).run();
                for isa in
                    [Instructions::Avx2, Instructions::Avx512].into_iter().filter_map(Isa::new)
                {
                    assert_eq!(isa.run(Project(&projector, &samples)), expected, "{kind:?} {beam}");
                }
                for (sample, landing) in samples.iter().zip(expected) {
                    // What the sample saw, by the section's own words.
                    let ray = section.ray(pair, sample.coords);
                    let hits = sample.distance_code() != distance::NOTHING_HIT;
                    let seen = if hits {
                        ray.origin + ray.direction * sample.distance(section.diagonal())
                            - camera.eye
                    } else {
                        ray.direction
                    };
                    let Some([column, row, ..]) = landing else { continue };
                    let (x, y) = camera.project(camera.to_camera(seen)).unwrap();
                    let is_at = (x - column as f64 - 0.5).abs().max((y - row as f64 - 0.5).abs())
                        < 0.5 + 1e-3;
                    assert!(
                        is_at || !hits && kind == ViewKind::Parallel,
                        "{kind:?}: {x} {y} {column} {row}"
                    );
                    landed[usize::from(hits)] += 1;
                }
            }
            // Few rays go along a parallel view.
            assert!(
                landed[1] > 20 && (landed[0] > 20 || kind == ViewKind::Parallel),
                "{kind:?}: {landed:?}"
            );
        }
    }

    #[test]
    fn weight_falls_with_the_root_of_the_miss() {
        assert_eq!(nearness_weight(0.0), FULL_WEIGHT);
        assert_eq!(nearness_weight(1.0), FULL_WEIGHT);
        let mut last = FULL_WEIGHT;
        for step in 1..200 {
            let miss = 1.05_f64.powi(step);
            let weight = nearness_weight(miss * miss);
            assert!(weight <= last && weight >= LEAST_WEIGHT);
            // Steps are of a doubling of r²: within 2^(1/8) of the law, and whole numbers.
            let expected = (64.0 / miss.sqrt()).max(8.0);
            assert!(
                (f64::from(weight) / expected).log2().abs() < 0.2,
                "{miss}: {weight} {expected}"
            );
            last = weight;
        }
        assert_eq!(nearness_weight(f64::INFINITY), LEAST_WEIGHT);
        assert_eq!(nearness_weight(f64::NAN), LEAST_WEIGHT);
    }

    #[test]
    fn classes_of_nearness_halve() {
        let class = |miss: f64| near_class(miss * miss);
        assert_eq!(
            [class(1.01), class(0.9), class(0.4), class(0.2), class(0.1), class(0.0)],
            [None, Some(0), Some(1), Some(2), Some(3), Some(3)]
        );
        assert_eq!(near_class(f64::NAN), None);
    }
}
