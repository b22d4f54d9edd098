//! Sums of a view's pixels. Each sample on a visible surface counts in one pixel, and in one more
//! if a mirror shows it too. Reflections in panes have further sums, and so have surfaces that a
//! pixel on an edge shows beside its middle. Panes that no pixel's middle sees have no sums.
//!
//! Noise is therefore independent from pixel to pixel, as the filter assumes.
//!
//! Invariant: the sums in which a sample counts are a function of the sample, the view, and whether
//! the view has looked into its edges.

use crate::light_store::{
    Bucket, Cube, FaceClass, LightStore, Placed, SampleLight, StoredLight, Sums,
};
use crate::owners::{Mirrored, Owners};
use crate::view::SurfaceView;
use crate::visible::EdgePiece;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Cubes whose samples are assigned to pixels together.
const CUBES: usize = 16;

/// Samples from which on those that were assigned are summed up before others are. Else a view of
/// everything would need as much memory again as the store.
const TOGETHER: usize = 1 << 18;

/// Parts of the sums that are added up in parallel.
const PARTS: usize = 8;

/// Consecutive sums that belong to one part.
const STRIPE: usize = 1 << 12;

/// The sums of a view's pixels, followed by those of reflections in panes, those of coats, and
/// those of pieces.
#[derive(Clone, Debug)]
pub struct Gathered {
    sums: Vec<Sums>,
    pixels: usize,
    panes: usize,
    coats: usize,
    owners: Arc<Owners>,
    /// Samples that may lie on pieces, until the view has looked into its edges.
    beside: Vec<Beside>,
}

/// A sample and the number of the sums that it counts in.
struct Claim {
    owner: u32,
    light: SampleLight,
}

/// A sample in the direction of a pixel on an edge, but not on the surface that its middle shows.
#[derive(Clone, Copy, Debug)]
struct Beside {
    pixel: u32,
    point: Vec3,
    face: FaceClass,
    light: SampleLight,
}

/// The claims of some samples.
#[derive(Default)]
struct Claims {
    /// Claims by the part that their sums belong to.
    parts: [Vec<Claim>; PARTS],
    beside: Vec<Beside>,
}

impl Claims {
    #[inline]
    fn push(&mut self, owner: usize, light: SampleLight) {
        self.parts[owner / STRIPE % PARTS].push(Claim { owner: owner as u32, light });
    }
}

impl Gathered {
    /// Gathers all samples of a store that the view sees.
    #[must_use]
    pub fn new(view: &SurfaceView, store: &LightStore) -> Gathered {
        let owners = Arc::new(Owners::new(view, store.grid()));
        let (pixels, panes) = (view.seen.len(), view.panes_of_middles);
        let coats = owners.coat_count();
        let sums = vec![Sums::default(); pixels + panes + coats];
        let mut gathered = Gathered { sums, pixels, panes, coats, owners, beside: Vec::new() };
        gathered.take_all(view, store);
        if !view.edges.is_empty() {
            gathered.look_into_edges(view, store);
        }
        gathered
    }

    /// Gathers the samples of the view's pieces, after the view has looked into its edges.
    pub fn look_into_edges(&mut self, view: &SurfaceView, store: &LightStore) {
        let others = self.pixels + self.panes + self.coats;
        self.sums.truncate(others);
        self.sums.resize(others + view.pieces.len(), Sums::default());
        let new = Arc::make_mut(&mut self.owners).look_into_edges(view);
        let beside = std::mem::take(&mut self.beside);
        let claims = beside.par_chunks(4096).map(|samples| {
            let mut claims = Claims::default();
            for &Beside { pixel, point, face, light } in samples {
                self.claim_piece(view, pixel as usize, (point, face), light, &mut claims);
            }
            claims
        });
        let claims = claims.collect();
        self.sum(claims);
        self.take(view, store, &new);
    }

    /// Returns these sums plus the samples of another store, which rounds places in the same way.
    #[must_use]
    pub(crate) fn with(&self, view: &SurfaceView, further: &LightStore) -> Gathered {
        let mut all = self.clone();
        all.take_all(view, further);
        all
    }

    /// Returns the number of samples that count. A sample that a mirror also shows counts twice.
    #[must_use]
    pub fn samples(&self) -> u64 {
        let [before, coats] = [self.pixels + self.panes, self.coats];
        let counted = self.sums[..before].par_iter().chain(&self.sums[before + coats..]);
        counted.map(|sums| u64::from(sums.count)).sum()
    }

    /// Returns the sums of all pixels.
    pub(crate) fn pixels(&self) -> &[Sums] {
        &self.sums[..self.pixels]
    }

    /// Returns the sums of reflections in panes that the middles of pixels see.
    pub(crate) fn in_panes(&self) -> &[Sums] {
        &self.sums[self.pixels..][..self.panes]
    }

    /// Returns true if a pixel's middle shows a coat.
    pub(crate) fn has_coats(&self) -> bool {
        self.coats > 0
    }

    /// Returns the sums of a pixel from all directions if it shows a coat, and its own otherwise.
    pub(crate) fn of_all_directions(&self, pixel: usize) -> &Sums {
        let coat = self.owners.coat(pixel).map(|coat| self.pixels + self.panes + coat);
        &self.sums[coat.unwrap_or(pixel)]
    }

