//! Reflection and refraction at a smooth boundary: directions, and shares of unpolarised light
//! between dielectrics.

use glam::Vec3;

/// Returns the reflected share, and the cosine beyond the boundary (0 if all is reflected).
///
/// `cosine` ≥ 0 is the cosine on the side of the light. `eta` is the index of refraction beyond the
/// boundary over that on the light's side.
#[inline]
pub fn dielectric(cosine: f32, eta: f32) -> (f32, f32) {
    let ([parallel, perpendicular], beyond) = polarized(cosine, eta);
    (0.5 * (parallel + perpendicular), beyond)
}

/// Returns the reflected shares of parallel and of perpendicular polarization, and the cosine
/// beyond the boundary, as [`dielectric`].
#[inline]
fn polarized(cosine: f32, eta: f32) -> ([f32; 2], f32) {
    let sin2 = (1.0 - cosine * cosine).max(0.0) / (eta * eta);
    if sin2 >= 1.0 {
        return ([1.0; 2], 0.0);
    }
    let beyond = (1.0 - sin2).sqrt();
    let parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
    let perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
    let reflected = [parallel * parallel, perpendicular * perpendicular];
    // At exactly grazing incidence on equal media both are 0 / 0.
    if reflected[0].is_nan() || reflected[1].is_nan() {
        return ([1.0; 2], beyond);
    }
    (reflected, beyond)
}

/// Returns the share reflected by a pane of two parallel faces: r + t² r / (1 - r²), with all
/// orders of reflection between the faces.
///
/// Light keeps its polarization between the faces, because they have the same plane of incidence.
/// So this is the mean of the two polarizations. The series of their mean would reflect 3 % of the
/// light too much at 70°.
#[inline]
pub fn pane(cosine: f32, ior: f32) -> f32 {
    let ([parallel, perpendicular], _) = polarized(cosine, ior);
    parallel / (1.0 + parallel) + perpendicular / (1.0 + perpendicular)
}

/// Returns the direction beyond a boundary of normal `m` (on the side of `wo`), from the results of
/// [`dielectric`].
#[inline]
pub fn refract(wo: Vec3, m: Vec3, beyond: f32, eta: f32) -> Vec3 {
    (m * (wo.dot(m) / eta - beyond) - wo / eta).normalize()
}

/// Returns the direction that a surface of normal +z reflects to `wo`.
#[inline]
pub fn mirrored(wo: Vec3) -> Vec3 {
    Vec3::new(-wo.x, -wo.y, wo.z)
}

/// Returns the direction that a surface of normal `m` reflects to `wo`.
#[inline]
pub fn reflect(wo: Vec3, m: Vec3) -> Vec3 {
    m * (2.0 * wo.dot(m)) - wo
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_brewster_and_total_reflection_are_as_in_optics() {
        let (r, beyond) = dielectric(1.0, 1.5);
        assert!((r - 0.04).abs() < 1e-6 && (beyond - 1.0).abs() < 1e-6);
        // Brewster's angle: the parallel component vanishes, and half of the perpendicular one
        // remains.
        let angle = 1.5_f64.atan();
        let (r, _) = dielectric(angle.cos() as f32, 1.5);
        let perpendicular = (1.0 - 1.5_f64.powi(2)) / (1.0 + 1.5_f64.powi(2));
        assert!((f64::from(r) - 0.5 * perpendicular.powi(2)).abs() < 1e-6);
        // Inside glass the sine of the critical angle is 1/1.5.
        assert_eq!(dielectric((1.0_f32 - 0.45).sqrt(), 1.0 / 1.5).0, 1.0);
        assert!(dielectric((1.0_f32 - 0.44).sqrt(), 1.0 / 1.5).0 < 1.0);
        assert_eq!(dielectric(0.0, 1.5).0, 1.0);
        assert_eq!(dielectric(0.0, 1.0).0, 1.0);
        assert!(dielectric(0.5, 1.0).0 < 1e-12);
    }

    #[test]
    fn both_directions_through_a_boundary_reflect_alike() {
        for i in 1..100 {
            let cosine = i as f32 / 100.0;
            let (r, beyond) = dielectric(cosine, 1.52);
            let (back, before) = dielectric(beyond, 1.0 / 1.52);
            // The cosine is recovered from 1 - cos²: its error is about 1e-7 over the cosine. The
            // slope of r is at most 6.
            let bound = 3e-6 / cosine;
            assert!(
                (r - back).abs() < bound && (before - cosine).abs() < bound,
                "{cosine}: {r} {back}"
            );
        }
    }

    #[test]
    fn a_pane_at_normal_incidence_reflects_eight_percent() {
        // r = 0.04: the series r + t² r (1 + r² + r⁴ + ...) summed term by term.
        let (r, t) = (0.04_f64, 0.96_f64);
        let series: f64 = r + (0..20).map(|k| t * t * r * r.powi(2 * k)).sum::<f64>();
        assert!((f64::from(pane(1.0, 1.5)) - series).abs() < 1e-6);
    }

    #[test]
    fn a_clear_pane_transmits_what_the_cie_states() {
        // CIE 171:2006, case 5.5.
        for (degrees, transmitted) in [
            (0.0, 0.91832),
            (30.0, 0.91596),
            (45.0, 0.90253),
            (60.0, 0.84347),
            (70.0, 0.72471),
            (80.0, 0.45604),
        ] {
            let found = 1.0 - pane(f32::to_radians(degrees).cos(), 1.52);
            assert!((found - transmitted).abs() < 1e-5, "{degrees}: {found}");
        }
        assert_eq!((pane(0.0, 1.5), pane(0.5, 1.0)), (1.0, 0.0));
    }

    #[test]
    fn refraction_obeys_snell() {
        for cosine in [0.05_f32, 0.3, 0.7, 1.0] {
            for eta in [1.5, 1.0 / 1.5] {
                let wo = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
                let (r, beyond) = dielectric(cosine, eta);
                if r < 1.0 {
                    let wi = refract(wo, Vec3::Z, beyond, eta);
                    assert!(
                        (wi.x * eta + wo.x).abs() < 1e-6
                            && wi.z < 0.0
                            && (wi.length() - 1.0).abs() < 1e-6
                    );
                }
            }
        }
    }
}
