//! The texels of a cube, and the samples that enter them.

use crate::face::{FACES, depth};
use crate::grid::{CubeGrid, MOST_RESOLUTION};
use crate::levels::{CubeLevel, LevelTexel};
use glam::Vec3;

/// A ray that left the object, and what it met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectionSample {
    /// Where the ray left the object. The centre, if its place shall not matter.
    pub origin: Vec3,
    /// The unit direction in which it left.
    pub direction: Vec3,
    /// The distance to what it met; infinite for the sky.
    pub distance: f32,
    /// The radiance that came back along it.
    pub radiance: [f32; 3],
    /// The number of paths in the radiance. A sample counts by it.
    pub count: u16,
    /// Samples of a later generation replace those of earlier ones.
    pub generation: u16,
}

/// Light from a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubeLight {
    /// Mean radiance.
    pub radiance: [f32; 3],
    /// The distance to what is seen, from the origin of the look-up; infinite for the sky.
    pub distance: f32,
    /// The angle over which the light is averaged, radians.
    pub spread: f32,
    /// Paths in the texel that is seen; 0 if only others around it are valid.
    pub count: u16,
}

/// What a cube knows of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CubeAnswer {
    /// The light along the ray.
    Light(CubeLight),
    /// No sample arrived near the ray.
    Unknown,
    /// Rays of this direction may hit the object itself, so they must be traced.
    MustTrace,
}

/// The state of a cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CubeStatistics {
    /// All texels of the six faces.
    pub texels: usize,
    /// Texels with a sample.
    pub valid: usize,
    /// Texels whose rays must be traced.
    pub marked: usize,
    /// Memory, bytes.
    pub bytes: usize,
}

/// A texel of the finest level.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CubeTexel {
    /// Mean radiance.
    radiance: [f32; 3],
    /// Mean of 1 / depth, because a plane's inverse depth is linear over a face; 0 for the sky.
    inverse_depth: f32,
    /// Paths in the mean; 0 if the texel is not valid.
    count: u16,
    generation: u16,
}
const _: () = assert!(size_of::<CubeTexel>() == 20);

/// The light around an object, by direction.
#[derive(Clone, Debug)]
pub struct ReflectionCube {
    centre: Vec3,
    grid: CubeGrid,
    texels: Vec<CubeTexel>,
    /// A bit for each texel: its rays may hit the object itself.
    marks: Vec<u64>,
    /// Blurrier levels, each with half the resolution of the one before.
    levels: Vec<CubeLevel>,
    /// Faces that changed since their levels were made.
    stale: [bool; FACES],
    valid: usize,
}

/// Returns the memory of a cube of this resolution, bytes.
#[must_use]
pub fn bytes_of(resolution: u32) -> usize {
    let grid = CubeGrid::new(resolution);
    let texels = grid.len();
    let mut bytes = texels * size_of::<CubeTexel>() + texels.div_ceil(64) * size_of::<u64>();
    let mut coarser = grid.resolution() / 2;
    while coarser > 0 {
        bytes += FACES * (coarser as usize).pow(2) * size_of::<LevelTexel>();
        coarser /= 2;
    }
    bytes
}

/// Returns the resolution for an object that is `pixels` wide in the picture: in the middle of a
/// mirror ball, a texel is then no larger than half a pixel.
#[must_use]
pub fn resolution(pixels: f32) -> u32 {
    CubeGrid::new(pixels.clamp(0.0, MOST_RESOLUTION as f32).ceil() as u32).resolution()
}

impl CubeTexel {
    fn is_valid(&self) -> bool {
        self.count > 0
    }

    /// Averages another texel in. Later generations replace earlier ones.
    fn add(&mut self, other: &CubeTexel) {
        if other.generation < self.generation {
            return;
        }
        if other.generation > self.generation {
            *self = CubeTexel { generation: other.generation, ..CubeTexel::default() };
        }
        let count = self.count.saturating_add(other.count);
        // A texel that has counted to the end goes on as a moving mean.
        let share = f32::from(other.count) / f32::from(count.max(1));
        for (mean, new) in self.radiance.iter_mut().zip(other.radiance) {
            *mean += share * (new - *mean);
        }
        self.inverse_depth += share * (other.inverse_depth - self.inverse_depth);
        self.count = count;
    }
}

impl ReflectionCube {
    /// Makes a cube without light. The resolution is the number of texels along a side of a face.
    /// It is raised to a power of two, as [`CubeGrid::new`] says.
    #[must_use]
    pub fn new(centre: Vec3, resolution: u32) -> ReflectionCube {
        let grid = CubeGrid::new(resolution);
        let texels = grid.len();
        ReflectionCube {
            centre,
            grid,
            texels: vec![CubeTexel::default(); texels],
            marks: vec![0; texels.div_ceil(64)],
            levels: CubeLevel::all_below(grid.resolution()),
            stale: [false; FACES],
            valid: 0,
        }
    }

    /// Returns the same light with another resolution. What a texel knew counts as one path in
    /// texels that are smaller, and as before in larger ones.
    #[must_use]
    pub fn resized(&self, resolution: u32) -> ReflectionCube {
        let mut resized = ReflectionCube::new(self.centre, resolution);
        let is_finer = resized.grid.resolution() > self.grid.resolution();
        let (fine, coarse) =
            if is_finer { (resized.grid, self.grid) } else { (self.grid, resized.grid) };
        let ratio = fine.resolution() / coarse.resolution();
        for of_fine in 0..fine.len() {
            let (face, column, row) = fine.place(of_fine);
            let of_coarse = coarse.number(face, (column / ratio, row / ratio));
            let (from, to) = if is_finer { (of_coarse, of_fine) } else { (of_fine, of_coarse) };
            if self.is_marked(from) {
                resized.set_mark(to);
            }
            let texel = self.texels[from];
            let count = if is_finer { texel.count.min(1) } else { texel.count };
            resized.put(to, &CubeTexel { count, ..texel });
        }
        resized.refresh_levels();
        resized
    }

