//! Vectors of an instruction set as numbers: [`Pack`] is one register, [`Bundle`] several.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::{Simd, WithSimd, bytemuck};

use super::elementary;
use super::isa::Isa;
use super::real::{EXPONENT_BITS, INTEGER_BITS, INTEGER_OFFSET, Lane, ROOT_BITS, Real, Work};
use super::sine::{self, Degree};

/// One vector register of the instruction set `S`.
#[derive(Clone, Copy)]
pub struct Pack<S: Isa> {
    isa: S,
    value: S::f64s,
}

/// `N` registers processed together. One alone waits for its own results; several hide that
/// latency.
///
/// Aligned to a cache line: otherwise half of each would be in the next line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Bundle<S: Isa, const N: usize>([Pack<S>; N]);

impl<S: Isa> Pack<S> {
    #[inline(always)]
    fn new(isa: S, value: S::f64s) -> Self {
        Self { isa, value }
    }

    #[inline(always)]
    fn constant(self, value: f64) -> Self {
        Self::new(self.isa, self.isa.splat_f64s(value))
    }

    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self::new(self.isa, self.isa.multiply_add(self.value, a.value, b.value))
    }
}

struct Apart<W>(W);

impl<W: Work> WithSimd for Apart<W> {
    type Output = ();
    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) {
        self.0.run();
    }
}

// No closures: one that the compiler does not inline would lose the instruction set that
// the caller was compiled for, and run 50 times slower.
macro_rules! operator {
    ($name:ident, $method:ident, $simd:ident) => {
        impl<S: Isa, const N: usize> $name for Bundle<S, N> {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                each!(i in N => {
                    let (a, b) = (&mut self.0[i], other.0[i]);
                    a.value = a.isa.$simd(a.value, b.value);
                });
                self
            }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Isa, const N: usize> Neg for Bundle<S, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        each!(i in N => {
            let a = &mut self.0[i];
            // The compiler recognises a difference and fuses it with sums and products.
            a.value = a.isa.sub_f64s(a.isa.splat_f64s(-0.0), a.value);
        });
        self
    }
}

impl<S: Isa, const N: usize> Real for Bundle<S, N> {
    #[inline(always)]
    fn mul_add(mut self, a: Self, b: Self) -> Self {
        each!(i in N => self.0[i] = self.0[i].mul_add(a.0[i], b.0[i]));
        self
    }

    #[inline(always)]
    fn scale_add(mut self, factor: f64, addend: Self) -> Self {
        let factor = self.0[0].constant(factor);
        each!(i in N => self.0[i] = self.0[i].mul_add(factor, addend.0[i]));
        self
    }

    #[inline(always)]
    fn affine(mut self, factor: f64, addend: f64) -> Self {
        let factor = self.0[0].constant(factor);
        let addend = self.0[0].constant(addend);
        each!(i in N => self.0[i] = self.0[i].mul_add(factor, addend));
        self
    }

    #[inline(always)]
    fn scale(mut self, factor: f64) -> Self {
        let factor = self.0[0].constant(factor);
        each!(i in N => {
            let a = &mut self.0[i];
            a.value = a.isa.mul_f64s(a.value, factor.value);
        });
        self
    }

    #[inline(always)]
    fn sine<D: Degree>(self) -> Self {
        sine::sine::<D, Self>(self)
    }

    #[inline(always)]
    fn cosine<D: Degree>(self) -> Self {
        sine::cosine::<D, Self>(self)
    }

    #[inline(always)]
    fn wrapped(self) -> Self {
        sine::wrap(self, 0.5).0
    }

    #[inline(always)]
    fn exponential(self) -> Self {
        elementary::exponential(self)
    }

    #[inline(always)]
    fn logarithm(self) -> Self {
        elementary::logarithm(self)
    }

    #[inline(always)]
    fn root(mut self) -> Self {
        each!(i in N => {
            let a = &mut self.0[i];
            a.value = a.isa.sqrt_f64s(a.value);
        });
        self
    }

    #[inline(always)]
    fn aside<W: Work>(self, work: W) {
        Self::apart(self.0[0].isa, work);
    }

    #[inline(always)]
    fn sign(self) -> Self {
        self.like(1.0).with_sign_of(self)
    }

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self([self.0[0].constant(value); N])
    }
}

impl<S: Isa, const N: usize> Lane for Bundle<S, N> {
    type Token = S;
    const WIDTH: usize = N * S::F64_LANES;
    const FUSED: bool = S::FUSED;