    /// Returns the sums of all pieces of pixels on edges. Only pieces that are apart have samples.
    pub(crate) fn pieces(&self) -> &[Sums] {
        &self.sums[self.pixels + self.panes + self.coats..]
    }

    /// Adds samples that have come since, for the same view. The result equals [`new`](Self::new)
    /// over all samples.
    pub fn add(&mut self, view: &SurfaceView, placed: &[Placed]) {
        let grid = self.owners.grid;
        let of_samples = |samples: &[Placed]| {
            let mut claims = Claims::default();
            for sample in samples {
                let (cube, record) = grid.record(sample);
                if self.owners.cubes.contains(&cube) {
                    let mirrored = self.owners.mirrors.get(&cube);
                    self.claim(view, (cube, &record), mirrored, &mut claims);
                }
            }
            claims
        };
        let claims = placed.par_chunks(4096).map(of_samples).collect();
        self.sum(claims);
    }

    /// Adds all samples that the view sees.
    fn take_all(&mut self, view: &SurfaceView, store: &LightStore) {
        let cubes: Vec<Cube> = self.owners.cubes.iter().copied().collect();
        self.take(view, store, &cubes);
    }

    /// Adds all samples of some cubes.
    fn take(&mut self, view: &SurfaceView, store: &LightStore, cubes: &[Cube]) {
        let mut rest = cubes;
        while !rest.is_empty() {
            let mut samples = 0;
            let fit = rest.iter().take_while(|cube| {
                let is_next = samples < TOGETHER;
                samples += store.bucket(**cube).map_or(0, Bucket::len);
                is_next
            });
            let (next, others) = rest.split_at(fit.count());
            let of_cubes = |cubes| self.claims_of(view, store, cubes);
            let claims = next.par_chunks(CUBES).map(of_cubes).collect();
            self.sum(claims);
            rest = others;
        }
    }

    /// Returns the claims of all samples of some cubes.
    fn claims_of(&self, view: &SurfaceView, store: &LightStore, cubes: &[Cube]) -> Claims {
        let mut claims = Claims::default();
        for &cube in cubes {
            let Some(bucket) = store.bucket(cube) else { continue };
            let mirrored = self.owners.mirrors.get(&cube);
            for record in bucket.records() {
                self.claim(view, (cube, record), mirrored, &mut claims);
            }
        }
        claims
    }

    /// Adds the claims of one sample.
    #[inline]
    fn claim(
        &self,
        view: &SurfaceView,
        (cube, record): (Cube, &StoredLight),
        mirrored: Option<&Mirrored>,
        claims: &mut Claims,
    ) {
        let owners = &self.owners;
        let (point, face) = (owners.grid.point(cube, record.key), record.key.face());
        let light = record.light;
        if let Some((pixel, is_near)) = owners.pixel(view, point) {
            let seen = &view.seen[pixel];
            if is_near
                && let Some(coat) = owners.coat(pixel)
                && face.is_on(seen.normal, seen.material)
                && seen.away(point, owners.grid.unit).is_some()
            {
                claims.push(self.pixels + self.panes + coat, light);
            }
            if is_near && owners.is_on(view, seen, point, face) {
                claims.push(pixel, light);
            } else if owners.pieces.is_some() {
                self.claim_piece(view, pixel, (point, face), light, claims);
            } else if owners.on_edges[pixel] {
                claims.beside.push(Beside { pixel: pixel as u32, point, face, light });
            }
        }
        let mirrored = mirrored.and_then(|m| m.owner(view, point, face, owners.grid.unit));
        if let Some(owner) = mirrored {
            claims.push(owner, light);
        }
    }

    /// Adds the claim of a sample in the direction of a pixel, if the sample lies on one of the
    /// pixel's pieces.
    fn claim_piece(
        &self,
        view: &SurfaceView,
        pixel: usize,
        (point, face): (Vec3, FaceClass),
        light: SampleLight,
        claims: &mut Claims,
    ) {
        let pieces = self.owners.pieces.as_ref().and_then(|pieces| pieces.get(&pixel));
        let is_on = |piece: &usize| {
            let EdgePiece { seen, is_apart, .. } = &view.pieces[*piece];
            *is_apart && self.owners.is_on(view, seen, point, face)
        };
        if let Some(piece) = pieces.and_then(|pieces| pieces.clone().find(is_on)) {
            claims.push(self.pixels + self.panes + self.coats + piece, light);
        }
    }

    fn sum(&mut self, claims: Vec<Claims>) {
        let mut stripes: [Vec<&mut [Sums]>; PARTS] = Default::default();
        for (number, stripe) in self.sums.chunks_mut(STRIPE).enumerate() {
            stripes[number % PARTS].push(stripe);
        }
        stripes.into_par_iter().enumerate().for_each(|(part, mut stripes)| {
            for claim in claims.iter().flat_map(|claims| &claims.parts[part]) {
                let owner = claim.owner as usize;
                stripes[owner / STRIPE / PARTS][owner % STRIPE].add(&Sums::of(claim.light));
            }
        });
        self.beside.extend(claims.into_iter().flat_map(|claims| claims.beside));
    }
}
