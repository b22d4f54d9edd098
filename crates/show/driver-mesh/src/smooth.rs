//! Averages the colours of vertices over their surroundings, as far as their noise demands.
//!
//! The colour of a vertex is a mean over wider and wider surroundings, as long as the means agree
//! within their noise (Lepski's rule, as leaves of the quadtree are chosen). The noise of a vertex is
//! estimated by the median of its differences from its neighbours. At the edge of a shadow or of a
//! texture, most neighbours are on the vertex's side, so the median is small and the edge stays.
//!
//! Invariants:
//! - No mean is taken across a jump of depth.
//! - Means are those of radiance. Only the comparisons use fourth roots of luminance, so that a few
//!   bright samples do not decide.
//! - Everything here is a function of the set of vertices, not of their numbers.

use holo_picture::relative_luminance;
use rayon::prelude::*;

use crate::mesh::LitMesh;
use crate::seen::{SeenVertex, is_jump};

/// Rounds of averaging with neighbours after which the means are compared, and the number of vertices
/// that such a mean is worth. A round widens the mean by 0.43 squared edges.
const LEVELS: [(usize, f32); 4] = [(1, 7.0), (2, 12.4), (4, 24.8), (8, 49.6)];
/// Differences in standard errors up to which two means agree.
const KAPPA: f32 = 1.5;
/// The median of a squared difference of two numbers, over the variance of each.
const MEDIAN: f32 = 0.91;

/// Colour of a vertex by the number of its samples, and that number.
#[derive(Clone, Copy, Default)]
struct WeightedColour {
    rgb: [f32; 3],
    count: f32,
}

impl WeightedColour {
    fn mean(&self) -> [f32; 3] {
        self.rgb.map(|sum| sum / self.count.max(f32::MIN_POSITIVE))
    }

    fn root(&self) -> f32 {
        relative_luminance(self.mean()).max(0.0).sqrt().sqrt()
    }
}

/// For each vertex, the neighbours on its own surface, in their order.
struct Neighbours {
    starts: Vec<usize>,
    numbers: Vec<u32>,
}

impl Neighbours {
    fn new(mesh: &LitMesh, seen: &[Option<SeenVertex>]) -> Neighbours {
        let ring = |number: u32| {
            let mut ring = Vec::new();
            if let Some(vertex) = &seen[number as usize] {
                mesh.triangles.for_neighbours(number, |other| {
                    let joined = seen[other as usize].filter(|other| !is_jump(vertex, other));
                    ring.extend(joined.map(|seen| (seen.order, other)));
                });
                ring.sort_unstable();
            }
            ring
        };
        let rings: Vec<_> = (0..seen.len() as u32).into_par_iter().map(ring).collect();
        let mut starts = vec![0];
        starts.extend(rings.iter().scan(0, |end, ring| {
            *end += ring.len();
            Some(*end)
        }));
        Neighbours { starts, numbers: rings.into_iter().flatten().map(|(_, n)| n).collect() }
    }

    fn of(&self, vertex: usize) -> impl Iterator<Item = usize> + '_ {
        let numbers = &self.numbers[self.starts[vertex]..self.starts[vertex + 1]];
        numbers.iter().map(|&number| number as usize)
    }

    /// Returns for each vertex the mean of a number over it and its neighbours.
    fn averaged(&self, values: &[f32]) -> Vec<f32> {
        let mean = |vertex: usize| {
            let (mut sum, mut count) = (values[vertex], 1.0);
            for other in self.of(vertex) {
                (sum, count) = (sum + values[other], count + 1.0);
            }
            sum / count
        };
        (0..values.len()).into_par_iter().map(mean).collect()
    }
}

/// Averages the colours of the vertices of a mesh.
pub fn smooth(mesh: &LitMesh, seen: &mut [Option<SeenVertex>]) {
    let neighbours = Neighbours::new(mesh, seen);
    let weighted = |seen: &Option<SeenVertex>| {
        seen.map_or_else(WeightedColour::default, |seen| {
            let rgb = seen.colour.map(|channel| channel * seen.count);
            WeightedColour { rgb, count: seen.count }
        })
    };
    let mut level: Vec<WeightedColour> = seen.iter().map(weighted).collect();
    let roots: Vec<f32> = level.iter().map(WeightedColour::root).collect();
    let median = |vertex: usize| {
        let mut squares: Vec<f32> =
            neighbours.of(vertex).map(|other| (roots[vertex] - roots[other]).powi(2)).collect();
        if squares.is_empty() {
            return 0.0;
        }
        let middle = squares.len() / 2;
        *squares.select_nth_unstable_by(middle, f32::total_cmp).1 / MEDIAN
    };
    let medians: Vec<f32> = (0..seen.len()).into_par_iter().map(median).collect();
    let variances = neighbours.averaged(&medians);
    // The interval of means that agree with all smaller ones; empty once one has not.
    let error = |vertex: usize, worth: f32| KAPPA * (variances[vertex] / worth).sqrt();
    let interval =
        |vertex: usize| [roots[vertex] - error(vertex, 1.0), roots[vertex] + error(vertex, 1.0)];
    let mut intervals: Vec<[f32; 2]> = (0..seen.len()).map(interval).collect();
    let mut rounds = 0;
    for (wanted, worth) in LEVELS {
        while rounds < wanted {
            level = averaged_colours(&neighbours, &level);
            rounds += 1;
        }
        seen.par_iter_mut().zip(&mut intervals).enumerate().for_each(|(number, (seen, within))| {
            let (Some(seen), colour) = (seen, &level[number]) else { return };
            let (root, error) = (colour.root(), error(number, worth));
            let both = [within[0].max(root - error), within[1].min(root + error)];
            if both[0] <= both[1] && colour.count > 0.0 {
                seen.colour = colour.mean();
                *within = both;
            } else {
                *within = [f32::INFINITY, f32::NEG_INFINITY];
            }
        });
    }
}

/// Averages each vertex with its neighbours, once.
fn averaged_colours(neighbours: &Neighbours, level: &[WeightedColour]) -> Vec<WeightedColour> {
    let mean = |vertex: usize| {
        let (mut sum, mut parts) = (level[vertex], 1.0);
        for other in neighbours.of(vertex) {
            let WeightedColour { rgb, count } = level[other];
            for (sum, channel) in sum.rgb.iter_mut().zip(rgb) {
                *sum += channel;
            }
            (sum.count, parts) = (sum.count + count, parts + 1.0);
        }
        WeightedColour { rgb: sum.rgb.map(|sum| sum / parts), count: sum.count / parts }
    };
    (0..level.len()).into_par_iter().map(mean).collect()
}
