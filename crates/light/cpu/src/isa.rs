//! Compiles each loop for any processor, for AVX2 and for AVX-512, and picks one copy at run time.
//!
//! Invariant: all copies return the same bits. They have the same source, no loop reorders sums
//! across lanes, and [`Isa::run`] compiles none with fused multiply-add.

/// A set of instructions that loops are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The instructions that every processor of this architecture has.
    Portable,
    /// x86-64 with AVX2, FMA, BMI1 and BMI2.
    Avx2,
    /// [`Avx2`](Self::Avx2) with AVX-512 F, VL, BW and DQ.
    Avx512,
}

impl Instructions {
    /// Returns the widest set that this processor has.
    pub fn best() -> Self {
        let wide = [Self::Avx512, Self::Avx2];
        wide.into_iter().find(|set| set.is_available()).unwrap_or(Self::Portable)
    }

    /// Returns all sets that this processor has, the narrowest first.
    pub fn available() -> Vec<Self> {
        let all = [Self::Portable, Self::Avx2, Self::Avx512];
        all.into_iter().filter(|set| set.is_available()).collect()
    }

    /// Returns whether this processor has every instruction of the set.
    ///
    /// A virtual machine may hide any one of them, so the function checks each by name.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }
}

/// A loop over arrays. `run` must be `#[inline(always)]`, so that each instruction set compiles
/// its own copy.
pub trait Kernel {
    /// What the loop returns.
    type Output;
    /// Runs the loop.
    fn run(self) -> Self::Output;
}

/// Proof that this processor has a set of instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Isa(Instructions);

impl Isa {
    /// Returns the widest set that this processor has.
    pub fn best() -> Self {
        Self(Instructions::best())
    }

    /// Returns the proof, or `None` if this processor lacks any of the instructions.
    pub fn new(wanted: Instructions) -> Option<Self> {
        wanted.is_available().then_some(Self(wanted))
    }

    /// Returns the proven set.
    pub fn instructions(self) -> Instructions {
        self.0
    }

    /// Runs a loop with these instructions.
    #[inline]
    #[allow(unsafe_code)]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            // SAFETY: the value proves that the processor has what `avx2` enables.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { avx2(kernel) },
            // SAFETY: the value proves that the processor has what `avx512` enables.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_available_only_with_every_instruction_its_kernels_use() {
        #[cfg(target_arch = "x86_64")]
        {
            let bit_instructions =
                is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2");
            for set in [Instructions::Avx2, Instructions::Avx512] {
                assert!(!set.is_available() || bit_instructions, "{set:?}");
            }
        }
        assert!(Instructions::Portable.is_available());
        assert!(Instructions::best().is_available());
    }

    #[test]
    fn every_available_set_gives_the_same_result() {
        struct Sum<'a>(&'a [u32]);
        impl Kernel for Sum<'_> {
            type Output = u32;
            #[inline(always)]
            fn run(self) -> u32 {
                self.0.iter().fold(0, |sum, n| sum.wrapping_mul(31).wrapping_add(*n))
            }
        }
        let numbers: Vec<u32> = (0..1000).collect();
        let expected = Sum(&numbers).run();
        for set in Instructions::available() {
            let isa = Isa::new(set).expect("it is available");
            assert_eq!(isa.run(Sum(&numbers)), expected, "{set:?}");
        }
    }
}
