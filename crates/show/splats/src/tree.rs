//! Builds the hierarchy: from the root down by splits, from the leaves up by spheres, and down
//! again to encode nodes against their parents.
//!
//! As in QSplat, a set of surfels is halved along its longest axis, and two halvings make a node of
//! up to four children. Here a set whose normals differ much is first split by normals. So the two
//! sides of a wall part at the first levels, a node of a coarse level shows one side, and whole
//! branches that face away are skipped.

use glam::Vec3;
use holo_color::relative_luminance;
use rayon::prelude::*;

use crate::{
    LightCode, PackedNode, SplatError, Surfel,
    format::CHUNK_NODES,
    node::{Disc, Sphere},
};

/// Greatest difference of normals along an axis within a set that is split by place. Opposite
/// normals differ by 2, those of a floor and a wall by 1.
const MOST_TURN: f32 = 0.85;

/// Least share of the surfels on either side of a split. It bounds the number of levels.
const LEAST_SHARE: usize = 4;

/// Most surfels, so that numbers of nodes fit 32 bits.
const MOST_SURFELS: usize = 1 << 31;

/// A hierarchy, ready to be written.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatTree {
    /// The nodes, level by level.
    pub nodes: Vec<PackedNode>,
    /// Number of nodes without children.
    pub surfels: usize,
    /// Number of the first node of each level.
    pub levels: Vec<usize>,
    /// The sphere around everything.
    pub sphere: Sphere,
    /// Binary logarithm of the greatest luminance.
    pub peak: f32,
    /// Colours of surfaces that are left out of the light, of the nodes of the first levels: of no
    /// more than [`COLOURED`](Self::COLOURED) nodes.
    pub colours: Vec<[f32; 3]>,
}

/// The surfels of a node: a range of all surfels.
#[derive(Clone, Copy)]
struct Span {
    /// The first one.
    start: u32,
    /// Number of children.
    children: u32,
}

/// A node before it is encoded.
#[derive(Clone, Copy)]
struct Branch {
    sphere: Sphere,
    normal: Vec3,
    /// Greatest angle between the normal and those below.
    angle: f32,
    light: [f32; 3],
    /// Radiance with the colours that are left out of `light`.
    radiance: Vec3,
    error: f32,
    area: f32,
    is_directional: bool,
}

impl SplatTree {
    /// Most nodes with a colour: four chunks.
    pub const COLOURED: usize = 4 * CHUNK_NODES;

    /// Builds the hierarchy of these surfels, which are about `spacing` apart. Their order decides
    /// nothing but ties.
    ///
    /// # Errors
    /// If there are none, or too many.
    pub fn new(mut surfels: Vec<Surfel>, spacing: f32) -> Result<SplatTree, SplatError> {
        match surfels.len() {
            0 => return Err(SplatError::Empty),
            count if count > MOST_SURFELS => return Err(SplatError::TooMany(count)),
            _ => {}
        }
        let spans = split_levels(&mut surfels);
        let branches = join_levels(&surfels, &spans);
        let brightest = surfels.par_iter().map(|surfel| relative_luminance(surfel.light));
        let brightest = brightest.filter(|light| light.is_finite()).reduce(|| 0.0, f32::max);
        let peak = if brightest > 0.0 { brightest.log2().ceil() } else { 0.0 };
        let mut root = branches[0][0].sphere;
        root.radius = root.radius.max(f32::MIN_POSITIVE);
        let mut tree = SplatTree {
            nodes: Vec::with_capacity(spans.iter().map(Vec::len).sum()),
            surfels: surfels.len(),
            levels: Vec::with_capacity(spans.len()),
            sphere: root,
            peak,
            colours: Vec::new(),
        };
        let mut parents = vec![root];
        for (spans, branches) in spans.iter().zip(&branches) {
            tree.levels.push(tree.nodes.len());
            if tree.nodes.len() + branches.len() <= Self::COLOURED {
                tree.colours.extend(branches.iter().map(Branch::colour));
            }
            let encode = |((span, branch), &parent): ((&Span, &Branch), &Sphere)| {
                branch.encode(parent, span.children, peak, spacing)
            };
            let rows = spans.par_iter().zip(branches).zip(&parents);
            let nodes: Vec<PackedNode> = rows.map(encode).collect();
            let decoded =
                nodes.iter().zip(&parents).map(|(node, &parent)| node.sphere(parent, spacing));
            let below = spans.iter().zip(decoded);
            let below = below
                .flat_map(|(span, sphere)| std::iter::repeat_n(sphere, span.children as usize));
            parents = below.collect();
            tree.nodes.extend(nodes);
        }
        Ok(tree)
    }
}

