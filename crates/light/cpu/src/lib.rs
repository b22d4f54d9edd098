//! Access to features of the processor: instruction sets and large pages.
//!
//! One place detects instruction sets for the whole project. Loops that gain from wide
//! instructions are written once, as a [`Kernel`], and compiled for each set.
//!
//! Invariants:
//! - Only time depends on the processor. Results are the same to the bit.
//! - An [`Isa`] exists only if this processor has every instruction that its kernels use.

mod isa;
mod memory;

pub use isa::{Instructions, Isa, Kernel};
pub use memory::{reserved, zeroed};
