//! The effort of a denoiser.

/// The effort of the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// For pictures that a person waits for. Takes 0.43 of the time of [`High`](Self::High), and
    /// loses 0.1 to 0.2 dB.
    Balanced,
    /// For pictures that are made once.
    High,
}
