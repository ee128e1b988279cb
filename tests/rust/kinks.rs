//! Rest on a kink of the torque: its growth against the nonlinear map, exact solutions and the smooth limit.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector2;
use pendmap::integrate::reference::flow::Flow;
use pendmap::model::Pendulum;
use pendmap::model::effects::{Effect, Kind};
use pendmap::orbit::kink::PRECISE;
use pendmap::orbit::{KinkedRest, PoincareMap};

/// A pendulum with asymmetric viscous damping.
fn uneven(gamma: f64, p: f64, omega: f64, torque: f64, b: f64) -> Pendulum {
    let effect = Effect::new(Kind::AsymmetricViscous, &[b]).unwrap();
    Pendulum::new(gamma, p, omega, 0.3, torque).unwrap().with_effect(effect).unwrap()
}

#[test]
fn the_derivative_along_a_direction_is_that_of_small_motions() {
    for (p, omega, b) in [(0.5, 1.8, 0.15), (2.0, 0.7, -0.3), (14.2, 10.0, 0.05)] {
        let pendulum = uneven(0.2, p, omega, 0.0, b);
        let flow = Flow::new(&pendulum);
        for theta in [0.0, PI] {
            let rest = KinkedRest::of(&pendulum, theta).unwrap();
            for k in 0..12 {
                let angle = TAU * (f64::from(k) + 0.3) / 12.0;
                let ray = Vector2::new(angle.cos(), angle.sin());
                let linear = rest.along(ray) * ray;
                // Small to the end: what grows would leave the linear range.
                let size = 1e-5 / linear.norm().max(1.0);
                let start = [theta + size * ray[0], size * ray[1]];
                let end = flow.carry(start, 0.0, pendulum.period()).state;
                let image = Vector2::new(end[0] - theta, end[1]) / size;
                let rounding = 1e-14 / size;
                let close = (1e-8 + rounding) * linear.norm().max(1.0);
                let apart = (image - linear).norm();
                assert!(apart < close, "{p} {theta} {k}: {apart} {close} {size}");
            }
        }
    }
}

#[test]
fn an_equilibrium_decays_by_both_half_swings() {
    let (gamma, b, torque) = (0.1, 0.07, 0.5_f64);
    let pendulum = uneven(gamma, 0.0, 2.0, torque, b);
    let rest = KinkedRest::of(&pendulum, torque.asin() + 3e-9).unwrap();
    let stiffness = (1.0 - torque * torque).sqrt();
    let half = |c: f64| PI / (stiffness - c * c / 4.0).sqrt();
    let [forth, back] = [gamma + b, gamma - b];
    let decay = -0.5 * (forth * half(forth) + back * half(back)) / (half(forth) + half(back));
    let exponent = rest.multipliers(PRECISE).exponent(pendulum.period());
    assert!((exponent - decay).abs() < 1e-9, "{exponent} {decay}");
}

#[test]
fn a_kink_that_vanishes_has_the_multipliers_of_smooth_damping() {
    for p in [0.2, 0.6, 1.5] {
        let smooth = Pendulum::new(0.2, p, 1.8, 0.3, 0.0).unwrap();
        assert!(KinkedRest::of(&smooth, 0.0).is_none());
        let matrix = PoincareMap::new(&smooth).once([0.0; 2]).derivative;
        let all =
            KinkedRest::of(&uneven(0.2, p, 1.8, 0.0, 1e-8), 0.0).unwrap().multipliers(PRECISE);
        let expected = pendmap::orbit::floquet::multipliers(&matrix, matrix.determinant());
        assert!((all.0[0] + all.0[1] - expected.0[0] - expected.0[1]).norm() < 1e-7, "{p}");
        assert!((all.largest() - expected.largest()).abs() < 1e-7, "{p}");
    }
}

#[test]
fn what_is_no_rest_or_has_no_kink_has_no_sectors() {
    assert!(KinkedRest::of(&uneven(0.2, 0.5, 1.8, 0.0, 0.1), 0.4).is_none());
    assert!(KinkedRest::of(&uneven(0.2, 0.5, 1.8, 0.1, 0.1), 0.1_f64.asin()).is_none());
    let drag = Effect::new(Kind::QuadraticDrag, &[0.1]).unwrap();
    let smooth = Pendulum::new(0.2, 0.5, 1.8, 0.0, 0.0).unwrap().with_effect(drag).unwrap();
    assert!(KinkedRest::of(&smooth, 0.0).is_none());
}
