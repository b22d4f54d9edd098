//! Measures how much of a scene its own lamps light.

use glam::Vec3;
use holo_raycast::{NO_TRIANGLE, Raycaster, SurfacePoint};
use holo_scene::{Material, PunctualBeam, PunctualLight, Scene};

/// Number of points on surfaces from which lamps are searched for.
const POINTS: usize = 512;

/// Number of points on lamps. They are chosen in proportion to their light from more points spread
/// by area and brightness, because a texture may be dark nearly everywhere. As many punctual lights
/// are added, in proportion to their intensity.
const LAMP_POINTS: usize = 32;
const CANDIDATES: usize = 8192;

/// Share of the scene's surface that its own lamps must reach. A lamp before a closed object
/// reaches up to half of the object, and all of the ground. Lamps that reach less are mere
/// decoration, such as eyes of figures or displays of devices.
const ENOUGH: f64 = 1.0 / 3.0;

/// Least product of the cosines at both ends, because grazing light hardly counts.
const LEAST_COSINES: f32 = 0.01;

/// Least radiance of a lamp in its brightest channel, W·sr⁻¹·m⁻²: about 1 cd/m². Exporters write
/// smaller numbers by rounding, and such a lamp would leave everything else in the dark.
pub const LEAST_LAMP: f32 = 0.005;

/// Mean of a texture's channels below which a lamp is dark there: 12 of 255 in sRGB, as JPEG makes
/// of black. One material often covers a whole object, and its texture shows where the lamp is.
const DARK_TEXEL: f64 = 0.004;

/// A point of a lamp.
struct LampPoint {
    point: SurfacePoint,
    is_two_sided: bool,
    /// Set for a punctual light.
    beam: Option<PunctualBeam>,
}

/// Returns true if enough of the scene's surface shines or is reached by direct light from lamps.
/// False without lamps. Glass is no obstacle.
#[must_use]
pub fn is_lit_by_lamps(raycaster: &Raycaster) -> bool {
    Lamps::new(raycaster).suffice(raycaster)
}

/// Returns whether a scene has lamps or punctual lights. Surfaces that emit less than
/// [`LEAST_LAMP`] are none.
#[must_use]
pub fn has_lamps(scene: &Scene) -> bool {
    let is_lamp = |material: &Material| brightness(material) > 0.0;
    !scene.punctual_lights.is_empty()
        || scene.materials.iter().any(is_lamp)
            && scene.emitters().any(|triangle| is_lamp(scene.material(triangle)))
}

/// Points on a scene's lamps.
pub(crate) struct Lamps {
    points: Vec<LampPoint>,
}

impl Lamps {
    pub(crate) fn new(raycaster: &Raycaster) -> Lamps {
        Lamps { points: lamp_points(raycaster) }
    }

    /// Returns true if enough of the scene's surface shines or is reached by direct light.
    pub(crate) fn suffice(&self, raycaster: &Raycaster) -> bool {
        let scene = raycaster.scene();
        let points = spread(scene, POINTS, |triangle| area(scene, triangle));
        let lit = points.into_iter().filter(|&point| self.light(raycaster, point, None)).count();
        lit as f64 >= ENOUGH * POINTS as f64 && !self.points.is_empty()
    }

    /// Returns true if a point of a triangle shines, or if direct light reaches it. With `seen`, a
    /// direction of view, only the visible side counts.
    pub(crate) fn light(
        &self,
        raycaster: &Raycaster,
        (triangle, u, v): (u32, f32, f32),
        seen: Option<Vec3>,
    ) -> bool {
        let scene = raycaster.scene();
        let point = raycaster.surface(triangle, u, v);
        let side = seen.map(|direction| -direction.dot(point.normal));
        let is_front = side.is_none_or(|side| side > 0.0);
        if (is_front || scene.material(triangle).two_sided_emission)
            && glow(scene, triangle, u, v) > 0.0
        {
            return true;
        }
        self.points.iter().any(|lamp| lamp.reaches(raycaster, &point, side))
    }
}

