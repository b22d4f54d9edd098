//! The brightest parts of a probe as lights that cast shadows (Larson & Simmons 1999, §2.4.6).
//!
//! Invariant: the lights and the rest of the probe together have its light. Each texel is in one
//! light, or in the rest.

use glam::Vec3;
use holo_picture::relative_luminance;

use crate::probe::LightProbe;
use crate::room::Room;

/// A texel is bright if its luminance is this many times the mean of all directions.
const BRIGHT: f32 = 2.5;

/// Rounds in which texels choose the nearer one of two halves of a light.
const ROUNDS: usize = 4;

/// Greatest factor by which a light is stronger at a point than at the probe's centre.
const MOST_NEARER: f32 = 16.0;

/// A part of a light, as small as a texel of the probe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPoint {
    /// Unit direction from the probe's centre.
    pub direction: Vec3,
    /// Relative to the centre; `None` if it is infinitely far away.
    pub place: Option<Vec3>,
    /// Unit normal of the surface that emits; 0 if it emits the same in all directions.
    normal: Vec3,
    /// Irradiance at the centre of a surface that faces it.
    pub irradiance: Vec3,
}

/// Light that arrives at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arriving {
    /// Unit direction to its source.
    pub direction: Vec3,
    /// Distance of the source; may be infinite.
    pub distance: f64,
    /// Irradiance of a surface that faces it.
    pub irradiance: Vec3,
}

impl LightPoint {
    /// Returns what arrives at a point, given relative to the probe's centre.
    #[inline]
    pub(crate) fn arriving(&self, point: Vec3) -> Arriving {
        let Some(place) = self.place else {
            let (direction, irradiance) = (self.direction, self.irradiance);
            return Arriving { direction, distance: f64::INFINITY, irradiance };
        };
        let way = place - point;
        let distance = way.length().max(f32::MIN_POSITIVE);
        let direction = way / distance;
        // Seen from the point, the same surface is nearer, and turned.
        let mut nearer = place.length_squared() / (distance * distance);
        if self.normal != Vec3::ZERO {
            let turned = -self.normal.dot(direction) / (-self.normal.dot(self.direction)).max(0.1);
            nearer *= turned.max(0.0);
        }
        let irradiance = self.irradiance * nearer.min(MOST_NEARER);
        Arriving { direction, distance: f64::from(distance), irradiance }
    }
}

/// A group of neighbouring bright parts.
#[derive(Clone, Debug)]
pub(crate) struct ProbeLight {
    points: Vec<LightPoint>,
    /// Sums of the points' luminances, in their order.
    sums: Vec<f32>,
    /// All of them in one point, for the shadows of a moving object.
    pub middle: LightPoint,
    /// Greatest distance of a point from the middle; of directions, if the light is infinitely far.
    pub spread: f32,
    /// True if only the model of the room knows it, so that it may be hidden at the centre.
    pub is_unseen: bool,
}

impl ProbeLight {
    fn new(points: Vec<LightPoint>) -> ProbeLight {
        let luminance = |point: &LightPoint| relative_luminance(point.irradiance.to_array());
        let mut sums: Vec<f32> = points.iter().map(luminance).collect();
        let whole: f32 = sums.iter().sum::<f32>().max(f32::MIN_POSITIVE);
        let mean = |of: &dyn Fn(&LightPoint) -> Vec3| {
            points.iter().zip(&sums).map(|(point, share)| of(point) * *share).sum::<Vec3>() / whole
        };
        let direction = mean(&|point| point.direction).normalize_or(Vec3::Z);
        let is_near = points.iter().all(|point| point.place.is_some());
        let place = is_near.then(|| mean(&|point| point.place.unwrap_or_default()));
        let middle = LightPoint {
            direction: place.and_then(Vec3::try_normalize).unwrap_or(direction),
            place,
            normal: mean(&|point| point.normal).normalize_or_zero(),
            irradiance: points.iter().map(|point| point.irradiance).sum(),
        };
        let apart = |point: &LightPoint| match (point.place, middle.place) {
            (Some(place), Some(middle)) => place.distance(middle),
            _ => point.direction.distance(middle.direction),
        };
        let spread = points.iter().map(apart).fold(0.0, f32::max);
        let mut sum = 0.0;
        for share in &mut sums {
            sum += *share;
            *share = sum;
        }
        ProbeLight { points, sums, middle, spread, is_unseen: false }
    }

    /// Returns the light with another share of it from each direction.
    pub(crate) fn weighed(&self, share: impl Fn(Vec3) -> Vec3) -> ProbeLight {
        if self.is_unseen {
            return self.clone();
        }
        let weighed = |point: &LightPoint| {
            let irradiance = point.irradiance * share(point.direction);
            LightPoint { irradiance, ..*point }
        };
        ProbeLight::new(self.points.iter().map(weighed).collect())
    }

