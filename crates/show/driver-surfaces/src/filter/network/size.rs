//! The size of the network.

/// Number of inputs.
pub(crate) const INPUTS: usize = 15;

/// Units of a hidden layer.
pub(super) const HIDDEN: usize = 16;
