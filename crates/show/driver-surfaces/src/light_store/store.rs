//! All samples, in buckets by place. Each bucket has the samples on the surfaces in a cube of
//! space.
//!
//! Invariants:
//! - While all samples fit, the content does not depend on the order in which they came. Earlier
//!   samples go by their own random numbers and by how many present ones came.
//! - Samples never exceed their share of memory. The buckets that no view has read for longest go
//!   first. If all were read in the last round, every other sample goes, whatever its light.

use super::cell::{FaceClass, Key, PLACES, SampleLight, Sums};
use super::place::Placed;
use glam::{IVec3, Vec3};
use holo_display::split_mix;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::mem::take;
use std::sync::{
    OnceLock,
    atomic::{AtomicU32, Ordering},
};

/// Parts of the store, each filled by one thread at a time.
const SHARDS: usize = 64;

/// Samples that are sorted into shards together.
const CHUNK: usize = 8192;

/// So many present samples on a face in a bucket replace all earlier ones there. Fewer leave one
/// of 2 to the power of their number. So light of the scene before goes wherever it is seen, even
/// if it came in beams that are not traced again.
const REPLACED: u32 = 16;

/// A full list of samples grows by its length divided by this. Doubling would leave up to half of
/// the memory empty.
const GROWTH: usize = 4;

/// Offset of the grid, in buckets, so that walls at round coordinates do not lie on a border.
const OFFSET: f32 = 0.3819;

/// One sample: its place and face in its bucket, and its light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredLight {
    pub key: Key,
    pub light: SampleLight,
}

/// Samples, and their sums.
#[derive(Debug, Default)]
struct Samples {
    records: Vec<StoredLight>,
    /// Sums of all samples, by face.
    faces: Vec<(FaceClass, Sums)>,
}

/// The samples on the surfaces in a cube of space.
#[derive(Debug, Default)]
pub(crate) struct Bucket {
    present: Samples,
    /// Samples of the scene before an edit. Each present sample on their face halves their number.
    earlier: Samples,
    /// The round in which the bucket was made or last read.
    round: AtomicU32,
}

/// The number of a bucket's place: 21 bits along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Cube(u64);

/// Maps points to places and buckets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// Width of a place, scene units.
    pub unit: f32,
}

impl Grid {
    /// Returns a point in units of buckets.
    #[inline]
    fn place(self, point: Vec3) -> Vec3 {
        point / (self.unit * PLACES) + OFFSET
    }

    /// Returns the width of a cube, scene units.
    pub fn cube_width(self) -> f32 {
        self.unit * PLACES
    }

    /// Returns the cube that a point lies in.
    #[inline]
    pub fn cube(self, point: Vec3) -> Cube {
        Cube::at(self.place(point))
    }

    /// Returns a sample's cube, and its record there.
    #[inline]
    pub fn record(self, sample: &Placed) -> (Cube, StoredLight) {
        let place = self.place(sample.point);
        let cube = Cube::at(place);
        let key = Key::new((place - cube.corner()) * PLACES, sample.face);
        (cube, StoredLight { key, light: sample.light })
    }

    /// Returns the point of a record, rounded to the middle of its place.
    #[inline]
    pub fn point(self, cube: Cube, key: Key) -> Vec3 {
        (cube.corner() - OFFSET) * (self.unit * PLACES) + key.at() * self.unit
    }
}

/// Light on surfaces.
#[derive(Debug)]
pub struct LightStore {
    shards: Vec<FxHashMap<Cube, Bucket>>,
    grid: Grid,
    most_samples: usize,
    /// One of 2^`thinned` samples is stored.
    thinned: u32,
    round: u32,
    /// Samples that were added, and those that are kept.
    samples: u64,
    kept: usize,
    /// Mean light of all samples, once it was needed since the last change.
    mean: OnceLock<Vec3>,
}