impl Branch {
    fn of(surfel: &Surfel) -> Branch {
        let Surfel { position, normal, radius, light, colour, error, is_directional } = *surfel;
        let sphere = Sphere { centre: position, radius };
        Branch {
            sphere,
            normal,
            angle: 0.0,
            light,
            radiance: Vec3::from(light) * Vec3::from(colour),
            error,
            area: radius * radius,
            is_directional,
        }
    }

    /// Joins the branches below a node. The standard errors of neighbours come in part from the
    /// same samples, so the error of a mean is the mean of the errors: no less than it is.
    fn join(below: &[Branch]) -> Branch {
        let halves = below.split_at(below.len() / 2);
        let around = |branches: &[Branch]| {
            let spheres = branches.iter().map(|branch| branch.sphere);
            spheres.reduce(Sphere::around).unwrap_or_default()
        };
        let sphere = around(halves.0).around(around(halves.1));
        let (mut normal, mut area, mut light, mut error) = (Vec3::ZERO, 0.0, Vec3::ZERO, 0.0);
        let mut radiance = Vec3::ZERO;
        for branch in below {
            let weighed = Vec3::from(branch.light) * branch.area;
            normal += branch.normal * branch.area;
            area += branch.area;
            light += weighed;
            radiance += branch.radiance * branch.area;
            error += relative_luminance(weighed.into()) * branch.error;
        }
        let first = below.first().map_or(Vec3::Z, |branch| branch.normal);
        let normal = normal.normalize_or(first);
        let angles = below.iter().map(|branch| branch.angle + normal.angle_between(branch.normal));
        let total = relative_luminance(light.into());
        Branch {
            sphere,
            normal,
            angle: angles.fold(0.0, f32::max),
            light: (light / area.max(f32::MIN_POSITIVE)).into(),
            radiance: radiance / area.max(f32::MIN_POSITIVE),
            error: if total > 0.0 { error / total } else { f32::INFINITY },
            area,
            is_directional: below.iter().any(|branch| branch.is_directional),
        }
    }

    /// Returns the colour that makes the light of the surfels below their radiance.
    fn colour(&self) -> [f32; 3] {
        let light = Vec3::from(self.light).max(Vec3::splat(f32::MIN_POSITIVE));
        (self.radiance / light).to_array()
    }

    fn encode(&self, parent: Sphere, children: u32, peak: f32, spacing: f32) -> PackedNode {
        let cone = if self.angle < std::f32::consts::FRAC_PI_2 { self.angle.sin() } else { 1.0 };
        let light = LightCode::new(self.light, self.error, peak);
        let disc = Disc { normal: self.normal, cone, light, is_directional: self.is_directional };
        PackedNode::new(parent, self.sphere, children, disc, spacing)
    }
}

