//! The geometry of a scene in a sealed file, as rays need it. Scenes that differ in materials or
//! light alone share it.
//!
//! The arrays of the file (`holo_mapped::SealedFile`), which belongs to the hash of the geometry:
//!
//! ```text
//! positions    12·P   as in the scene
//! triangles    12·T   as in the scene
//! facets       52·T   vertices, normal and margin of each triangle
//! nodes        128·N  of the hierarchy
//! blocks       192·B  the leaves of the hierarchy
//! reach        4      half the side of the cube around the origin with all vertices, f32
//! ```
//!
//! Invariants: each node of a hierarchy that is read is reached at most once. A traversal needs at
//! most [`LARGE_STACK`] stack entries. Every index is in range. All other numbers are those that
//! were written, if the file's hash is right.

use std::fs::File;
use std::io::{self, Write};
use std::sync::Arc;

use bytemuck::cast_slice;
use holo_mapped::{Array, FileKind, SealError, SealedFile, write_sealed};
use holo_scene::Geometry;
use rayon::prelude::*;

use crate::node::{Hierarchy, LANES, LARGE_STACK, LEAF, TriangleBlock, WIDTH, WideNode};
use crate::raycaster::CastGeometry;

/// Increase the version when an array changes, or when `build` makes other hierarchies.
pub(crate) const KIND: FileKind = FileKind { magic: *b"holobvh\n", version: 2, arrays: 6 };

/// What the file of a geometry has.
#[derive(Clone, Debug)]
pub(crate) struct StoredGeometry {
    pub positions: Array<[f32; 3]>,
    pub triangles: Array<[u32; 3]>,
    pub cast: CastGeometry,
}

/// Writes the geometry of a scene without instances. `hash` is that of the geometry.
pub(crate) fn write(
    scene: &Geometry,
    cast: &CastGeometry,
    hash: [u8; 32],
    out: &mut dyn Write,
) -> io::Result<()> {
    let arrays: [&[u8]; 6] = [
        cast_slice(scene.positions),
        cast_slice(scene.triangles),
        cast_slice(&cast.facets),
        cast_slice(&cast.hierarchy.nodes),
        cast_slice(&cast.hierarchy.blocks),
        bytemuck::bytes_of(&cast.reach),
    ];
    write_sealed(KIND, hash, &arrays, out)
}

/// Maps the geometry with this hash.
pub(crate) fn read(file: &File, hash: &[u8; 32]) -> Result<StoredGeometry, SealError> {
    let file = SealedFile::open(file, KIND, hash)?;
    let (positions, triangles) = (file.array::<[f32; 3]>(0)?, file.array::<[u32; 3]>(1)?);
    let (facets, nodes, blocks) = (file.array(2)?, file.array(3)?, file.array(4)?);
    let reach = file.array::<f32>(5)?;
    let [reach] = reach[..] else { return Err(SealError::Damaged) };
    let count = triangles.len();
    let names_corners = |t: &[u32; 3]| t.iter().all(|&corner| (corner as usize) < positions.len());
    let names_facets = |block: &TriangleBlock| {
        (0..LANES).all(|lane| block.used(lane).is_none_or(|id| (id as usize) < count))
    };
    let is_sound = facets.len() == count
        && triangles.par_iter().all(names_corners)
        && blocks.par_iter().all(names_facets);
    let stack_need = stack_need(&nodes, blocks.len()).filter(|_| is_sound);
    let stack_need = stack_need.ok_or(SealError::Damaged)?;
    let hierarchy = Arc::new(Hierarchy { nodes, blocks, few: None, stack_need });
    let cast = CastGeometry { facets: Arc::new(facets), hierarchy, reach };
    Ok(StoredGeometry { positions, triangles, cast })
}

/// Returns the most stack entries of a traversal. `None` if a reference is wrong, or if there would
/// be more than [`LARGE_STACK`].
fn stack_need(nodes: &[WideNode], blocks: usize) -> Option<usize> {
    // 0: nothing refers to the node.
    let mut depths = vec![0_u16; nodes.len()];
    *depths.first_mut()? = 1;
    let mut deepest = 0;
    for (index, node) in nodes.iter().enumerate() {
        let depth = depths[index];
        deepest = deepest.max(depth);
        for reference in node.children {
            let child = (reference & !LEAF) as usize;
            if reference & LEAF != 0 {
                if child >= blocks {
                    return None;
                }
                continue;
            }
            // Children come after their parents, so there is no circle.
            let is_new = depth > 0 && child > index && depths.get(child) == Some(&0);
            if !is_new {
                return None;
            }
            depths[child] = depth.checked_add(1)?;
        }
    }
    let need = usize::from(deepest) * (WIDTH - 1) + WIDTH;
    (need <= LARGE_STACK).then_some(need)
}

#[cfg(test)]
#[path = "stored_tests.rs"]
pub(crate) mod tests;
