//! Normals of surfaces that only samples know: the direction in which neighbours spread least.

use glam::{Mat3, Vec3};

/// Rounds of the search for the least direction. Each multiplies the others' share by the ratio of
/// two spreads, so few are enough for anything like a plane.
const ROUNDS: u32 = 12;

/// Returns the unit normal of the plane through points, on the side of `towards`. `towards` itself
/// if the points lie on a line or are too few.
pub(crate) fn plane_normal(points: &[Vec3], towards: Vec3) -> Vec3 {
    let towards = towards.normalize_or(Vec3::Z);
    if points.len() < 3 {
        return towards;
    }
    let mean = points.iter().sum::<Vec3>() / points.len() as f32;
    let mut spread = Mat3::ZERO;
    for point in points {
        let offset = *point - mean;
        spread += Mat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
    }
    let size = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
    if size <= 0.0 {
        return towards;
    }
    // Powers of the inverse turn any direction to that of the least spread. A little is added, so
    // that an exact plane has an inverse too.
    let spread = spread * (1.0 / size) + Mat3::from_diagonal(Vec3::splat(1e-4));
    let inverse = spread.inverse();
    let mut normal = towards;
    for _ in 0..ROUNDS {
        normal = (inverse * normal).normalize_or(towards);
    }
    // On a line, every direction across it is as good: then the eye decides.
    let across = spread.mul_vec3(normal).length();
    let second = second_spread(spread, normal);
    if second < 4.0 * across {
        return towards;
    }
    if normal.dot(towards) < 0.0 { -normal } else { normal }
}

/// Returns the smaller spread across the normal.
fn second_spread(spread: Mat3, normal: Vec3) -> f32 {
    let (u, v) = normal.any_orthonormal_pair();
    let (a, b, c) = (u.dot(spread * u), u.dot(spread * v), v.dot(spread * v));
    0.5 * (a + c) - (0.25 * (a - c) * (a - c) + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_has_its_normal_on_the_lit_side_and_a_line_none() {
        let across = Vec3::new(0.3, -0.5, 0.8).normalize();
        let (u, v) = across.any_orthonormal_pair();
        let plane: Vec<Vec3> = (0..25)
            .map(|at| u * (at % 5) as f32 + v * (at / 5) as f32 + Vec3::splat(7.0))
            .collect();
        let up = (across + u * 0.7).normalize();
        assert!(plane_normal(&plane, up).distance(across) < 1e-3);
        assert!(plane_normal(&plane, -up).distance(-across) < 1e-3);
        let line: Vec<Vec3> = (0..9).map(|at| u * at as f32).collect();
        assert_eq!(plane_normal(&line, Vec3::Y), Vec3::Y);
        assert_eq!(plane_normal(&[Vec3::X; 5], Vec3::Y), Vec3::Y);
    }
}