/// Sorts surfels so that every node's are a range, and returns the ranges, level by level.
fn split_levels(surfels: &mut [Surfel]) -> Vec<Vec<Span>> {
    let mut levels = Vec::new();
    let mut ranges = vec![(0, surfels.len() as u32)];
    while !ranges.is_empty() {
        let mut rest = &mut *surfels;
        let mut at = 0;
        let mut pieces = Vec::with_capacity(ranges.len());
        for &(start, end) in &ranges {
            let (_, after) = std::mem::take(&mut rest).split_at_mut((start - at) as usize);
            let (piece, after) = after.split_at_mut((end - start) as usize);
            (rest, at) = (after, end);
            pieces.push(piece);
        }
        let parts: Vec<Vec<u32>> = pieces.into_par_iter().map(quarter).collect();
        let spans = ranges.iter().zip(&parts);
        let spans = spans.map(|(&(start, _), parts)| Span { start, children: parts.len() as u32 });
        levels.push(spans.collect());
        let next = ranges.iter().zip(&parts).flat_map(|(&(start, _), parts)| {
            parts.iter().scan(start, |at, length| {
                let from = std::mem::replace(at, *at + length);
                Some((from, *at))
            })
        });
        ranges = next.collect();
    }
    levels
}

/// Sorts a node's surfels by child. Returns the length of each child's part; none for one surfel.
/// Up to four surfels are children at once.
fn quarter(surfels: &mut [Surfel]) -> Vec<u32> {
    match surfels.len() {
        1 => return Vec::new(),
        count @ ..=4 => return vec![1; count],
        _ => {}
    }
    let middle = halve(surfels);
    let (low, high) = surfels.split_at_mut(middle);
    let mut lengths = Vec::with_capacity(4);
    for half in [low, high] {
        match half.len() {
            1 => lengths.push(1),
            count => {
                let middle = halve(half);
                lengths.extend([middle as u32, (count - middle) as u32]);
            }
        }
    }
    lengths
}

/// Sorts surfels into two parts, and returns the length of the first: by their normals if these
/// differ much, else along the longest axis of their places. Neither part is empty.
fn halve(surfels: &mut [Surfel]) -> usize {
    let (low, high) = bounds(surfels.iter().map(|surfel| surfel.normal));
    let turn = high - low;
    if turn.max_element() > MOST_TURN {
        let axis = turn.max_position();
        let middle = 0.5 * (low[axis] + high[axis]);
        return partition(surfels, |surfel| surfel.normal[axis] < middle);
    }
    let (low, high) = bounds(surfels.iter().map(|surfel| surfel.position));
    let axis = (high - low).max_position();
    let middle = 0.5 * (low[axis] + high[axis]);
    if low == high {
        return surfels.len() / 2;
    }
    let count = partition(surfels, |surfel| surfel.position[axis] < middle);
    let least = (surfels.len() / LEAST_SHARE).max(1);
    let most = surfels.len() - least;
    if (least..=most).contains(&count) {
        return count;
    }
    let count = count.clamp(least, most);
    let along = |a: &Surfel, b: &Surfel| a.position[axis].total_cmp(&b.position[axis]);
    surfels.select_nth_unstable_by(count, along);
    count
}

fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| {
        (low.min(point), high.max(point))
    })
}

/// Sorts surfels so that those with a property come first, and returns how many there are.
fn partition(surfels: &mut [Surfel], is_first: impl Fn(&Surfel) -> bool) -> usize {
    let (mut low, mut high) = (0, surfels.len());
    while low < high {
        if is_first(&surfels[low]) {
            low += 1;
        } else {
            high -= 1;
            surfels.swap(low, high);
        }
    }
    low
}

