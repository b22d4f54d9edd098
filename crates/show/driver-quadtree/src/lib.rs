//! The drivers `quadtree` and `cells`: pictures from samples alone, without a scene.
//!
//! The [driver](quadtree_driver) draws a whole session. It shows the samples of the last view in
//! the next view until that view's own samples have arrived. For one view it has a [`Quadtree`]
//! (Larson & Simmons 1999, §2.4.3) or [`ViewCells`] (§2.4.4).
//!
//! # How a picture is made
//!
//! 1. *Landing* (`reproject`). A sample is a ray with a distance, so it ends at a point of the
//!    scene. The sample lands in the pixel that shows this point, at a depth.
//! 2. *Sums* (`bins`, `sums`). Each pixel has bins by logarithm of depth. A bin has integer sums
//!    over its samples: of colours, of weights, and of squares for variances. There are two sets of
//!    bins. *Aligned* samples look in nearly the same direction as the eye; all others are
//!    *oblique*.
//! 3. *Leaves* (`pyramid`, `surface`). A drawing first makes all leaves of the quadtree, from
//!    pixels up to one leaf as large as the picture. A leaf has *surfaces*: runs of adjacent depth
//!    bins. Each surface has a mean colour and an estimate of its samples' noise.
//! 4. *Choice of the surface* (`shown`, `standing`). A pixel shows its nearest surface. If samples
//!    pass near the eye, the pixel is a mixture of surfaces by the numbers of these samples. An
//!    empty pixel shows a surface of the smallest leaf around it that has samples.
//! 5. *Choice of the leaf* (`leaf`, `blend`). The surface's colour is a mean over larger and larger
//!    leaves, as long as the confidence intervals of the means overlap.
//! 6. *Aligned or all samples* (`agreement`). There are many more oblique samples than aligned
//!    ones. They are left out where they differ from the aligned ones, as on glossy surfaces and
//!    mirrors.
//!
//! [`ViewCells`] use the same sums, and the same colours for pixels with samples. They fill the
//! other pixels from the nearest samples instead of from larger leaves. On 42 sets of samples of a
//! known room that is 0.6 dB better on average, 2 dB at most, and never worse (example
//! `cells_quality`).
//!
//! Pixels that no section covers stay 0 until live rays arrive for them (`live`).
//!
//! # Invariants
//!
//! - A picture is a function of the set of samples. Their order, their batches and the number of
//!   threads change no bit of it.
//! - No mean is taken across a jump in depth.
//! - As the number of samples grows, every pixel tends to the mean of its own samples: the box
//!   filter. There is one exception. If the eye is outside a section, an object before the section
//!   hides the surfaces that the section's rays see behind it.
//! - A pixel whose middle no section covers is 0, whatever its neighbours are, unless live rays
//!   have arrived. A pixel whose best beam sees nothing is the sky, or black if the view clips it.
//! - After a rotation of more than 20°, no sample of the earlier view is used. Once a view has
//!   settled, its pictures use its own samples alone.
//!
//! # Where a change goes
//!
//! - Reuse of samples from view to view, and the interface to front ends: `driver`, `log`.
//! - Pixel and weight of a sample: `reproject`. The quantities that are summed: `sums`.
//! - Edges, silhouettes, samples that see past an edge: `shown`, `standing`.
//! - Noise against detail: `leaf`, and the estimates of noise in `surface`.
//! - Pixels between samples in cells: `cells`.
//! - The choice of other beams to fetch: `beams`, `depths`.
//!
//! Failed experiments and measurements are in docs/notes/quadtree.md.

mod agreement;
mod beams;
mod bins;
mod blend;
mod cells;
mod depths;
mod driver;
mod leaf;
mod live;
mod log;
mod paint;
mod pixels;
mod pyramid;
mod reproject;
mod shown;
mod standing;
mod sums;
mod surface;
mod tree;

pub use cells::{Filling, ViewCells};
pub use driver::{cells_driver, quadtree_driver};
pub use tree::{LeafSize, Quadtree, QuadtreeParams};
