//! One build for every processor: the instruction set is chosen when a call begins.

use std::fmt;
use std::str::FromStr;

use pulp::{Scalar, Simd, WithSimd};
use serde::{Deserialize, Serialize};

use super::isa::Isa;
use crate::error::Error;

/// An instruction set of the kernel. All give the same results within rounding; AVX-512 and AVX2 give the
/// same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum InstructionSet {
    /// AVX-512: 96 lanes in twelve registers.
    Avx512,
    /// AVX2 with FMA: 24 lanes in six registers.
    Avx2,
    /// SSE4.2, without FMA: 12 lanes in six registers.
    Sse,
    /// NEON of 64-bit ARM, with FMA: 24 lanes in twelve registers.
    Neon,
    /// Plain Rust, for any processor.
    Portable,
}

impl InstructionSet {
    /// All instruction sets, fastest first.
    pub const ALL: [Self; 5] = [Self::Avx512, Self::Avx2, Self::Sse, Self::Neon, Self::Portable];

    /// The name accepted by `PENDMAP_SIMD` and shown by `pendmap info`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "avx512",
            Self::Avx2 => "avx2",
            Self::Sse => "sse",
            Self::Neon => "neon",
            Self::Portable => "portable",
        }
    }

    /// Whether this processor can run it.
    #[must_use]
    pub fn available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
            Self::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(all(target_arch = "x86_64", feature = "sse"))]
            Self::Sse => pulp::x86::V2::try_new().is_some(),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => pulp::aarch64::Neon::try_new().is_some(),
            #[allow(unreachable_patterns, reason = "one for what this build leaves out")]
            _ => false,
        }
    }

    /// The instruction set named by `PENDMAP_SIMD`, or else the fastest of this processor.
    ///
    /// # Errors
    /// [`Error::Simd`] if the variable names no instruction set, or one that this processor lacks.
    pub fn choose() -> Result<Self, Error> {
        match std::env::var("PENDMAP_SIMD") {
            Ok(name) if !name.is_empty() => {
                let simd: Self = name.parse()?;
                if simd.available() { Ok(simd) } else { Err(Error::Simd { name }) }
            }
            _ => Ok(Self::ALL.into_iter().find(|simd| simd.available()).unwrap_or(Self::Portable)),
        }
    }
}

/// One register of an instruction set, as numbers that hold a derivative in each lane.
#[derive(Clone, Copy, Debug)]
pub enum Register {
    /// Eight numbers.
    #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
    Avx512(pulp::x86::V4),
    /// Four.
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    /// Single numbers: the compiler's vectorisation of a loop is as good as two.
    Single,
}

impl InstructionSet {
    /// Its register, or the single one if the processor lacks it.
    #[must_use]
    pub fn register(self) -> Register {
        #[cfg(target_arch = "x86_64")]
        match self {
            #[cfg(feature = "avx512")]
            Self::Avx512 => {
                if let Some(isa) = pulp::x86::V4::try_new() {
                    return Register::Avx512(isa);
                }
            }
            Self::Avx2 => {
                if let Some(isa) = pulp::x86::V3::try_new() {
                    return Register::Avx2(isa);
                }
            }
            _ => {}
        }
        Register::Single
    }
}

impl Register {
    /// How many numbers it holds.
    #[must_use]
    pub const fn width(self) -> usize {
        match self {
            #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
            Self::Avx512(_) => 8,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => 4,
            Self::Single => 1,
        }
    }
}

impl fmt::Display for InstructionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for InstructionSet {
    type Err = Error;
    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|simd| simd.name() == name)
            .ok_or_else(|| Error::Simd { name: name.to_owned() })
    }
}

/// Work that is written once and compiled for every instruction set.
pub trait Job {
    /// The result of the work.
    type Output;
    /// The work; mark the implementation `#[inline(always)]`, and all that it calls in its loops.
    fn run<S: Isa>(self, isa: S) -> Self::Output;
}

struct Entry<J, S>(J, S);

impl<J: Job, S: Isa> WithSimd for Entry<J, S> {
    type Output = J::Output;
    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) -> J::Output {
        self.0.run(self.1)
    }
}

// One module each: the compiler distributes work over processors by modules.
macro_rules! entries {
    ($($(#[$condition:meta])* $module:ident: $isa:ty;)*) => {$(
        $(#[$condition])*
        mod $module {
            use super::{Entry, Job, Simd};

            #[inline(never)]
            pub(super) fn run<J: Job>(isa: $isa, job: J) -> J::Output {
                Simd::vectorize(isa, Entry(job, isa))
            }
        }
    )*};
}

entries! {
    #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
    avx512: pulp::x86::V4;
    #[cfg(target_arch = "x86_64")]
    avx2: pulp::x86::V3;
    #[cfg(all(target_arch = "x86_64", feature = "sse"))]
    sse: pulp::x86::V2;
    #[cfg(target_arch = "aarch64")]
    neon: pulp::aarch64::Neon;
    portable: pulp::Scalar;
}

/// Runs `job` on `simd`, or on the portable one if the processor lacks it.
pub fn run<J: Job>(simd: InstructionSet, job: J) -> J::Output {
    #[cfg(target_arch = "x86_64")]
    match simd {
        #[cfg(feature = "avx512")]
        InstructionSet::Avx512 => {
            if let Some(isa) = pulp::x86::V4::try_new() {
                return avx512::run(isa, job);
            }
        }
        InstructionSet::Avx2 => {
            if let Some(isa) = pulp::x86::V3::try_new() {
                return avx2::run(isa, job);
            }
        }
        #[cfg(feature = "sse")]
        InstructionSet::Sse => {
            if let Some(isa) = pulp::x86::V2::try_new() {
                return sse::run(isa, job);
            }
        }
        _ => {}
    }
    #[cfg(target_arch = "aarch64")]
    if simd == InstructionSet::Neon
        && let Some(isa) = pulp::aarch64::Neon::try_new()
    {
        return neon::run(isa, job);
    }
    let _ = simd;
    portable::run(Scalar::new(), job)
}