/// Joins the levels from the last one up.
fn join_levels(surfels: &[Surfel], levels: &[Vec<Span>]) -> Vec<Vec<Branch>> {
    let mut joined: Vec<Vec<Branch>> = Vec::with_capacity(levels.len());
    for spans in levels.iter().rev() {
        let below = joined.last().map_or(&[][..], Vec::as_slice);
        let firsts = spans
            .iter()
            .scan(0, |first, span| Some(std::mem::replace(first, *first + span.children as usize)));
        let firsts: Vec<usize> = firsts.collect();
        let branch = |(span, &first): (&Span, &usize)| match span.children {
            0 => Branch::of(&surfels[span.start as usize]),
            count => Branch::join(&below[first..first + count as usize]),
        };
        let branches = spans.par_iter().zip(&firsts).map(branch).collect();
        joined.push(branches);
    }
    joined.reverse();
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplatFile;

    /// Two sheets of surfels back to back, one bright and one dark.
    fn wall(side: u32) -> Vec<Surfel> {
        let of_sheet = |facing: f32| {
            (0..side * side).map(move |at| Surfel {
                position: Vec3::new((at % side) as f32, (at / side) as f32, 0.1 * facing),
                normal: Vec3::Z * facing,
                radius: 0.8,
                light: if facing > 0.0 { [8.0; 3] } else { [0.5; 3] },
                colour: [1.0; 3],
                error: 0.1,
                is_directional: false,
            })
        };
        of_sheet(1.0).chain(of_sheet(-1.0)).collect()
    }

    #[test]
    fn the_sides_of_a_wall_part_at_the_root_and_keep_their_light() {
        let tree = SplatTree::new(wall(50), 1.0).unwrap();
        assert_eq!((tree.surfels, tree.peak), (5000, 3.0));
        let file = SplatFile::from_bytes(tree.to_bytes(&crate::write::tests::origin())).unwrap();
        let root = file.root().unwrap();
        for child in file.children(&root).unwrap() {
            let disc = child.packed.disc();
            let light = if disc.normal.z > 0.0 { 8.0 } else { 0.5 };
            assert!((disc.light.luminance(tree.peak) / light - 1.0).abs() < 3e-3, "{disc:?}");
            assert!(disc.cone < 0.1 && disc.normal.z.abs() > 0.99);
        }
    }

    #[test]
    fn every_surfel_is_found_once_within_all_spheres_above_it() {
        let tree = SplatTree::new(wall(40), 1.0).unwrap();
        let file = SplatFile::from_bytes(tree.to_bytes(&crate::write::tests::origin())).unwrap();
        let (mut leaves, mut inner, mut nearest) = (0, 0, vec![f32::INFINITY; 3200]);
        let mut stack = vec![(file.root().unwrap(), vec![])];
        while let Some((node, above)) = stack.pop() {
            for sphere in &above {
                let Sphere { centre, radius } = *sphere;
                assert!(node.sphere.centre.distance(centre) <= radius * 1.001);
            }
            let children = file.children(&node).unwrap();
            if children.is_empty() {
                leaves += 1;
                let centre = node.sphere.centre.round();
                let sheet = if node.packed.disc().normal.z > 0.0 { 0 } else { 1600 };
                let place = sheet + centre.y as usize * 40 + centre.x as usize;
                let place = &mut nearest[place];
                assert!(place.is_infinite(), "two surfels at {centre}");
                *place = node.sphere.centre.distance(centre);
            } else {
                inner += 1;
            }
            let above: Vec<_> = above.into_iter().chain([node.sphere]).collect();
            stack.extend(children.into_iter().map(|child| (child, above.clone())));
        }
        assert_eq!((leaves, leaves + inner), (3200, tree.nodes.len()));
        assert!(nearest.iter().all(|distance| *distance < 0.3), "{nearest:?}");
        // Three children each, or more.
        assert!(inner < leaves * 55 / 100, "{inner} inner nodes of {leaves} surfels");
    }

    #[test]
    fn surfels_at_one_place_and_one_alone_make_trees() {
        let one = wall(1)[0];
        assert_eq!(SplatTree::new(vec![one], 1.0).unwrap().nodes.len(), 1);
        let many = SplatTree::new(vec![one; 1000], 1.0).unwrap();
        assert!(many.levels.len() < 12, "{:?}", many.levels);
        assert!(matches!(SplatTree::new(Vec::new(), 1.0), Err(SplatError::Empty)));
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let alone = pool.install(|| SplatTree::new(wall(60), 1.0).unwrap());
        assert_eq!(alone, SplatTree::new(wall(60), 1.0).unwrap());
    }
}