impl LampPoint {
    /// Returns true if this point lights `to`. Glass and partly covered surfaces pass light
    /// through. If `side` is positive, only the side of `to`'s normal counts. If it is negative,
    /// only the other side counts.
    fn reaches(&self, raycaster: &Raycaster, to: &SurfacePoint, side: Option<f32>) -> bool {
        let away = (to.point - self.point.point).normalize_or_zero();
        let here = to.normal.dot(away);
        let (at_lamp, shines_there) = match self.beam {
            Some(beam) => (1.0, beam.share(away) > 0.0),
            None => {
                let at_lamp = self.point.normal.dot(away);
                (at_lamp, at_lamp > 0.0 || self.is_two_sided)
            }
        };
        let is_on_side = side.is_none_or(|side| side * here < 0.0);
        if !shines_there || !is_on_side || (at_lamp * here).abs() < LEAST_COSINES {
            return false;
        }
        let scene = raycaster.scene();
        let is_clear = |triangle| scene.passes_light(triangle);
        raycaster.blocker(to, &self.point).is_none_or(is_clear)
    }
}

fn lamp_points(raycaster: &Raycaster) -> Vec<LampPoint> {
    let scene = raycaster.scene();
    let brightness_of = |triangle: u32| brightness(scene.material(triangle));
    let candidates =
        spread(scene, CANDIDATES, |triangle| area(scene, triangle) * brightness_of(triangle));
    let texture =
        |&(triangle, u, v): &(u32, f32, f32)| glow(scene, triangle, u, v) / brightness_of(triangle);
    let weights: Vec<f64> = candidates.iter().map(texture).collect();
    let lamp = |index: usize| {
        let (triangle, u, v) = candidates[index];
        let is_two_sided = scene.material(triangle).two_sided_emission;
        LampPoint { point: raycaster.surface(triangle, u, v), is_two_sided, beam: None }
    };
    let on_surfaces = in_proportion(weights.iter().copied(), LAMP_POINTS).into_iter().map(lamp);
    let strength = |light: &PunctualLight| sum(light.intensity);
    let mut chosen = in_proportion(scene.punctual_lights.iter().map(strength), LAMP_POINTS);
    chosen.dedup();
    let punctual = chosen.into_iter().map(|index| {
        let light = &scene.punctual_lights[index];
        let point = SurfacePoint {
            point: light.position.into(),
            error: Vec3::ZERO,
            normal: Vec3::Z,
            triangle: NO_TRIANGLE,
        };
        LampPoint { point, is_two_sided: true, beam: Some(light.beam) }
    });
    on_surfaces.chain(punctual).collect()
}

/// Returns the brightness of a point on a lamp; 0 if its texture is dark there.
pub(crate) fn glow(scene: &Scene, triangle: u32, u: f32, v: f32) -> f64 {
    let brightness = brightness(scene.material(triangle));
    if brightness == 0.0 {
        return 0.0;
    }
    match scene.emission_texture(triangle, u, v, 0.0).map(sum) {
        None => brightness,
        Some(texture) if texture < 3.0 * DARK_TEXEL => 0.0,
        Some(texture) => texture * brightness,
    }
}

/// Returns the sum of the channels of a lamp's radiance; 0 if it is no lamp.
fn brightness(material: &Material) -> f64 {
    let is_lamp = material.emission.iter().any(|&channel| channel >= LEAST_LAMP);
    if is_lamp { sum(material.emission) } else { 0.0 }
}

fn sum(colour: [f32; 3]) -> f64 {
    colour.into_iter().map(f64::from).sum()
}

fn area(scene: &Scene, triangle: u32) -> f64 {
    let [a, b, c] = scene.corners(triangle);
    f64::from((b - a).cross(c - a).length())
}

/// Returns `count` points on triangles, in proportion to the triangles' weights: triangle and
/// barycentric weights. Empty if all weights are 0.
fn spread(
    scene: &Scene,
    count: usize,
    weight: impl Fn(u32) -> f64 + Clone,
) -> Vec<(u32, f32, f32)> {
    let chosen = in_proportion(scene.triangles().map(weight), count).into_iter().enumerate();
    let point = |(number, triangle): (usize, usize)| {
        // The plastic number's sequence (Roberts 2018), folded into the triangle.
        let number = number as f32;
        let (u, v) = ((0.754_877_7 * number).fract(), (0.569_840_3 * number).fract());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        (triangle as u32, u, v)
    };
    chosen.map(point).collect()
}

