//! Cells of surface light, which all workers share.

use bytemuck::{Pod, Zeroable};

use super::{Head, RecordReader, put};
use crate::ProtoError;

/// Most estimates in one cell. Sums of more would lose digits.
pub const MAX_ESTIMATES: u32 = 1 << 22;

/// Estimates of the light that a small piece of surface reflects: plain data, little-endian on the
/// wire and in the file. Lengths are in scene units, and points are relative to the scene's origin.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WireCell {
    /// A point of the surface. Its bits, with the other fields up to `level`, name the cell.
    pub point: [f32; 3],
    /// Unit normal on the lit side.
    pub normal: [f32; 3],
    /// Number of the surface's material.
    pub material: u32,
    /// Number of further bounces whose light counts; `u32::MAX` without a limit.
    pub bounces: u32,
    /// Number of times that the width of the widest cells was halved.
    pub level: u16,
    /// Who made the estimates, as the file numbers makers. 0 from a worker.
    pub maker: u16,
    /// Number of estimates, 1 to [`MAX_ESTIMATES`].
    pub count: u32,
    /// Sum of their reflected light per channel, not negative.
    pub light: [f32; 3],
    /// Sum of the shares of light that their places reflect, not negative.
    pub albedo: [f32; 3],
}
const _: () = assert!(size_of::<WireCell>() == 64);

impl WireCell {
    /// Returns true if a worker could have made the cell.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let positive = |v: &[f32; 3]| v.iter().all(|x| x.is_finite() && *x >= 0.0);
        let length: f32 = self.normal.iter().map(|x| x * x).sum();
        self.point.iter().all(|x| x.is_finite())
            && (length - 1.0).abs() < 1e-3
            && (1..=MAX_ESTIMATES).contains(&self.count)
            && positive(&self.light)
            && positive(&self.albedo)
            // A little more than the count, for the rounding of sums.
            && self.albedo.iter().all(|&albedo| albedo <= 1.01 * self.count as f32)
    }
}

/// Cells of surface light: new estimates alone, which a receiver adds to those that it has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellBatch {
    /// The cells, all valid.
    pub cells: Vec<WireCell>,
}

impl CellBatch {
    /// Returns the payload: number and length of the cells, cells.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 + size_of_val(self.cells.as_slice()));
        let head = Head { first: self.cells.len() as u32, second: size_of::<WireCell>() as u32 };
        put(&mut out, &head);
        out.extend_from_slice(bytemuck::cast_slice(&self.cells));
        out
    }

    /// Parses a payload.
    ///
    /// # Errors
    /// Any [`ProtoError`] about counts; [`ProtoError::Number`] for an impossible cell.
    pub fn decode(bytes: &[u8]) -> Result<CellBatch, ProtoError> {
        let mut reader = RecordReader(bytes);
        let head: Head = reader.one("message of cells")?;
        if head.second != size_of::<WireCell>() as u32 {
            return Err(ProtoError::Number("the length of a cell"));
        }
        let cells = reader.many::<WireCell>("list of cells", u64::from(head.first))?;
        reader.end()?;
        if !cells.iter().all(WireCell::is_valid) {
            return Err(ProtoError::Number("a cell of surface light"));
        }
        Ok(CellBatch { cells })
    }
}
