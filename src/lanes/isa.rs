//! The instruction sets, as additions to `pulp`'s vectors.

use pulp::{Scalar, Simd, cast};

use super::pack::Bundle;
use super::real::{Fused, Lane};

/// An instruction set of the lane arithmetic.
pub trait Isa: Simd {
    /// Whether a product and a sum round once.
    const FUSED: bool;
    /// Lanes of a bundle: enough registers to hide the latency of one.
    type Lanes: Lane<Token = Self>;
    /// Lanes of what needs more registers: events and effects.
    type Narrow: Lane<Token = Self>;
    /// Lanes of a small bundle, for a handful of trajectories, and for numbers with a derivative.
    type Few: Lane<Token = Self>;
    /// One trajectory with the same arithmetic, bit for bit.
    type Single: Lane<Token = ()>;

    /// `a * b + c`, rounded once where [`Isa::FUSED`] and twice elsewhere.
    fn multiply_add(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s;
    /// Moves the lowest bit of each number to its sign and clears the others.
    fn lowest_bit_to_sign(self, bits: Self::u64s) -> Self::u64s;
    /// Moves the lowest 12 bits of each number to its sign and exponent and clears the others.
    fn lowest_bits_to_exponent(self, bits: Self::u64s) -> Self::u64s;
    /// The inverse.
    fn exponent_to_lowest_bits(self, bits: Self::u64s) -> Self::u64s;
    /// A bit for each number whose sign bit is set, the first one's lowest.
    fn sign_bits(self, values: Self::f64s) -> u8;
}

impl Isa for Scalar {
    const FUSED: bool = false;
    type Lanes = Bundle<Self, 8>;
    type Narrow = Bundle<Self, 6>;
    type Few = Bundle<Self, 4>;
    type Single = f64;

    #[inline(always)]
    fn multiply_add(self, a: f64, b: f64, c: f64) -> f64 {
        a * b + c
    }
    #[inline(always)]
    fn lowest_bit_to_sign(self, bits: u64) -> u64 {
        bits << 63
    }
    #[inline(always)]
    fn lowest_bits_to_exponent(self, bits: u64) -> u64 {
        bits << 52
    }
    #[inline(always)]
    fn exponent_to_lowest_bits(self, bits: u64) -> u64 {
        bits >> 52
    }
    #[inline(always)]
    fn sign_bits(self, value: f64) -> u8 {
        u8::from(value.is_sign_negative())
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use pulp::x86::{V2, V3, V4};

    use super::{Bundle, Fused, Isa, Simd, cast};

    impl Isa for V2 {
        const FUSED: bool = false;
        type Lanes = Bundle<Self, 6>;
        type Narrow = Bundle<Self, 4>;
        type Few = Bundle<Self, 4>;
        type Single = f64;

        #[inline(always)]
        fn multiply_add(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
            self.add_f64s(self.mul_f64s(a, b), c)
        }
        #[inline(always)]
        fn lowest_bit_to_sign(self, bits: Self::u64s) -> Self::u64s {
            cast(self.sse2._mm_slli_epi64::<63>(cast(bits)))
        }
        #[inline(always)]
        fn lowest_bits_to_exponent(self, bits: Self::u64s) -> Self::u64s {
            cast(self.sse2._mm_slli_epi64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn exponent_to_lowest_bits(self, bits: Self::u64s) -> Self::u64s {
            cast(self.sse2._mm_srli_epi64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn sign_bits(self, values: Self::f64s) -> u8 {
            self.sse2._mm_movemask_pd(cast(values)) as u8
        }
    }

    impl Isa for V3 {
        const FUSED: bool = true;
        type Lanes = Bundle<Self, 6>;
        type Narrow = Bundle<Self, 4>;
        type Few = Bundle<Self, 3>;
        type Single = Fused;

        #[inline(always)]
        fn multiply_add(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
            self.mul_add_e_f64s(a, b, c)
        }
        #[inline(always)]
        fn lowest_bit_to_sign(self, bits: Self::u64s) -> Self::u64s {
            cast(self.avx2._mm256_slli_epi64::<63>(cast(bits)))
        }
        #[inline(always)]
        fn lowest_bits_to_exponent(self, bits: Self::u64s) -> Self::u64s {
            cast(self.avx2._mm256_slli_epi64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn exponent_to_lowest_bits(self, bits: Self::u64s) -> Self::u64s {
            cast(self.avx2._mm256_srli_epi64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn sign_bits(self, values: Self::f64s) -> u8 {
            self.avx._mm256_movemask_pd(cast(values)) as u8
        }
    }

    impl Isa for V4 {
        const FUSED: bool = true;
        type Lanes = Bundle<Self, 12>;
        type Narrow = Bundle<Self, 6>;
        type Few = Bundle<Self, 2>;
        type Single = Fused;

        #[inline(always)]
        fn multiply_add(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
            self.mul_add_e_f64s(a, b, c)
        }
        #[inline(always)]
        fn lowest_bit_to_sign(self, bits: Self::u64s) -> Self::u64s {
            cast(self.avx512f._mm512_slli_epi64::<63>(cast(bits)))
        }
        #[inline(always)]
        fn lowest_bits_to_exponent(self, bits: Self::u64s) -> Self::u64s {
            cast(self.avx512f._mm512_slli_epi64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn exponent_to_lowest_bits(self, bits: Self::u64s) -> Self::u64s {
            cast(self.avx512f._mm512_srli_epi64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn sign_bits(self, values: Self::f64s) -> u8 {
            self.avx512dq._mm512_movepi64_mask(cast(values))
        }
    }
}

#[cfg(target_arch = "aarch64")]
mod aarch64 {
    use pulp::aarch64::Neon;

    use super::{Bundle, Fused, Isa, Simd, cast};

    impl Isa for Neon {
        const FUSED: bool = true;
        type Lanes = Bundle<Self, 12>;
        type Narrow = Bundle<Self, 6>;
        type Few = Bundle<Self, 4>;
        type Single = Fused;

        #[inline(always)]
        fn multiply_add(self, a: Self::f64s, b: Self::f64s, c: Self::f64s) -> Self::f64s {
            self.mul_add_e_f64s(a, b, c)
        }
        #[inline(always)]
        fn lowest_bit_to_sign(self, bits: Self::u64s) -> Self::u64s {
            cast(self.neon.vshlq_n_u64::<63>(cast(bits)))
        }
        #[inline(always)]
        fn lowest_bits_to_exponent(self, bits: Self::u64s) -> Self::u64s {
            cast(self.neon.vshlq_n_u64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn exponent_to_lowest_bits(self, bits: Self::u64s) -> Self::u64s {
            cast(self.neon.vshrq_n_u64::<52>(cast(bits)))
        }
        #[inline(always)]
        fn sign_bits(self, values: Self::f64s) -> u8 {
            u8::from(values.0.is_sign_negative()) | u8::from(values.1.is_sign_negative()) << 1
        }
    }
}
