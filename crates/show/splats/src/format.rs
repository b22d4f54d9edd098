//! The bytes of a file: header, table of chunks, nodes. `docs/splats.md` draws them.
//!
//! Invariant: the header says the file's length, and is refused if the file has another one. So
//! every size is bounded by the file itself before memory is taken for it.

use glam::{DVec3, Vec3};

use crate::{SplatError, error::DamagedPart, node::Sphere};

/// The first bytes of a file.
pub(crate) const MAGIC: [u8; 8] = *b"holosplt";

/// The version of files that this program writes and reads.
pub const VERSION: u32 = 1;

/// Length of the header.
pub const HEADER_BYTES: usize = 1024;

/// Length of a node.
pub const NODE_BYTES: usize = 8;

/// Nodes of a chunk: what one hash covers. The last chunk may have fewer.
pub const CHUNK_NODES: usize = 8192;

/// Length of a chunk.
pub const CHUNK_BYTES: usize = CHUNK_NODES * NODE_BYTES;

/// Length of an entry of the table of chunks: a hash, and the number of the first child.
pub(crate) const ENTRY_BYTES: usize = HASH_BYTES + 8;

/// Length of a chunk's hash: the first half of a BLAKE3 hash.
pub(crate) const HASH_BYTES: usize = 16;

/// Most levels of a hierarchy. Splits halve, so 2⁴⁸ nodes would fit.
pub const MAX_LEVELS: usize = 48;

/// Place of the starts of levels in the header.
const LEVELS_AT: usize = 256;

/// Place of the hash of the table.
const TABLE_HASH_AT: usize = HEADER_BYTES - 64;

/// Place of the hash of everything before it.
const HEADER_HASH_AT: usize = HEADER_BYTES - 32;

/// What a file says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatHeader {
    /// Number of nodes.
    pub nodes: u64,
    /// Number of surfels, which are the nodes without children.
    pub surfels: u64,
    /// Number of the first node of each level, from the root.
    pub levels: Vec<u64>,
    /// The place in the scene that coordinates are relative to.
    pub origin: DVec3,
    /// The sphere around everything, relative to the origin.
    pub sphere: Sphere,
    /// Binary logarithm of the greatest luminance.
    pub peak: f32,
    /// Distance between surfels, scene units.
    pub spacing: f64,
    /// Metres per scene unit.
    pub unit: f64,
    /// The scene's up axis.
    pub up: [f64; 3],
    /// Radiance of rays that hit nothing.
    pub sky: [f32; 3],
    /// Samples that the light is the mean of.
    pub samples: u64,
    /// The holodeck's generation.
    pub generation: u32,
    /// Hash of the holodeck's packed scene.
    pub scene: [u8; 32],
}

/// Writes fields in order.
struct ByteWriter<'a>(&'a mut [u8], usize);

impl ByteWriter<'_> {
    fn bytes(&mut self, bytes: &[u8]) {
        self.0[self.1..self.1 + bytes.len()].copy_from_slice(bytes);
        self.1 += bytes.len();
    }

    fn doubles(&mut self, values: &[f64]) {
        values.iter().for_each(|value| self.bytes(&value.to_le_bytes()));
    }

    fn floats(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.bytes(&value.to_le_bytes()));
    }
}

/// Reads fields in order.
struct ByteReader<'a>(&'a [u8]);

impl ByteReader<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        let (now, rest) = self.0.split_at(N.min(self.0.len()));
        bytes[..now.len()].copy_from_slice(now);
        self.0 = rest;
        bytes
    }

    fn number(&mut self) -> u64 {
        u64::from_le_bytes(self.bytes())
    }

    fn small(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn doubles<const N: usize>(&mut self) -> [f64; N] {
        [(); N].map(|()| f64::from_le_bytes(self.bytes()))
    }

    fn floats<const N: usize>(&mut self) -> [f32; N] {
        [(); N].map(|()| f32::from_le_bytes(self.bytes()))
    }
}

impl SplatHeader {
    /// Returns the number of chunks.
    pub fn chunks(&self) -> usize {
        self.nodes.div_ceil(CHUNK_NODES as u64) as usize
    }

    /// Returns where the nodes begin in the file.
    pub fn nodes_at(&self) -> usize {
        HEADER_BYTES + self.chunks() * ENTRY_BYTES
    }

    /// Returns the length of the file; `None` if no file can be as long.
    pub(crate) fn file_bytes(&self) -> Option<u64> {
        let nodes = self.nodes.checked_mul(NODE_BYTES as u64)?;
        let table = self.nodes.div_ceil(CHUNK_NODES as u64).checked_mul(ENTRY_BYTES as u64)?;
        nodes.checked_add(table)?.checked_add(HEADER_BYTES as u64)
    }