    #[inline(always)]
    fn apart<W: Work>(isa: S, work: W) {
        isa.vectorize(Apart(work));
    }

    #[inline(always)]
    fn splat(isa: S, value: f64) -> Self {
        Self([Pack::new(isa, isa.splat_f64s(value)); N])
    }

    #[inline(always)]
    fn load(isa: S, source: &[f64]) -> Self {
        // Whole registers: a partial load is a function call.
        let (whole, _) = S::as_simd_f64s(&source[..Self::WIDTH]);
        let mut bundle = Self::splat(isa, 0.0);
        each!(i in N => bundle.0[i].value = whole[i]);
        bundle
    }

    #[inline(always)]
    fn store(self, target: &mut [f64]) {
        let (whole, _) = S::as_mut_simd_f64s(&mut target[..Self::WIDTH]);
        each!(i in N => whole[i] = self.0[i].value);
    }

    #[inline(always)]
    fn first(self) -> f64 {
        // Through memory: extracting a lane is a function call where the instruction set is not known.
        bytemuck::cast_slice(std::slice::from_ref(&self.0[0].value))[0]
    }

    #[inline(always)]
    fn min(mut self, other: Self) -> Self {
        each!(i in N => {
            let (a, b) = (&mut self.0[i], other.0[i]);
            a.value = a.isa.min_f64s(a.value, b.value);
        });
        self
    }

    #[inline(always)]
    fn max(mut self, other: Self) -> Self {
        each!(i in N => {
            let (a, b) = (&mut self.0[i], other.0[i]);
            a.value = a.isa.max_f64s(a.value, b.value);
        });
        self
    }

    #[inline(always)]
    fn with_sign_of(mut self, other: Self) -> Self {
        each!(i in N => {
            let (a, b) = (&mut self.0[i], other.0[i]);
            let isa = a.isa;
            let sign = isa.splat_u64s(1 << 63);
            let other = isa.and_u64s(isa.transmute_u64s_f64s(b.value), sign);
            let bits = isa.transmute_u64s_f64s(isa.abs_f64s(a.value));
            a.value = isa.transmute_f64s_u64s(isa.or_u64s(bits, other));
        });
        self
    }

    #[inline(always)]
    fn signs(self) -> u128 {
        let mut bits = 0;
        each!(i in N => {
            let a = self.0[i];
            bits |= u128::from(a.isa.sign_bits(a.value)) << (i * S::F64_LANES);
        });
        bits
    }

    #[inline(always)]
    fn add_to_exponent(mut self, count: Self) -> Self {
        each!(i in N => {
            let (a, c) = (&mut self.0[i], count.0[i]);
            let isa = a.isa;
            let shifted = isa.lowest_bits_to_exponent(isa.transmute_u64s_f64s(c.value));
            let bits = isa.add_u64s(isa.transmute_u64s_f64s(a.value), shifted);
            a.value = isa.transmute_f64s_u64s(bits);
        });
        self
    }

    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let (mut mantissa, mut exponent) = (self, self);
        each!(i in N => {
            let isa = self.0[i].isa;
            let bits = isa.transmute_u64s_f64s(self.0[i].value);
            let mask = isa.splat_u64s(EXPONENT_BITS);
            let part = isa.and_u64s(isa.sub_u64s(bits, isa.splat_u64s(ROOT_BITS)), mask);
            let one = isa.splat_u64s(1023 << 52);
            let bits = isa.add_u64s(isa.sub_u64s(bits, part), one);
            mantissa.0[i].value = isa.transmute_f64s_u64s(bits);
            let integer = isa.exponent_to_lowest_bits(part);
            let integer = isa.or_u64s(integer, isa.splat_u64s(INTEGER_BITS));
            let offset = isa.splat_f64s(INTEGER_OFFSET);
            exponent.0[i].value = isa.sub_f64s(isa.transmute_f64s_u64s(integer), offset);
        });
        (mantissa, exponent)
    }

    #[inline(always)]
    fn flip_where_odd(mut self, count: Self) -> Self {
        each!(i in N => {
            let (a, c) = (&mut self.0[i], count.0[i]);
            let isa = a.isa;
            let parity = isa.lowest_bit_to_sign(isa.transmute_u64s_f64s(c.value));
            let bits = isa.xor_u64s(isa.transmute_u64s_f64s(a.value), parity);
            a.value = isa.transmute_f64s_u64s(bits);
        });
        self
    }
}