impl Cube {
    /// Returns the cube that contains a place in units of buckets.
    #[inline]
    fn at(place: Vec3) -> Cube {
        // Conversions from floats to integers saturate.
        let [x, y, z] = place.floor().as_ivec3().to_array().map(|c| c as u64 & 0x1f_ffff);
        Cube(x << 42 | y << 21 | z)
    }

    /// Returns the cube's lower corner, in units of buckets.
    #[inline]
    fn corner(self) -> Vec3 {
        // Shifting up and down again extends the sign.
        let part = |shift: u32| ((self.0 >> shift & 0x1f_ffff) as i32) << 11 >> 11;
        IVec3::new(part(42), part(21), part(0)).as_vec3()
    }
}

impl Samples {
    fn add(&mut self, record: StoredLight) {
        let (face, sums) = (record.key.face(), Sums::of(record.light));
        match self.faces.iter_mut().find(|(known, _)| *known == face) {
            Some((_, total)) => total.add(&sums),
            None => self.faces.push((face, sums)),
        }
        let length = self.records.len();
        if length == self.records.capacity() {
            self.records.reserve_exact((length / GROWTH).max(GROWTH));
        }
        self.records.push(record);
    }

    /// Leaves some of the samples. Returns whether others went.
    fn retain(&mut self, stays: impl FnMut(&StoredLight) -> bool) -> bool {
        let before = self.records.len();
        self.records.retain(stays);
        let is_less = self.records.len() < before;
        if is_less {
            // The greatest of a sum's samples is known only from all of them.
            self.faces.clear();
            take(&mut self.records).into_iter().for_each(|record| self.add(record));
        }
        is_less
    }

    /// Returns how many samples came for a face.
    fn count(&self, face: FaceClass) -> u32 {
        let known = self.faces.iter().find(|(known, _)| *known == face);
        known.map_or(0, |(_, sums)| sums.count)
    }
}

impl Bucket {
    /// Returns all samples.
    pub fn records(&self) -> impl Iterator<Item = &StoredLight> {
        self.present.records.iter().chain(&self.earlier.records)
    }

    fn faces(&self) -> impl Iterator<Item = &(FaceClass, Sums)> {
        self.present.faces.iter().chain(&self.earlier.faces)
    }

    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.present.records.len() + self.earlier.records.len()
    }

    /// Leaves of the earlier samples those that still count. Returns whether others went.
    fn fade(&mut self) -> bool {
        let Bucket { present, earlier, .. } = self;
        !earlier.records.is_empty()
            && earlier.retain(|record| record.lasts(present.count(record.key.face())))
    }

    /// Takes out earlier samples, each as often as is stated. Returns whether there were any.
    fn remove(&mut self, leaving: &mut FxHashMap<Bits, u32>) -> bool {
        self.earlier.retain(|record| match leaving.get_mut(&record.bits()) {
            Some(left) if *left > 0 => {
                *left -= 1;
                false
            }
            _ => true,
        })
    }
}

/// What makes a record equal to another one.
type Bits = (u64, u64);

impl StoredLight {
    fn bits(&self) -> Bits {
        (self.key.0, self.light.number())
    }

    /// Returns true if the sample stays when one of 2^`thinned` samples is stored.
    fn stays(&self, thinned: u32) -> bool {
        self.random() & ((1 << thinned) - 1) == 0
    }

    /// Returns whether an earlier sample counts beside so many present ones.
    fn lasts(&self, present: u32) -> bool {
        present < REPLACED && self.random().leading_zeros() >= present
    }

    fn random(&self) -> u64 {
        split_mix(split_mix(self.key.0) ^ self.light.number())
    }
}

