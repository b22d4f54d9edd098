//! Reads a file node by node.

use std::{fmt, fs::File, path::Path, sync::OnceLock};

use holo_mapped::FileBytes;

use crate::{
    PackedNode, SplatError, SplatHeader,
    children::{ChildSums, count},
    error::DamagedPart,
    format::{CHUNK_NODES, ENTRY_BYTES, HASH_BYTES, HEADER_BYTES},
    node::Sphere,
};

/// A node and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatNode {
    /// Its number.
    pub number: u32,
    /// Its sphere.
    pub sphere: Sphere,
    /// Its bytes.
    pub packed: PackedNode,
}

/// Splats of a holodeck, ready to be drawn.
pub struct SplatFile {
    header: SplatHeader,
    bytes: FileBytes,
    /// What was found of chunks that were needed.
    chunks: Vec<OnceLock<ChunkState>>,
}

/// What was found of a chunk.
enum ChunkState {
    /// Its bytes have their hash, and its nodes' children are no others' children.
    Sound(Box<ChildSums>),
    /// Its bytes do not have their hash.
    Changed,
    /// Its nodes have children that are also children of the next chunk's nodes.
    Overlapping,
}

impl fmt::Debug for SplatFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SplatFile").field("header", &self.header).finish_non_exhaustive()
    }
}

impl SplatFile {
    /// Opens a file, and compares the hashes of its header and table. Other bytes are read when
    /// they are needed.
    ///
    /// # Errors
    /// If the file cannot be read, or is no splats, cut off or changed.
    pub fn open(path: &Path) -> Result<SplatFile, SplatError> {
        let io = |error| SplatError::Io { action: "reading", path: path.to_owned(), error };
        let file = File::open(path).map_err(io)?;
        // Nothing can be mapped of an empty file.
        if file.metadata().map_err(io)?.len() == 0 {
            return Err(SplatError::Foreign);
        }
        SplatFile::new(FileBytes::map(&file).map_err(io)?)
    }

    /// Reads splats that are in memory.
    ///
    /// # Errors
    /// As [`SplatFile::open`].
    pub fn from_bytes(bytes: Vec<u8>) -> Result<SplatFile, SplatError> {
        SplatFile::new(FileBytes::Owned(bytes))
    }

    fn new(bytes: FileBytes) -> Result<SplatFile, SplatError> {
        let header = SplatHeader::decode(&bytes)?;
        let chunks = (0..header.chunks()).map(|_| OnceLock::new()).collect();
        Ok(SplatFile { header, bytes, chunks })
    }

    /// Returns what the file says of itself.
    pub fn header(&self) -> &SplatHeader {
        &self.header
    }

    /// Returns the length of the file.
    pub fn file_bytes(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Returns the root.
    ///
    /// # Errors
    /// If its chunk is damaged.
    pub fn root(&self) -> Result<SplatNode, SplatError> {
        self.node(0, self.header.sphere)
    }

    /// Returns the node of this number. `parent` is the sphere of its parent.
    ///
    /// # Errors
    /// If its chunk is damaged, or there is no such node.
    pub fn node(&self, number: u32, parent: Sphere) -> Result<SplatNode, SplatError> {
        let (nodes, _) = self.chunk(number as usize / CHUNK_NODES)?;
        let packed = nodes.get(number as usize % CHUNK_NODES);
        let packed = *packed.ok_or(SplatError::Value("a node is missing"))?;
        let sphere = packed.sphere(parent, self.header.spacing as f32);
        Ok(SplatNode { number, sphere, packed })
    }

    /// Returns the number of the first child of a node that has children.
    ///
    /// # Errors
    /// If its chunk is damaged, or names children that cannot be its own.
    pub fn first_child(&self, node: &SplatNode) -> Result<u32, SplatError> {
        let chunk = node.number as usize / CHUNK_NODES;
        let (nodes, sums) = self.chunk(chunk)?;
        let before = sums.before(nodes, node.number as usize % CHUNK_NODES);
        let child = self.first_of(chunk).saturating_add(before);
        let end = child.saturating_add(u64::from(node.packed.children()));
        if child <= u64::from(node.number) || end > self.header.nodes {
            return Err(SplatError::Value("a node names children that cannot be its own"));
        }
        // Both are at most the number of nodes, which fits.
        Ok(child as u32)
    }

    /// Returns the children of a node.
    ///
    /// # Errors
    /// As [`SplatFile::first_child`], and if a child's chunk is damaged.
    pub fn children(&self, node: &SplatNode) -> Result<Vec<SplatNode>, SplatError> {
        match node.packed.children() {
            0 => Ok(Vec::new()),
            count => {
                let first = self.first_child(node)?;
                (first..first + count).map(|number| self.node(number, node.sphere)).collect()
            }
        }
    }

    /// Compares every byte with its hash.
    ///
    /// # Errors
    /// The first damage.
    pub fn verify(&self) -> Result<(), SplatError> {
        (0..self.chunks.len()).try_for_each(|chunk| self.chunk(chunk).map(|_| ()))
    }

    /// Returns the nodes of a chunk, once its hash was compared.
    #[inline]
    fn chunk(&self, number: usize) -> Result<(&[PackedNode], &ChildSums), SplatError> {
        let state = self.chunks.get(number).ok_or(SplatError::Value("a node is missing"))?;
        let nodes = self.chunk_nodes(number);
        match state.get_or_init(|| self.examine(number, nodes)) {
            ChunkState::Sound(sums) => Ok((nodes, sums)),
            ChunkState::Changed => Err(SplatError::Hash(DamagedPart::Chunk(number))),
            ChunkState::Overlapping => Err(SplatError::Value("two nodes name the same children")),
        }
    }

    /// Compares a chunk with its entry and the next one. A node is thus the child of one node at
    /// most, and no traversal visits it twice.
    fn examine(&self, number: usize, nodes: &[PackedNode]) -> ChunkState {
        let at = HEADER_BYTES + number * ENTRY_BYTES;
        let hash = blake3::hash(bytemuck::cast_slice(nodes));
        if hash.as_bytes()[..HASH_BYTES] != self.bytes[at..at + HASH_BYTES] {
            return ChunkState::Changed;
        }
        let end = self.first_of(number).saturating_add(u64::from(count(nodes)));
        let most = match number + 1 < self.chunks.len() {
            true => self.first_of(number + 1),
            false => self.header.nodes,
        };
        if end > most {
            return ChunkState::Overlapping;
        }
        ChunkState::Sound(Box::new(ChildSums::new(nodes)))
    }

    /// Returns the number of the first child of a chunk's nodes, as the table says.
    fn first_of(&self, chunk: usize) -> u64 {
        let at = HEADER_BYTES + chunk * ENTRY_BYTES + HASH_BYTES;
        let mut first = [0; 8];
        first.copy_from_slice(&self.bytes[at..at + 8]);
        u64::from_le_bytes(first)
    }

    fn chunk_nodes(&self, number: usize) -> &[PackedNode] {
        let nodes: &[PackedNode] = bytemuck::cast_slice(&self.bytes[self.header.nodes_at()..]);
        let start = number * CHUNK_NODES;
        &nodes[start..(start + CHUNK_NODES).min(nodes.len())]
    }
}