    /// Returns the centre.
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        self.centre
    }

    /// Returns the texels by direction.
    #[must_use]
    #[inline]
    pub fn grid(&self) -> CubeGrid {
        self.grid
    }

    /// Returns the light of a texel of the [`grid`](Self::grid), seen from the centre. `None` if it
    /// is not valid.
    #[must_use]
    pub fn light_of(&self, texel: usize) -> Option<CubeLight> {
        let CubeTexel { radiance, inverse_depth, count, .. } = *self.valid_texel(texel)?;
        let distance = self.grid.middle(texel).direction().length() / inverse_depth;
        Some(CubeLight { radiance, distance, spread: self.spread_of(0), count })
    }

    /// Returns the number of paths in a texel of the [`grid`](Self::grid); 0 if it is not valid.
    pub(crate) fn count_of(&self, texel: usize) -> u16 {
        self.texels[texel].count
    }

    /// Replaces the radiance of a texel of the [`grid`](Self::grid) that is valid. Returns false if
    /// it is not, or if the radiance is not finite and positive.
    ///
    /// Levels follow at the next [`refresh_levels`](Self::refresh_levels).
    pub fn set_radiance(&mut self, texel: usize, radiance: [f32; 3]) -> bool {
        let is_set = self.valid_texel(texel).is_some() && is_light(radiance);
        if is_set {
            self.texels[texel].radiance = radiance;
            self.stale[self.grid.face(texel)] = true;
        }
        is_set
    }

    /// Returns true if rays in the direction of a texel of the [`grid`](Self::grid) must be traced.
    #[must_use]
    #[inline]
    pub fn is_marked(&self, texel: usize) -> bool {
        self.marks[texel / 64] >> (texel % 64) & 1 != 0
    }

    /// Averages a sample into its texel: that of the point it shows, or of its direction if it
    /// shows the sky. The texel's light is that of the latest generation only. Returns false if
    /// the sample is not a finite, positive radiance from somewhere.
    ///
    /// Levels follow at the next [`refresh_levels`](Self::refresh_levels).
    pub fn insert(&mut self, sample: &ReflectionSample) -> bool {
        let point = sample.origin - self.centre + sample.distance * sample.direction;
        let (towards, inverse_depth) = match point.is_finite() {
            true => (point, 1.0 / depth(point)),
            false => (sample.direction, 0.0),
        };
        let is_somewhere = towards.is_finite() && towards != Vec3::ZERO && sample.distance >= 0.0;
        if !is_light(sample.radiance)
            || !is_somewhere
            || !inverse_depth.is_finite()
            || sample.count == 0
        {
            return false;
        }
        let ReflectionSample { radiance, count, generation, .. } = *sample;
        let texel = CubeTexel { radiance, inverse_depth, count, generation };
        self.put(self.grid.texel_of(towards), &texel);
        true
    }

    /// Notes that rays that leave the object in this direction may hit the object itself.
    pub fn mark_self_hit(&mut self, direction: Vec3) {
        self.set_mark(self.grid.texel_of(direction));
    }

    /// Makes the levels again from all valid texels, on faces that changed.
    pub fn refresh_levels(&mut self) {
        for face in 0..FACES {
            if std::mem::take(&mut self.stale[face]) {
                let side = self.grid.resolution() as usize;
                let texels = &self.texels[face * side * side..][..side * side];
                let of_texel = |texel: &CubeTexel| LevelTexel {
                    radiance: texel.radiance,
                    inverse_depth: texel.inverse_depth,
                    valid: f32::from(u8::from(texel.is_valid())),
                };
                let mut finer: Vec<LevelTexel> = texels.iter().map(of_texel).collect();
                for level in &mut self.levels {
                    finer = level.average(face, &finer);
                }
            }
        }
    }

    /// Returns how much of the cube is filled.
    #[must_use]
    pub fn statistics(&self) -> CubeStatistics {
        CubeStatistics {
            texels: self.grid.len(),
            valid: self.valid,
            marked: self.marks.iter().map(|bits| bits.count_ones() as usize).sum(),
            bytes: bytes_of(self.grid.resolution()),
        }
    }

    /// Returns the angle over which a level averages, radians. Level 0 has the texels.
    pub(crate) fn spread_of(&self, level: usize) -> f32 {
        2.0 / (self.grid.resolution() >> level) as f32
    }

    pub(crate) fn levels(&self) -> &[CubeLevel] {
        &self.levels
    }

    /// Returns a texel of the finest level.
    #[inline]
    pub(crate) fn finest(&self, face: usize, at: (u32, u32)) -> LevelTexel {
        let texel = &self.texels[self.grid.number(face, at)];
        LevelTexel {
            radiance: texel.radiance,
            inverse_depth: texel.inverse_depth,
            valid: if texel.is_valid() { 1.0 } else { 0.0 },
        }
    }

    fn valid_texel(&self, texel: usize) -> Option<&CubeTexel> {
        self.texels.get(texel).filter(|texel| texel.is_valid())
    }

    fn set_mark(&mut self, texel: usize) {
        self.marks[texel / 64] |= 1 << (texel % 64);
    }

    fn put(&mut self, number: usize, new: &CubeTexel) {
        if new.is_valid() {
            let texel = &mut self.texels[number];
            self.valid += usize::from(!texel.is_valid());
            texel.add(new);
            self.stale[self.grid.face(number)] = true;
        }
    }
}

fn is_light(radiance: [f32; 3]) -> bool {
    radiance.iter().all(|c| c.is_finite() && *c >= 0.0)
}