impl LightStore {
    /// Returns an empty store of at most this many bytes of samples. Places of samples are rounded
    /// to `finest`, scene units.
    #[must_use]
    pub fn new(finest: f32, most_bytes: usize) -> LightStore {
        let shards = (0..SHARDS).map(|_| FxHashMap::default()).collect();
        let list_bytes = most_bytes / (GROWTH + 1) * GROWTH;
        let most_samples = (list_bytes / size_of::<StoredLight>()).max(SHARDS);
        LightStore {
            shards,
            grid: Grid { unit: finest },
            most_samples,
            thinned: 0,
            round: 1,
            samples: 0,
            kept: 0,
            mean: OnceLock::new(),
        }
    }

    /// Returns the number of samples that were added.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the greatest number of samples that fit.
    pub(crate) fn most_samples(&self) -> usize {
        self.most_samples
    }

    /// Returns the mean light of all samples.
    pub(crate) fn mean(&self) -> Vec3 {
        *self.mean.get_or_init(|| self.sums().mean())
    }

    /// Returns the sums of all samples.
    fn sums(&self) -> Sums {
        let of_shard = |shard: &FxHashMap<Cube, Bucket>| {
            let mut sums = Sums::default();
            let faces = shard.values().flat_map(Bucket::faces);
            faces.for_each(|(_, more)| sums.add(more));
            sums
        };
        let sums: Vec<Sums> = self.shards.par_iter().map(of_shard).collect();
        let mut all = Sums::default();
        sums.iter().for_each(|more| all.add(more));
        all
    }