    /// Encodes the header. `table` is the table of chunks.
    pub(crate) fn encode(&self, table: &[u8]) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        let mut put = ByteWriter(&mut bytes, 0);
        put.bytes(&MAGIC);
        put.bytes(&VERSION.to_le_bytes());
        put.bytes(&(self.levels.len() as u32).to_le_bytes());
        put.bytes(&self.nodes.to_le_bytes());
        put.bytes(&self.surfels.to_le_bytes());
        put.doubles(&self.origin.to_array());
        put.floats(&self.sphere.centre.to_array());
        put.floats(&[self.sphere.radius, self.peak]);
        put.floats(&self.sky);
        put.doubles(&[self.spacing, self.unit]);
        put.doubles(&self.up);
        put.bytes(&self.samples.to_le_bytes());
        put.bytes(&self.generation.to_le_bytes());
        put.bytes(&[0; 4]);
        put.bytes(&self.scene);
        put.1 = LEVELS_AT;
        for start in &self.levels {
            put.bytes(&start.to_le_bytes());
        }
        put.1 = TABLE_HASH_AT;
        put.bytes(blake3::hash(table).as_bytes());
        let hash = blake3::hash(&bytes[..HEADER_HASH_AT]);
        bytes[HEADER_HASH_AT..].copy_from_slice(hash.as_bytes());
        bytes
    }

    /// Decodes the header of a file of this length. Checks the hashes of header and table, and
    /// every value.
    pub(crate) fn decode(file: &[u8]) -> Result<SplatHeader, SplatError> {
        if !file.starts_with(&MAGIC) {
            return Err(SplatError::Foreign);
        }
        let found = file.len() as u64;
        let Some(bytes) = file.get(..HEADER_BYTES) else {
            return Err(SplatError::Length { found, expected: HEADER_BYTES as u64 });
        };
        let mut take = ByteReader(&bytes[MAGIC.len()..]);
        let version = take.small();
        if version != VERSION {
            return Err(SplatError::Version(version));
        }
        if blake3::hash(&bytes[..HEADER_HASH_AT]).as_bytes()[..] != bytes[HEADER_HASH_AT..] {
            return Err(SplatError::Hash(DamagedPart::Header));
        }
        let levels = (take.small() as usize).min(MAX_LEVELS + 1);
        let (nodes, surfels) = (take.number(), take.number());
        let origin = DVec3::from_array(take.doubles());
        let [x, y, z, radius, peak] = take.floats();
        let sky = take.floats();
        let [spacing, unit] = take.doubles();
        let up = take.doubles();
        let (samples, generation) = (take.number(), take.small());
        let _: [u8; 4] = take.bytes();
        let scene = take.bytes();
        let mut starts = ByteReader(&bytes[LEVELS_AT..TABLE_HASH_AT]);
        let levels = (0..levels).map(|_| starts.number()).collect();
        let sphere = Sphere { centre: Vec3::new(x, y, z), radius };
        let header = SplatHeader {
            nodes,
            surfels,
            levels,
            origin,
            sphere,
            peak,
            spacing,
            unit,
            up,
            sky,
            samples,
            generation,
            scene,
        };
        header.check()?;
        let expected = header.file_bytes().unwrap_or(u64::MAX);
        if found != expected {
            return Err(SplatError::Length { found, expected });
        }
        let table = &file[HEADER_BYTES..header.nodes_at()];
        if blake3::hash(table).as_bytes()[..] != bytes[TABLE_HASH_AT..HEADER_HASH_AT] {
            return Err(SplatError::Hash(DamagedPart::Table));
        }
        Ok(header)
    }

    /// Refuses values that no writer writes.
    fn check(&self) -> Result<(), SplatError> {
        let value = |is_sound: bool, reason| match is_sound {
            true => Ok(()),
            false => Err(SplatError::Value(reason)),
        };
        value(
            self.nodes > 0 && self.nodes <= u64::from(u32::MAX),
            "they have no or too many nodes",
        )?;
        value(self.surfels > 0 && self.surfels <= self.nodes, "they have no or too many surfels")?;
        let levels = &self.levels;
        let rise = levels.windows(2).all(|pair| pair[0] < pair[1]);
        let is_whole = levels.first() == Some(&0) && levels.last().is_some_and(|&l| l < self.nodes);
        value(
            levels.len() <= MAX_LEVELS && rise && is_whole,
            "their levels do not follow each other",
        )?;
        let Sphere { centre, radius } = self.sphere;
        let is_sphere = centre.is_finite() && radius.is_finite() && radius > 0.0;
        value(is_sphere && self.origin.is_finite(), "they lie nowhere")?;
        let lengths = [self.spacing, self.unit].iter().all(|l| l.is_finite() && *l > 0.0);
        let numbers = self.up.iter().all(|x| x.is_finite())
            && self.sky.iter().all(|x| x.is_finite() && *x >= 0.0);
        value(lengths && numbers && self.peak.abs() <= 256.0, "a length or a light is no number")
    }
}

/// Writes the hashes that belong to a file's bytes, as far as there are such bytes. So tests of
/// readers reach what lies behind the hashes.
pub fn seal(file: &mut [u8]) {
    let Some((head, rest)) = file.split_at_mut_checked(HEADER_BYTES) else { return };
    let mut take = ByteReader(&head[16..]);
    let nodes = take.number();
    let chunks = nodes.div_ceil(CHUNK_NODES as u64).min((rest.len() / ENTRY_BYTES) as u64) as usize;
    let (table, nodes) = rest.split_at_mut(chunks * ENTRY_BYTES);
    for (entry, nodes) in table.chunks_mut(ENTRY_BYTES).zip(nodes.chunks(CHUNK_BYTES)) {
        entry[..HASH_BYTES].copy_from_slice(&blake3::hash(nodes).as_bytes()[..HASH_BYTES]);
    }
    head[TABLE_HASH_AT..HEADER_HASH_AT].copy_from_slice(blake3::hash(table).as_bytes());
    let hash = blake3::hash(&head[..HEADER_HASH_AT]);
    head[HEADER_HASH_AT..].copy_from_slice(hash.as_bytes());
}