/// Returns `count` indices, each as often as its weight requires. Empty if all weights are 0.
fn in_proportion(weights: impl Iterator<Item = f64> + Clone, count: usize) -> Vec<usize> {
    // Twice, because all weights of a scene with instances would take more memory than the scene.
    let total: f64 = weights.clone().sum();
    if total.is_nan() || total <= 0.0 {
        return Vec::new();
    }
    let (mut chosen, mut before) = (Vec::with_capacity(count), 0.0);
    for (index, weight) in weights.enumerate() {
        before += weight;
        while chosen.len() < count && (chosen.len() as f64 + 0.5) * total < before * count as f64 {
            chosen.push(index);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::sync::Arc;

    /// Returns the result for a closed box of `side` around the origin, whose faces look outwards,
    /// and a lamp above or below its lid.
    fn is_lit(side: f64, lamp_height: f64, lamp: Material) -> bool {
        let corner = |k: usize| {
            DVec3::from_array([k & 1, k >> 1 & 1, k >> 2].map(|c| (c as f64 - 0.5) * side))
        };
        let mut positions: Vec<DVec3> = (0..8).map(corner).collect();
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        let mut triangles: Vec<[u32; 3]> = quads.into_iter().flat_map(halves).collect();
        let mut ids = vec![0; triangles.len()];
        // The lamp shines down.
        positions.extend(
            [[0.0, 0.0], [0.0, 0.1], [0.1, 0.1], [0.1, 0.0]]
                .map(|[x, y]| DVec3::new(x, y, lamp_height)),
        );
        triangles.extend(halves([8, 9, 10, 11]));
        ids.extend([1; 2]);
        let materials = vec![Material::grey("wall"), lamp];
        let scene = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap().0;
        is_lit_by_lamps(&Raycaster::build(Arc::new(scene)).unwrap())
    }

    #[test]
    fn a_lamp_lights_surfaces_before_it_and_none_behind_it() {
        let lamp = Material { emission: [2.0; 3], ..Material::grey("lamp") };
        // In the box, the lamp lights all walls. Just above the lid, it shines into a gap.
        assert!(is_lit(2.0, 0.8, lamp.clone()));
        assert!(!is_lit(2.0, 1.001, lamp.clone()));
        // High above, it lights the lid alone, a sixth of the box.
        assert!(!is_lit(2.0, 3.0, lamp));
        assert!(!is_lit(2.0, 0.8, Material::grey("no lamp")));
        let faint = Material { emission: [0.5 * LEAST_LAMP; 3], ..Material::grey("faint") };
        assert!(!is_lit(2.0, 0.8, faint));
    }

    #[test]
    fn punctual_lights_light_what_is_in_their_beam() {
        let points = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let points = points.map(|[x, y]| DVec3::new(x, y, 0.0));
        let with = |beam: PunctualBeam| {
            let materials = vec![Material::grey("floor")];
            let triangles = [[0, 1, 2], [0, 2, 3]];
            let scene = Scene::from_world(&points, &triangles, &[0; 2], materials, [0.0; 3]);
            let light = PunctualLight {
                name: String::new(),
                group: String::new(),
                position: [0.0, 0.0, 1.0],
                intensity: [1.0; 3],
                radius: 0.01,
                beam,
            };
            let scene = scene.unwrap().0.with_punctual_lights(vec![light]).unwrap();
            is_lit_by_lamps(&Raycaster::build(Arc::new(scene)).unwrap())
        };
        let cone =
            |z: f32, outer: f32| PunctualBeam::Cone { axis: [0.0, 0.0, z], inner: 0.0, outer };
        assert!(with(PunctualBeam::Everywhere) && with(cone(-1.0, 1.5)));
        assert!(!with(cone(1.0, 1.5)) && !with(cone(-1.0, 0.1)));
    }

    #[test]
    fn a_scene_whose_surface_shines_is_not_dark() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let lamp = Material { emission: [2.0; 3], ..Material::grey("lamp") };
        for (material, is_lit) in [(lamp, true), (Material::grey("wall"), false)] {
            let made = Scene::from_world(&points, &[[0, 1, 2]], &[0], vec![material], [0.0; 3]);
            let raycaster = Raycaster::build(Arc::new(made.unwrap().0)).unwrap();
            assert_eq!(is_lit_by_lamps(&raycaster), is_lit);
        }
    }

    #[test]
    fn indices_come_as_often_as_their_weights_demand() {
        assert_eq!(in_proportion([1.0, 0.0, 2.0, 1.0].into_iter(), 8), [0, 0, 2, 2, 2, 2, 3, 3]);
        assert!(in_proportion([0.0; 3].into_iter(), 8).is_empty());
    }
}