    /// Returns the number of stored samples.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.kept
    }

    fn count_kept(&mut self) {
        let buckets = self.shards.iter().flat_map(|shard| shard.values());
        self.kept = buckets.map(Bucket::len).sum();
    }

    /// Adds placed samples. Returns true if earlier ones have gone.
    pub fn add(&mut self, placed: &[Placed]) -> bool {
        self.put(placed, |bucket| &mut bucket.present)
    }

    /// Adds placed samples of the scene before an edit, as far as they still count.
    pub fn add_earlier(&mut self, placed: &[Placed]) {
        self.put(placed, |bucket| &mut bucket.earlier);
    }

    fn put(
        &mut self,
        placed: &[Placed],
        kind: impl Fn(&mut Bucket) -> &mut Samples + Sync,
    ) -> bool {
        self.mean.take();
        let dealt: Vec<Vec<Vec<(Cube, StoredLight)>>> =
            placed.par_chunks(CHUNK).map(|chunk| self.deal(chunk)).collect();
        let (round, thinned) = (self.round, self.thinned);
        let fill = |(number, shard): (usize, &mut FxHashMap<Cube, Bucket>)| {
            let mut kept = 0;
            let mut fading: FxHashSet<Cube> = FxHashSet::default();
            for &(cube, record) in dealt.iter().flat_map(|lists| &lists[number]) {
                let make = || Bucket { round: AtomicU32::new(round), ..Bucket::default() };
                let bucket = shard.entry(cube).or_insert_with(make);
                if record.stays(thinned) {
                    kind(bucket).add(record);
                    kept += 1;
                    if !bucket.earlier.records.is_empty() {
                        fading.insert(cube);
                    }
                }
            }
            // All of them, and not only until the first that has faded.
            let faded = fading.iter().filter_map(|cube| shard.get_mut(cube)?.fade().then_some(()));
            (kept, faded.count() > 0)
        };
        let (kept, faded) = self
            .shards
            .par_iter_mut()
            .enumerate()
            .map(fill)
            .reduce(|| (0, false), |a, b| (a.0 + b.0, a.1 | b.1));
        self.kept += kept;
        if faded {
            self.count_kept();
        }
        self.samples += placed.len() as u64;
        if self.kept > self.most_samples {
            self.shrink();
        }
        faded
    }

    /// Takes out samples of the scene before an edit, one for each given. Those that have gone are
    /// ignored. Returns whether there were any.
    pub fn remove_earlier(&mut self, placed: &[Placed]) -> bool {
        self.mean.take();
        let dealt = self.deal(placed);
        let clear = |(shard, records): (&mut FxHashMap<Cube, Bucket>, Vec<(Cube, StoredLight)>)| {
            let mut leaving: FxHashMap<Cube, FxHashMap<Bits, u32>> = FxHashMap::default();
            for (cube, record) in records {
                *leaving.entry(cube).or_default().entry(record.bits()).or_default() += 1;
            }
            let removed = leaving.into_iter().filter_map(|(cube, mut leaving)| {
                shard.get_mut(&cube)?.remove(&mut leaving).then_some(())
            });
            removed.count() > 0
        };
        self.samples = self.samples.saturating_sub(placed.len() as u64);
        let removed =
            self.shards.par_iter_mut().zip(dealt).map(clear).reduce(|| false, |a, b| a | b);
        if removed {
            self.count_kept();
        }
        removed
    }

    /// Returns the records of some samples, by shard.
    fn deal(&self, placed: &[Placed]) -> Vec<Vec<(Cube, StoredLight)>> {
        let room = || Vec::with_capacity(2 * CHUNK / SHARDS);
        let mut lists: Vec<Vec<_>> = (0..SHARDS).map(|_| room()).collect();
        for sample in placed {
            let (cube, record) = self.grid.record(sample);
            lists[shard_of(cube)].push((cube, record));
        }
        lists
    }

    /// Removes samples until at most three quarters of those that fit are left.
    fn shrink(&mut self) {
        let most = self.most_samples / 4 * 3;
        let mut rounds: Vec<(u32, usize)> = Vec::new();
        for bucket in self.shards.iter().flat_map(|shard| shard.values()) {
            rounds.push((bucket.round.load(Ordering::Relaxed), bucket.len()));
        }
        rounds.sort_unstable_by_key(|&(round, _)| std::cmp::Reverse(round));
        let (mut oldest, mut kept) = (self.round, 0);
        for (round, count) in rounds {
            kept += count;
            if kept > most {
                oldest = self.round.min(round + 1);
                break;
            }
            oldest = round;
        }
        for shard in &mut self.shards {
            shard.retain(|_, bucket| *bucket.round.get_mut() >= oldest);
        }
        self.count_kept();
        while self.kept > most {
            self.thinned += 1;
            let thinned = self.thinned;
            self.shards.par_iter_mut().flat_map_iter(|shard| shard.values_mut()).for_each(
                |bucket| {
                    for Samples { records, .. } in [&mut bucket.present, &mut bucket.earlier] {
                        records.retain(|record| record.stays(thinned));
                        records.shrink_to_fit();
                    }
                },
            );
            self.count_kept();
        }
    }

    /// Begins a round. Buckets read in it outlive those last read in earlier rounds.
    pub fn begin_round(&mut self) {
        self.round += 1;
    }

    /// Returns the grid of places.
    pub(crate) fn grid(&self) -> Grid {
        self.grid
    }

    /// Returns a cube's samples.
    pub(crate) fn bucket(&self, cube: Cube) -> Option<&Bucket> {
        let bucket = self.shards[shard_of(cube)].get(&cube)?;
        bucket.round.store(self.round, Ordering::Relaxed);
        Some(bucket)
    }

    /// Returns the sums of all samples in the 8 buckets nearest to a point, on faces for which
    /// `serves` is true.
    pub(crate) fn around(&self, point: Vec3, serves: impl Fn(FaceClass) -> bool) -> Sums {
        let mut sums = Sums::default();
        let place = self.grid.place(point);
        for corner in 0..8 {
            let side =
                Vec3::new((corner & 1) as f32, (corner >> 1 & 1) as f32, (corner >> 2) as f32);
            let cube = Cube::at(place - 0.5 + side);
            if let Some(bucket) = self.bucket(cube) {
                let faces = bucket.faces().filter(|(face, _)| serves(*face));
                faces.for_each(|(_, more)| sums.add(more));
            }
        }
        sums
    }
}

fn shard_of(cube: Cube) -> usize {
    (split_mix(cube.0) >> 58) as usize % SHARDS
}
