//! Normals of curved surfaces: given ones, or made from smoothing groups.

use glam::{DVec3, Vec3};

use crate::shading::{Octahedral, to_octahedral};

/// Cosine of the greatest angle between faces that a smoothing group joins: 45°. Exporters put
/// whole boxes into one group.
const JOINED: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Returns the unit normal of a triangle, or 0 if it has no area.
pub(crate) fn facet(positions: &[DVec3], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
    (b - a).cross(c - a).normalize_or_zero()
}

/// Packs the normals of a triangle's corners. A normal without direction is replaced by the
/// facet's. A normal on the other side is reversed, because the winding counts.
pub(crate) fn packed(facet: DVec3, corners: [Vec3; 3]) -> [Octahedral; 3] {
    let facet = facet.as_vec3();
    corners.map(|normal| {
        let normal = normal.try_normalize().unwrap_or(facet);
        to_octahedral(if normal.dot(facet) < 0.0 { -normal } else { normal })
    })
}

/// Returns whether a triangle's corners have different normals.
pub(crate) fn is_curved([a, b, c]: &[Octahedral; 3]) -> bool {
    a != b || b != c
}

/// Makes normals from smoothing groups. The normal of a corner is the mean of the normals of the
/// faces around it, weighted by area. Only faces of the same group within 45° count. Group 0 is
/// faceted.
pub(crate) fn from_groups(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    groups: &[u32],
) -> Vec<[Octahedral; 3]> {
    let areas: Vec<DVec3> = triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
            (b - a).cross(c - a)
        })
        .collect();
    // The triangles around each corner, one corner after the other.
    let mut first = vec![0u32; positions.len() + 1];
    triangles.as_flattened().iter().for_each(|&corner| first[corner as usize + 1] += 1);
    (1..first.len()).for_each(|k| first[k] += first[k - 1]);
    let mut next = first.clone();
    let mut around = vec![0u32; 3 * triangles.len()];
    for (id, &corner) in triangles.as_flattened().iter().enumerate() {
        around[next[corner as usize] as usize] = id as u32 / 3;
        next[corner as usize] += 1;
    }
    let normals = triangles.iter().zip(groups).zip(&areas).map(|((triangle, &group), &area)| {
        let own = area.normalize_or_zero();
        let at_corner = |corner: u32| {
            let [from, to] = [0, 1].map(|k| first[corner as usize + k] as usize);
            let joins = |&&other: &&u32| {
                let theirs = areas[other as usize];
                groups[other as usize] == group && theirs.dot(own) > JOINED * theirs.length()
            };
            let sum: DVec3 =
                around[from..to].iter().filter(joins).map(|&other| areas[other as usize]).sum();
            sum.as_vec3()
        };
        let corners = if group == 0 { [own.as_vec3(); 3] } else { triangle.map(at_corner) };
        packed(own, corners)
    });
    normals.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shading::from_octahedral;

    #[test]
    fn groups_join_faces_that_meet_at_a_blunt_angle_only() {
        // A ridge: two slopes that meet along y, each at an angle to the horizon.
        let ridge = |slope: f64| {
            let z = slope.to_radians().tan();
            [[-1.0, 0.0, -z], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, -z]].map(DVec3::from)
        };
        let triangles = [[0, 1, 2], [1, 3, 2]];
        let top = |slope: f64, groups: [u32; 2]| {
            let normals = from_groups(&ridge(slope), &triangles, &groups);
            from_octahedral(normals[0][1])
        };
        let own = |slope: f64| facet(&ridge(slope), triangles[0]).as_vec3();
        assert!(top(20.0, [1, 1]).distance(Vec3::Z) < 1e-3);
        for (slope, groups) in [(20.0, [1, 2]), (20.0, [0, 0]), (40.0, [1, 1])] {
            assert!(top(slope, groups).distance(own(slope)) < 1e-3, "{slope} {groups:?}");
        }
    }
}