    /// Returns a light that no driver shows.
    pub(crate) fn unseen(direction: Vec3, place: Option<Vec3>, irradiance: Vec3) -> ProbeLight {
        let point = LightPoint { direction, place, normal: Vec3::ZERO, irradiance };
        ProbeLight { is_unseen: true, ..ProbeLight::new(vec![point]) }
    }

    /// Returns one of the light's points, chosen by a number in [0, 1), with the irradiance of all
    /// of them: the mean over all numbers is the light.
    #[inline]
    pub(crate) fn sample(&self, number: f32) -> LightPoint {
        let whole = self.sums.last().copied().unwrap_or_default();
        let at = self.sums.partition_point(|&sum| sum <= number * whole);
        let at = at.min(self.points.len() - 1);
        let before = if at > 0 { self.sums[at - 1] } else { 0.0 };
        let probability = (self.sums[at] - before) / whole;
        let mut point = self.points[at];
        if probability > 0.0 {
            point.irradiance /= probability;
        }
        point
    }

    /// Returns the flux by which lights are ranked, and how much a division would gain.
    fn gain(&self) -> f32 {
        self.sums.last().copied().unwrap_or_default() * self.angle().powi(2)
    }

    /// Returns about the angle within which the light is, from the centre, radians.
    pub(crate) fn angle(&self) -> f32 {
        let apart = |point: &LightPoint| point.direction.distance(self.middle.direction);
        self.points.iter().map(apart).fold(0.0, f32::max)
    }

    /// Divides the light into two, between the ends of its longest extent. `None` if it cannot be
    /// divided.
    fn halves(&self) -> Option<[ProbeLight; 2]> {
        let far = |from: Vec3| {
            let apart = |point: &LightPoint| point.direction.distance_squared(from);
            let points = self.points.iter();
            points.max_by(|a, b| apart(a).total_cmp(&apart(b))).map(|point| point.direction)
        };
        let first = far(self.middle.direction)?;
        let mut middles = [first, far(first)?];
        for _ in 0..ROUNDS {
            let mut sums = [Vec3::ZERO; 2];
            for point in &self.points {
                let weight = relative_luminance(point.irradiance.to_array());
                sums[nearer(point, middles)] += point.direction * weight;
            }
            for (middle, sum) in middles.iter_mut().zip(sums) {
                *middle = sum.normalize_or(*middle);
            }
        }
        let is_second = |point: &&LightPoint| nearer(point, middles) == 1;
        let (second, first): (Vec<&LightPoint>, Vec<&LightPoint>) =
            self.points.iter().partition(is_second);
        let half =
            |points: Vec<&LightPoint>| ProbeLight::new(points.into_iter().copied().collect());
        (!first.is_empty() && !second.is_empty()).then(|| [half(first), half(second)])
    }
}

/// Returns which of two directions a point is nearer to.
fn nearer(point: &LightPoint, [first, second]: [Vec3; 2]) -> usize {
    let apart = |middle: Vec3| point.direction.distance_squared(middle);
    usize::from(apart(second) < apart(first))
}

