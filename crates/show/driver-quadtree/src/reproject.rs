//! Projects samples: computes the pixel where each lands, and how near to the eye its ray passes.
//!
//! Invariant: positions are relative to the eye, in double precision, before any subtraction. So
//! sections far from the origin lose no precision.

use crate::bins::{FAR, depth_bin};
use crate::sums::NEAR_CLASSES;
use glam::DVec3;
use holo_display::{Camera, DistanceTable, PlacedSection};
use holo_picture::Clip;
use holo_section::{CellPair, Sample, distance};

/// A sample is aligned if its ray passes the eye within this share of the sample's distance. The
/// angle between this ray and the eye's own ray is then below 5.7 degrees.
const ALIGNED: f64 = 0.1;
/// Weight of a ray that passes within its own footprint of the eye.
pub(crate) const FULL_WEIGHT: u32 = 64;
/// Least weight of a ray.
const LEAST_WEIGHT: u32 = 8;
/// Distance at which the class of nearness of a sample that hit nothing is determined, in diagonals
/// of its section. The nearest class is then within the footprint at one diagonal.
const FAR_DIAGONALS: f64 = 8.0;
/// Resolution of places in a pixel, along each side.
const PLACES: f64 = 256.0;

/// The pixel, depth and weight of a sample in a view.
pub(crate) struct Landing {
    /// Columns from the left and rows from the top.
    pub column: usize,
    pub row: usize,
    /// Place in the pixel, in 256ths from its left and from its top.
    pub within: [u8; 2],
    /// Distance from the eye, scene units; infinite if the sample hit nothing.
    pub depth: f32,
    /// Depth bin of that distance.
    pub bin: u16,
    /// Weight by nearness of the ray to the eye, 8 to 64.
    pub weight: u32,
    /// Class of nearness as in [`Sums::near`](crate::sums::BinSums::near); `None` if not near.
    pub near: Option<usize>,
    /// True if the ray looks in nearly the same direction as the eye, and begins at the eye or
    /// behind it.
    pub is_aligned: bool,
    /// True if the sample lies beyond the view's aft clipping surface and so is drawn black.
    pub is_black: bool,
}

/// Projects the samples of one beam.
pub(crate) struct BeamProjector<'a> {
    entry: (DVec3, DVec3, DVec3),
    exit: (DVec3, DVec3, DVec3),
    diagonal: f64,
    distances: &'a DistanceTable,
    camera: &'a Camera,
    size: (f64, f64),
    /// True if the beam begins ahead of an eye that is in another section. Rays of such a beam do
    /// not see objects between the eye and the wall where they begin.
    begins_ahead: bool,
}

impl<'a> BeamProjector<'a> {
    pub fn new(
        section: &PlacedSection,
        pair: CellPair,
        camera: &'a Camera,
        size: (u32, u32),
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
            size: (f64::from(size.0), f64::from(size.1)),
        }
    }

    /// Returns where a sample lands. `None` if its surface is behind the eye, before the fore
    /// clipping surface or outside the picture. Also `None` if its ray comes towards the eye. It
    /// then hits a surface that faces away from the eye, such as the other side of a wall.
    #[inline(always)]
    pub fn land(&self, sample: &Sample) -> Option<Landing> {
        let [eu, ev, xu, xv] = sample.coords.0.map(f64::from);
        let entry = self.entry.0 + self.entry.1 * eu + self.entry.2 * ev;
        let exit = self.exit.0 + self.exit.1 * xu + self.exit.2 * xv;
        let along = exit - entry;
        let length_squared = along.length_squared();
        let code = sample.distance_code();
        let hits = code != distance::NOTHING_HIT;
        let point = if hits {
            entry + along * (self.distances.of(code) * self.diagonal / length_squared.sqrt())
        } else if self.has_one_eye() {
            // The sky is seen in the same direction from everywhere.
            along
        } else {
            // In a parallel view, the ray counts where it leaves the section.
            exit
        };
        let (x, y) = self.project(point)?;
        let eye = self.camera.eye_of(point);
        let distance_squared = (point - eye).length_squared();
        let miss_squared = (entry - eye).cross(along).length_squared() / length_squared;
        let is_along = miss_squared <= ALIGNED * ALIGNED * distance_squared;
        if !self.is_visible(hits, is_along, point, along) {
            return None;
        }
        let is_black = self.is_black(hits, point)?;
        let footprint = |distance_squared| self.camera.pixel_width.squared_at(distance_squared);
        let (own_footprint, judged_footprint) = if hits {
            (footprint(distance_squared), footprint(distance_squared))
        } else {
            (f64::INFINITY, footprint((FAR_DIAGONALS * self.diagonal).powi(2)))
        };
        let is_shown = hits && !is_black;
        let near = near_class(miss_squared / judged_footprint);
        Some(Landing {
            column: x as usize,
            row: y as usize,
            within: [x, y].map(|at| (at.fract() * PLACES) as u8),
            depth: if is_shown { (distance_squared as f32).sqrt() } else { f32::INFINITY },
            bin: if is_shown { depth_bin(distance_squared) } else { FAR },
            weight: nearness_weight(miss_squared / own_footprint),
            // The sky looks the same from everywhere.
            is_aligned: (!hits || is_along) && !self.begins_ahead,
            is_black,
            near: near.filter(|_| !self.begins_ahead),
        })
    }

    fn has_one_eye(&self) -> bool {
        self.camera.pixel_width.grows
    }

    /// Returns whether the view can see the point, or the sky, that a ray hit. An aligned ray that
    /// comes towards the eye hits the back of a surface. A parallel view sees the sky only along
    /// rays that are parallel to the view.
    #[inline(always)]
    fn is_visible(&self, hits: bool, is_along: bool, point: DVec3, along: DVec3) -> bool {
        let sight_along = (if self.has_one_eye() { point } else { DVec3::Z }).dot(along);
        if hits {
            return !(is_along && sight_along < 0.0);
        }
        let least = (1.0 - ALIGNED * ALIGNED) * along.length_squared();
        self.has_one_eye() || sight_along * sight_along >= least
    }

    /// Returns whether the view's aft clipping surface makes a point black, or the sky. `None`
    /// before the fore clipping surface.
    #[inline(always)]
    fn is_black(&self, hits: bool, point: DVec3) -> Option<bool> {
        if !hits {
            return Some(self.camera.clips_sky());
        }
        match self.camera.clip(point) {
            Clip::Before => None,
            clip => Some(clip == Clip::Beyond),
        }
    }

    /// Returns the place in the picture, in pixels, of a point in camera coordinates. `None`
    /// outside the picture and behind the eye.
    #[inline(always)]
    fn project(&self, point: DVec3) -> Option<(f64, f64)> {
        let camera = self.camera;
        let (x, y) = if camera.is_perspective() {
            let inverse = 1.0 / point.z;
            let x = camera.centre.0 + camera.focal.0 * point.x * inverse;
            (x, camera.centre.1 - camera.focal.1 * point.y * inverse)
        } else {
            camera.project(point)?
        };
        let is_ahead = point.z > 0.0 || !camera.is_perspective();
        // Also refuses NaN.
        let is_inside = x >= 0.0 && x < self.size.0 && y >= 0.0 && y < self.size.1;
        (is_ahead && is_inside).then_some((x, y))
    }
}

