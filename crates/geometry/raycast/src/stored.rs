//! A hierarchy as bytes, so that a scene that was opened before need not be built again.
//!
//! Numbers are in the machine's own byte order, because the bytes never leave the machine.
//!
//! ```text
//! 0         8      magic "holobvh\n"
//! 8         4      version, u32
//! 12        4      T, number of the scene's triangles, u32
//! 16        4      N, number of nodes, u32
//! 20        4      B, number of leaf blocks, u32
//! 24        32     BLAKE3 hash of the scene's geometry
//! 56        32     BLAKE3 hash of all that follows
//! 88        128·N  nodes, as in memory
//! 88+128N   16·B   the triangles of each block, 4 × u32; 2³²-1 for an unused lane
//! ```
//!
//! Vertices are not stored. Blocks are filled from the scene, so that no bytes can move a triangle.
//!
//! Invariants: a hierarchy that is read belongs to the scene. Each of its nodes is reached at most
//! once. A traversal needs at most [`LARGE_STACK`] stack entries.

use std::fmt;
use std::io::{self, Read, Write};

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use crate::NO_TRIANGLE;
use crate::facet::Facet;
use crate::node::{Hierarchy, LANES, LARGE_STACK, LEAF, TriangleBlock, WIDTH, WideNode};

const MAGIC: [u8; 8] = *b"holobvh\n";

/// Increase this when the format changes, or when `build` makes other hierarchies.
const VERSION: u32 = 1;

/// Most nodes and blocks of a hierarchy for each triangle. Spatial splits refer to a triangle more
/// than once; obvhs adds at most a third.
const MOST_PER_TRIANGLE: u64 = 2;

/// The bytes before the nodes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct HierarchyHeader {
    magic: [u8; 8],
    version: u32,
    triangles: u32,
    nodes: u32,
    blocks: u32,
    geometry: [u8; 32],
    content: [u8; 32],
}
const _: () = assert!(size_of::<HierarchyHeader>() == 88);

/// The triangles of a leaf.
type Ids = [u32; LANES];

/// The reason why a stored hierarchy is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoredError {
    /// Another version of this program wrote it, or another program.
    Version,
    /// It belongs to another scene.
    Scene,
    /// Its length or its hash is wrong, or the file cannot be read.
    Damaged,
}

impl fmt::Display for StoredError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Version => "it is of another version of this program",
            Self::Scene => "it belongs to another scene",
            Self::Damaged => "it is damaged",
        })
    }
}

impl std::error::Error for StoredError {}

/// Writes a hierarchy of a scene whose geometry has this hash.
pub(crate) fn write(
    hierarchy: &Hierarchy,
    triangles: usize,
    geometry: [u8; 32],
    out: &mut dyn Write,
) -> io::Result<()> {
    let ids: Vec<Ids> = hierarchy
        .blocks
        .iter()
        .map(|block| std::array::from_fn(|lane| block.used(lane).unwrap_or(NO_TRIANGLE)))
        .collect();
    let (nodes, ids) = (bytemuck::cast_slice(&hierarchy.nodes), bytemuck::cast_slice(&ids));
    let header = HierarchyHeader {
        magic: MAGIC,
        version: VERSION,
        triangles: triangles as u32,
        nodes: hierarchy.nodes.len() as u32,
        blocks: hierarchy.blocks.len() as u32,
        geometry,
        content: hash(nodes, ids),
    };
    out.write_all(bytemuck::bytes_of(&header))?;
    out.write_all(nodes)?;
    out.write_all(ids)
}

/// A hierarchy that was read, still without vertices.
pub(crate) struct StoredHierarchy {
    nodes: Vec<WideNode>,
    ids: Vec<Ids>,
    stack_need: usize,
}

/// Reads the hierarchy of a scene with this number of triangles and this hash of its geometry.
/// `bytes` is the length of the input.
pub(crate) fn read(
    input: &mut dyn Read,
    bytes: u64,
    triangles: usize,
    geometry: [u8; 32],
) -> Result<StoredHierarchy, StoredError> {
    let damaged = |_| StoredError::Damaged;
    let mut header = HierarchyHeader::zeroed();
    input.read_exact(bytemuck::bytes_of_mut(&mut header)).map_err(damaged)?;
    if header.magic != MAGIC || header.version != VERSION {
        return Err(StoredError::Version);
    }
    if header.geometry != geometry || header.triangles as usize != triangles {
        return Err(StoredError::Scene);
    }
    let (nodes, blocks) = (u64::from(header.nodes), u64::from(header.blocks));
    let content = nodes * size_of::<WideNode>() as u64 + blocks * size_of::<Ids>() as u64;
    let most = MOST_PER_TRIANGLE * triangles as u64;
    if nodes.max(blocks) > most || bytes != size_of::<HierarchyHeader>() as u64 + content {
        return Err(StoredError::Damaged);
    }
    let mut nodes: Vec<WideNode> = holo_cpu::zeroed(header.nodes as usize);
    let mut ids: Vec<Ids> = bytemuck::zeroed_vec(header.blocks as usize);
    input.read_exact(bytemuck::cast_slice_mut(&mut nodes)).map_err(damaged)?;
    input.read_exact(bytemuck::cast_slice_mut(&mut ids)).map_err(damaged)?;
    if hash(bytemuck::cast_slice(&nodes), bytemuck::cast_slice(&ids)) != header.content {
        return Err(StoredError::Damaged);
    }
    let stack_need = stack_need(&nodes, ids.len()).ok_or(StoredError::Damaged)?;
    Ok(StoredHierarchy { nodes, ids, stack_need })
}

impl StoredHierarchy {
    /// Fills the leaves with the vertices of the scene's facets.
    pub(crate) fn over(self, facets: &[Facet]) -> Result<Hierarchy, StoredError> {
        let exists = |&id: &u32| id == NO_TRIANGLE || (id as usize) < facets.len();
        if !self.ids.par_iter().all(|ids| ids.iter().all(exists)) {
            return Err(StoredError::Damaged);
        }
        let mut blocks = holo_cpu::reserved(self.ids.len());
        blocks.par_extend(self.ids.par_iter().map(|ids| block(ids, facets)));
        Ok(Hierarchy { nodes: self.nodes, blocks, few: None, stack_need: self.stack_need })
    }
}

fn block(ids: &Ids, facets: &[Facet]) -> TriangleBlock {
    let mut block = TriangleBlock::EMPTY;
    for (lane, &id) in ids.iter().enumerate().filter(|(_, id)| **id != NO_TRIANGLE) {
        block.set(lane, id, facets[id as usize].vertices.map(|v| v.to_array()));
    }
    block
}

fn hash(nodes: &[u8], ids: &[u8]) -> [u8; 32] {
    *blake3::Hasher::new().update(nodes).update(ids).finalize().as_bytes()
}

/// Returns the most stack entries of a traversal. `None` if a reference is wrong, or if there would
/// be more than [`LARGE_STACK`].
fn stack_need(nodes: &[WideNode], blocks: usize) -> Option<usize> {
    // 0: nothing refers to the node.
    let mut depths = vec![0_usize; nodes.len()];
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
            depths[child] = depth + 1;
        }
    }
    let need = deepest * (WIDTH - 1) + WIDTH;
    (need <= LARGE_STACK).then_some(need)
}

#[cfg(test)]
#[path = "stored_tests.rs"]
pub(crate) mod tests;
