//! Compiles each loop three times, for any processor, AVX2 and AVX-512, and picks one when the program runs.
//!
//! Always true: results are equal bit for bit. The loops are the same source; none reorders sums across lanes, and products and
//! sums are never fused (no kernel has FMA enabled, and Rust does not contract).

/// Which instructions a [`PointImage`](super::PointImage) may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// What every processor of this architecture has.
    Portable,
    /// x86-64 with AVX2.
    Avx2,
    /// x86-64 with AVX-512 F, VL, BW and DQ.
    Avx512,
}

impl Instructions {
    /// The widest that this processor has.
    pub fn best() -> Self {
        [Self::Avx512, Self::Avx2]
            .into_iter()
            .find(|wide| wide.are_here())
            .unwrap_or(Self::Portable)
    }

    /// Whether this processor has them.
    pub fn are_here(self) -> bool {
        Isa::new(self).is_some()
    }
}

/// A loop over arrays. `run` must be `#[inline(always)]`, so that it is compiled for the processor that calls it.
pub(crate) trait Kernel {
    type Output;
    fn run(self) -> Self::Output;
}

/// Proof that this processor has the instructions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Isa(Instructions);

impl Isa {
    /// The widest that this processor has.
    pub fn best() -> Self {
        Self(Instructions::best())
    }

    pub fn new(wanted: Instructions) -> Option<Self> {
        let here = match wanted {
            Instructions::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        };
        here.then_some(Self(wanted))
    }

    pub fn instructions(self) -> Instructions {
        self.0
    }

    #[inline]
    #[allow(unsafe_code)]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            // SAFETY: the value proves that the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { avx2(kernel) },
            // SAFETY: the value proves that the processor has these parts of AVX-512.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { avx512(kernel) },
            _ => kernel.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,avx512f,avx512vl,avx512bw,avx512dq")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