/// Returns the class of nearness of a ray that misses the eye by r radii, given r². Class n is
/// within 1/2ⁿ of the radius.
#[inline(always)]
fn near_class(miss_in_radii_squared: f64) -> Option<usize> {
    [1.0 / 64.0, 1.0 / 16.0, 1.0 / 4.0, 1.0]
        .iter()
        .position(|&bound| miss_in_radii_squared <= bound)
        .map(|class| NEAR_CLASSES - 1 - class)
}

/// Returns the weight of a ray that misses the eye by r footprints, given r². It is 64 up to r = 1,
/// then falls as 1/√r to 8 at r = 64.
///
/// In the paper, the nearer ray replaces the other (§2.4.2). Replacement suits samples without
/// noise. Nearly all rays of a batch miss the eye by tens of footprints, and about 2 % pass near
/// it. If these had 64 times the weight of others, the mean would be as noisy as that of 6 % of the
/// samples. With this law it is as noisy as that of 57 %.
#[inline(always)]
fn nearness_weight(miss_in_footprints_squared: f64) -> u32 {
    // The exponent is the logarithm of r² to base 2. 1/√r falls by 2^(1/4) while r² doubles.
    const FALL: [u32; 12] = [59, 49, 42, 35, 29, 25, 21, 17, 15, 12, 10, 9];
    let bits = (miss_in_footprints_squared as f32).to_bits();
    let doublings = (bits >> 23).saturating_sub(127) as usize;
    if miss_in_footprints_squared <= 1.0 {
        return FULL_WEIGHT;
    }
    FALL.get(doublings).copied().unwrap_or(LEAST_WEIGHT)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use holo_picture::{View, ViewKind, ViewSpec};
    use holo_section::{BeamId, RayCoords, Section, SectionSpec, ViewClass};

    fn room() -> Section {
        Section::new(SectionSpec {
            origin: [0.0; 3],
            axes: [[4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]],
            grid: [3; 3],
            class: ViewClass::Interior,
            obstructions: true,
        })
        .unwrap()
    }

    fn view(kind: ViewKind, vh: f64, size: (u32, u32)) -> View {
        let spec = ViewSpec {
            kind: Some(kind),
            vp: Some(DVec3::new(1.0, 1.5, 1.4)),
            vd: Some(DVec3::X),
            vu: Some(DVec3::Z),
            vh: Some(vh),
            ..ViewSpec::default()
        };
        spec.resolve(size).unwrap().0
    }

    #[test]
    fn samples_land_where_the_view_sees_them() {
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
            let camera = Camera::new(&view(kind, vh, size), size);
            let placed = PlacedSection::new(&section, &camera);
            let mut landed = [0; 2];
            for beam in 0..section.beam_count() {
                let pair = section.cells(BeamId(beam)).unwrap();
                let projector = BeamProjector::new(&placed, pair, &camera, size, &distances);
                let code =
                    if beam % 5 == 0 { distance::NOTHING_HIT } else { (random() % 3000) as u16 };
                let coords = RayCoords(random().to_le_bytes());
                let sample = Sample::from_codes(coords, [90; 4], code);
                let Some(landing) = projector.land(&sample) else { continue };
                // The section's own words for what the sample saw.
                let ray = section.ray(pair, sample.coords);
                let hits = code != distance::NOTHING_HIT;
                let end = ray.origin + ray.direction * sample.distance(section.diagonal());
                let seen = if hits { end - camera.eye } else { ray.direction };
                let (x, y) = camera.project(camera.to_camera(seen)).unwrap();
                let off = [x - landing.column as f64 - 0.5, y - landing.row as f64 - 0.5];
                let is_at = off.iter().all(|off| off.abs() < 0.5 + 1e-3);
                // A parallel view has no place for a direction.
                assert!(is_at || !hits && kind == ViewKind::Parallel, "{kind:?}: {x} {y}");
                landed[usize::from(hits)] += 1;
            }
            // Few rays go along a parallel view.
            let are_enough = landed[0] > 20 || kind == ViewKind::Parallel;
            assert!(landed[1] > 20 && are_enough, "{kind:?}: {landed:?}");
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
            // Each step covers a doubling of r², so values are within 2^(1/8) of the law, and whole
            // numbers.
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
