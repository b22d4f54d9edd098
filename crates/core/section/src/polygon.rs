//! Convex polygons in the unit square: clipping by half-planes and uniform sampling by area.

/// A point of the unit square.
pub(crate) type Point = [f64; 2];

/// A linear function of a point: `a·p + b·q + c`.
#[derive(Copy, Clone, Debug, PartialEq)]
pub(crate) struct Linear(pub [f64; 3]);

impl Linear {
    pub(crate) fn at(self, [p, q]: Point) -> f64 {
        self.0[0] * p + self.0[1] * q + self.0[2]
    }

    /// Returns `self·a + other·b + c`.
    pub(crate) fn combine(self, a: f64, other: Linear, b: f64, c: f64) -> Linear {
        let mut sum = [0, 1, 2].map(|i| self.0[i] * a + other.0[i] * b);
        sum[2] += c;
        Linear(sum)
    }
}

/// Returns the part of the unit square where every one of `constraints` is at least 0, as the
/// vertices of a convex polygon. Empty if there is no such part.
pub(crate) fn clip_unit_square(constraints: &[Linear]) -> Vec<Point> {
    let mut polygon = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for &constraint in constraints {
        // Sutherland & Hodgman 1974.
        let mut clipped = Vec::with_capacity(polygon.len() + 1);
        for (i, &from) in polygon.iter().enumerate() {
            let to = polygon[(i + 1) % polygon.len()];
            let (a, b) = (constraint.at(from), constraint.at(to));
            if a >= 0.0 {
                clipped.push(from);
            }
            if (a < 0.0) != (b < 0.0) && a != b {
                let t = a / (a - b);
                clipped.push([from[0] + (to[0] - from[0]) * t, from[1] + (to[1] - from[1]) * t]);
            }
        }
        polygon = clipped;
    }
    polygon
}

/// A union of disjoint convex polygons, as triangles. Each comes with the share of the area up to
/// its end.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Region {
    triangles: Vec<(f64, [Point; 3])>,
}

impl Region {
    /// Splits each polygon into a fan of triangles. It leaves out triangles without area.
    pub(crate) fn new(polygons: &[Vec<Point>]) -> Region {
        let mut triangles = Vec::new();
        let mut area = 0.0;
        for polygon in polygons {
            for i in 2..polygon.len() {
                let triangle = [polygon[0], polygon[i - 1], polygon[i]];
                let part = triangle_area(triangle);
                if part > 0.0 {
                    area += part;
                    triangles.push((area, triangle));
                }
            }
        }
        for (share, _) in &mut triangles {
            *share /= area;
        }
        Region { triangles }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Maps the unit square onto the region so that areas keep their proportions. An empty region
    /// gives the origin.
    pub(crate) fn sample(&self, s: f64, t: f64) -> Point {
        let chosen = self
            .triangles
            .partition_point(|&(share, _)| share <= s)
            .min(self.triangles.len().saturating_sub(1));
        let Some(&(share, [a, b, c])) = self.triangles.get(chosen) else {
            return [0.0; 2];
        };
        let before = if chosen == 0 { 0.0 } else { self.triangles[chosen - 1].0 };
        let within = ((s - before) / (share - before)).clamp(0.0, 1.0);
        let root = within.sqrt();
        let (wa, wb, wc) = (1.0 - root, root * (1.0 - t), root * t);
        [wa * a[0] + wb * b[0] + wc * c[0], wa * a[1] + wb * b[1] + wc * c[1]]
    }
}

fn triangle_area([a, b, c]: [Point; 3]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipping_by_a_diagonal_leaves_half_and_by_its_opposite_nothing() {
        let half = clip_unit_square(&[Linear([1.0, -1.0, 0.0])]);
        let area: f64 =
            (2..half.len()).map(|i| triangle_area([half[0], half[i - 1], half[i]])).sum();
        assert!((area - 0.5).abs() < 1e-15);
        let none = clip_unit_square(&[Linear([1.0, 0.0, -0.5]), Linear([-1.0, 0.0, 0.25])]);
        assert!(Region::new(&[none]).is_empty());
    }

    #[test]
    fn sampling_is_uniform_over_the_region() {
        // The region is the square without a diagonal band: two disjoint parts. Points are a
        // midpoint grid in (s, t). The share of points in a box must equal its share of the area.
        // The map is piecewise smooth, so the grid's error is about 1/1000.
        let band = 0.2;
        let parts = [
            clip_unit_square(&[Linear([1.0, -1.0, -band])]),
            clip_unit_square(&[Linear([-1.0, 1.0, -band])]),
        ];
        let region = Region::new(&parts);
        let n = 1000;
        let mut low_left = 0;
        let mut upper = 0;
        for i in 0..n {
            for j in 0..n {
                let [p, q] = region.sample(
                    (f64::from(i) + 0.5) / f64::from(n),
                    (f64::from(j) + 0.5) / f64::from(n),
                );
                assert!((p - q).abs() >= band - 1e-12);
                low_left += u32::from(p < 0.5 && q < 0.5);
                upper += u32::from(q > p);
            }
        }
        let all = f64::from(n * n);
        // Two triangles of (0.5-0.2)²/2 each, of a region of (1-0.2)².
        assert!((f64::from(low_left) / all - 0.09 / 0.64).abs() < 4e-3);
        assert!((f64::from(upper) / all - 0.5).abs() < 2e-3);
    }
}
