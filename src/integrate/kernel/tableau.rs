//! Coefficients of the Runge-Kutta-Nystrom method.
//!
//! DPRKN8(6), the eighth-order solution: Dormand, El-Mikkawy & Prince (1987), High-order embedded
//! Runge-Kutta-Nystrom formulae, IMA J. Numer. Anal. 7, 423-430. For `q'' = f(t, q)` with step `h`:
//! `k_i = f(t + c_i h, q + c_i h v + h^2 sum_j a_ij k_j)`, `q += h v + h^2 sum_i b_i k_i`,
//! `v += h sum_i bp_i k_i`. The ninth stage, at the new point, has no weight in this solution.

/// Number of stages with nonzero weight.
pub const STAGES: usize = 8;
/// Order of convergence.
pub const ORDER: i32 = 8;

/// Times of the stages, in steps.
pub const C: [f64; STAGES] =
    [0.0, 1.0 / 20.0, 1.0 / 10.0, 3.0 / 10.0, 1.0 / 2.0, 7.0 / 10.0, 9.0 / 10.0, 1.0];

/// Row `i`: weights of the stages before `i` in its position.
pub const A: [[f64; STAGES - 1]; STAGES] = [
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [1.0 / 800.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [1.0 / 600.0, 1.0 / 300.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [9.0 / 200.0, -9.0 / 100.0, 9.0 / 100.0, 0.0, 0.0, 0.0, 0.0],
    [-66701.0 / 197352.0, 28325.0 / 32892.0, -2665.0 / 5482.0, 2170.0 / 24669.0, 0.0, 0.0, 0.0],
    [
        227015747.0 / 304251000.0,
        -54897451.0 / 30425100.0,
        12942349.0 / 10141700.0,
        -9499.0 / 304251.0,
        539.0 / 9250.0,
        0.0,
        0.0,
    ],
    [
        -1131891597.0 / 901789000.0,
        41964921.0 / 12882700.0,
        -6663147.0 / 3220675.0,
        270954.0 / 644135.0,
        -108.0 / 5875.0,
        114.0 / 1645.0,
        0.0,
    ],
    [
        13836959.0 / 3667458.0,
        -17731450.0 / 1833729.0,
        1063919505.0 / 156478208.0,
        -33213845.0 / 39119552.0,
        13335.0 / 28544.0,
        -705.0 / 14272.0,
        1645.0 / 57088.0,
    ],
];

/// Weights of the position.
pub const B: [f64; STAGES] = [
    223.0 / 7938.0,
    0.0,
    1175.0 / 8064.0,
    925.0 / 6048.0,
    41.0 / 448.0,
    925.0 / 14112.0,
    1175.0 / 72576.0,
    0.0,
];

/// Weights of the velocity.
pub const BP: [f64; STAGES] = [
    223.0 / 7938.0,
    0.0,
    5875.0 / 36288.0,
    4625.0 / 21168.0,
    41.0 / 224.0,
    4625.0 / 21168.0,
    5875.0 / 36288.0,
    223.0 / 7938.0,
];