/// Returns at most `most` lights, and for each texel whether it is in one. `room` is the model of
/// the scene, if it is known.
pub(crate) fn brightest(
    probe: &LightProbe,
    most: usize,
    room: Option<&Room>,
) -> (Vec<ProbeLight>, Vec<bool>) {
    let cube = &probe.cube;
    let luminance = |texel: usize| relative_luminance(probe.radiance(texel).to_array());
    let whole: f32 = (0..cube.grid().len())
        .map(|texel| luminance(texel) * cube.grid().solid_angle_of(texel))
        .sum();
    let least = BRIGHT * whole / (4.0 * std::f32::consts::PI);
    let is_bright: Vec<bool> =
        (0..cube.grid().len()).map(|texel| most > 0 && luminance(texel) > least).collect();
    let point = |texel: usize| {
        let direction = cube.grid().direction_of(texel);
        let surface = probe.place(texel).map(|place| (place, probe.normal(texel)));
        let leaves = || room.and_then(|room| room.leaves(probe.centre(), direction));
        let surface = surface.or_else(leaves);
        LightPoint {
            direction,
            place: surface.map(|(place, _)| place),
            normal: surface.map_or(Vec3::ZERO, |(_, normal)| normal),
            irradiance: probe.radiance(texel) * cube.grid().solid_angle_of(texel),
        }
    };
    let texels: Vec<usize> = (0..cube.grid().len()).filter(|&texel| is_bright[texel]).collect();
    if texels.is_empty() {
        return (Vec::new(), is_bright);
    }
    // Light of the sky and light of surfaces differ in where they are: they are never one light.
    let is_near = |texel: &usize| probe.place(*texel).is_some();
    let (near, far): (Vec<usize>, Vec<usize>) = texels.iter().partition(|texel| is_near(texel));
    let mut lights: Vec<ProbeLight> = match most {
        1 => vec![ProbeLight::new(texels.into_iter().map(point).collect())],
        _ => [near, far]
            .into_iter()
            .filter(|texels| !texels.is_empty())
            .map(|texels| ProbeLight::new(texels.into_iter().map(point).collect()))
            .collect(),
    };
    while lights.len() < most {
        let gains = lights.iter().enumerate().map(|(at, light)| (at, light.gain()));
        let Some((widest, _)) = gains.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let Some([first, second]) = lights[widest].halves() else { break };
        lights[widest] = first;
        lights.push(second);
    }
    (lights, is_bright)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use holo_display::Frame;

    use super::*;

    /// Returns a probe of a sphere of radius 3 with radiance 1 and two small lamps.
    fn with_lamps() -> LightProbe {
        let frames: [Frame; 6] = std::array::from_fn(|_| {
            let mut frame = Frame::black((32, 32));
            frame.picture.pixels.fill([1.0; 3]);
            frame.depth.fill(3.0);
            frame
        });
        let mut probe = LightProbe::new(DVec3::ZERO, &frames).unwrap();
        for (towards, radiance) in [(Vec3::Z, 100.0), (Vec3::new(1.0, 1.0, 0.2), 50.0)] {
            for texel in 0..probe.cube.grid().len() {
                if probe.cube.grid().direction_of(texel).dot(towards.normalize()) > 0.98 {
                    probe.cube.set_radiance(texel, [radiance; 3]);
                }
            }
        }
        probe
    }

    /// Returns the irradiance at the centre of a facing surface, from all texels.
    fn whole(probe: &LightProbe, of: impl Fn(usize) -> bool) -> f32 {
        let texels = (0..probe.cube.grid().len()).filter(|&texel| of(texel));
        texels.map(|texel| probe.radiance(texel).x * probe.cube.grid().solid_angle_of(texel)).sum()
    }

    #[test]
    fn lights_have_all_light_of_the_bright_texels_however_many_there_are() {
        let probe = with_lamps();
        for most in [1, 2, 4, 8, 16] {
            let (lights, is_bright) = brightest(&probe, most, None);
            assert!(lights.len() <= most && !lights.is_empty());
            let found: f32 = lights.iter().map(|light| light.middle.irradiance.x).sum();
            let expected = whole(&probe, |texel| is_bright[texel]);
            assert!((found / expected - 1.0).abs() < 1e-3, "{most}: {found}, not {expected}");
        }
        let (none, is_bright) = brightest(&probe, 0, None);
        assert!(none.is_empty() && is_bright.iter().all(|bright| !bright));
    }

    #[test]
    fn two_lamps_become_two_lights() {
        let (lights, _) = brightest(&with_lamps(), 2, None);
        let mut towards: Vec<f32> = lights.iter().map(|light| light.middle.direction.z).collect();
        towards.sort_by(f32::total_cmp);
        assert!(towards[0] < 0.3 && towards[1] > 0.99, "{towards:?}");
        assert!(lights.iter().all(|light| light.angle() < 0.3));
    }

    #[test]
    fn the_mean_over_all_points_of_a_light_is_the_light() {
        let (lights, _) = brightest(&with_lamps(), 1, None);
        let count = 4096;
        let mean: Vec3 = (0..count)
            .map(|number| lights[0].sample((number as f32 + 0.5) / count as f32).irradiance)
            .sum::<Vec3>()
            / count as f32;
        let expected = lights[0].middle.irradiance;
        assert!((mean.x / expected.x - 1.0).abs() < 1e-2, "{mean}, not {expected}");
    }

    #[test]
    fn a_light_is_stronger_nearby_by_the_square_of_the_distance() {
        let (lights, _) = brightest(&with_lamps(), 2, None);
        let above = lights.iter().find(|light| light.middle.direction.z > 0.9).unwrap();
        let (here, nearer) =
            (above.middle.arriving(Vec3::ZERO), above.middle.arriving(Vec3::Z * 1.5));
        let factor = nearer.irradiance.x / here.irradiance.x;
        assert!((factor - 4.0).abs() < 0.1, "{factor}");
        assert!((nearer.distance - 1.5).abs() < 0.05);
    }
}
