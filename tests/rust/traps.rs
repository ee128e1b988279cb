//! Trapping regions: every start inside one ends on its attractor.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use std::sync::atomic::AtomicBool;

use pendmap::attractor::Catalogue;
use pendmap::attractor::capture::{Fate, outcomes};
use pendmap::attractor::trap::{Band, Ellipse};
use pendmap::integrate::accuracy::distance;
use pendmap::integrate::{State, Strobe};
use pendmap::model::Pendulum;

use crate::support::{advanced, driven, fine_strobe, plane, searched, simd, undriven};

/// States inside an ellipse: spread over its area, and close to its whole boundary.
fn inside(ellipse: &Ellipse) -> Vec<State> {
    let [a, b, c] = ellipse.shape;
    let at = |radius: f64, angle: f64| {
        let dv = radius * angle.sin() / c;
        [ellipse.centre[0] + (radius * angle.cos() - b * dv) / a, ellipse.centre[1] + dv]
    };
    let edge = (0..64).map(|k| at(0.999, TAU * f64::from(k) / 64.0));
    let area = (0..40).map(|k| {
        let k = f64::from(k);
        at(((k + 0.5) / 40.0).sqrt(), TAU * (k * 0.618_033_988_749_895).fract())
    });
    edge.chain(area).collect()
}

/// Pendulums with their maps and attractors, each searched once.
fn cases() -> &'static [(Pendulum, Strobe, Catalogue)] {
    static CASES: OnceLock<Vec<(Pendulum, Strobe, Catalogue)>> = OnceLock::new();
    CASES.get_or_init(|| {
        [0.3, 0.5, 1.0, 1.34, 1.8]
            .map(|p| driven(0.1, p, 2.0))
            .into_iter()
            .chain([Pendulum::new(0.1, 0.5, 1.5, 0.3, 0.2).expect("in range"), undriven(0.2, 0.0)])
            .map(|pendulum| {
                let (strobe, catalogue) = searched(&pendulum, &plane(100), simd());
                (pendulum, strobe, catalogue)
            })
            .collect()
    })
}

#[test]
fn starts_inside_an_ellipse_converge_to_its_attractor() {
    for (pendulum, strobe, catalogue) in cases() {
        let fine = fine_strobe(pendulum, 2 * strobe.steps(), simd());
        assert!(!catalogue.traps.ellipses.is_empty(), "{pendulum:?}");
        for ellipse in &catalogue.traps.ellipses {
            let attractor = &catalogue.attractors[ellipse.attractor];
            // 600 periods, or one more cycle: even 0.964 has become 1e-10.
            let periods = 600_usize.next_multiple_of(attractor.n.expect("a cycle"));
            let states = inside(ellipse);
            assert!(states.iter().all(|s| ellipse.height(*s) < 1.0));
            for (start, end) in states.iter().zip(advanced(&fine, &states, periods)) {
                let missed = distance(end, ellipse.centre);
                assert!(
                    missed < 1e-8,
                    "{pendulum:?}: {} from {start:?} to {end:?}, {missed:e} away",
                    attractor.name
                );
            }
        }
    }
}

#[test]
fn within_four_returns_the_height_has_fallen() {
    for (pendulum, strobe, catalogue) in cases() {
        for ellipse in &catalogue.traps.ellipses {
            let n = catalogue.attractors[ellipse.attractor].n.expect("a cycle");
            let states = inside(ellipse);
            let heights = |states: &[State]| -> Vec<f64> {
                states
                    .iter()
                    .map(|s| {
                        // The ellipse may be one turn from the wrapped angle.
                        [-TAU, 0.0, TAU]
                            .into_iter()
                            .map(|turn| ellipse.height([s[0] + turn, s[1]]))
                            .fold(f64::INFINITY, f64::min)
                    })
                    .collect()
            };
            let before = heights(&states);
            let mut now = states.clone();
            let mut lowest = before.clone();
            for _ in 0..4 {
                now = advanced(strobe, &now, n);
                for (low, height) in lowest.iter_mut().zip(heights(&now)) {
                    *low = low.min(height);
                }
            }
            for (i, (low, before)) in lowest.iter().zip(&before).enumerate() {
                assert!(low < before, "{pendulum:?} from {:?}: {low} from {before}", states[i]);
            }
        }
    }
}

#[test]
fn ellipses_are_centred_on_the_points_of_their_attractors() {
    for (pendulum, _, catalogue) in cases() {
        for (i, attractor) in catalogue.attractors.iter().enumerate() {
            for (k, point) in attractor.points.iter().enumerate() {
                let at = |e: &&Ellipse| e.attractor == i && e.point == k;
                let own: Vec<&Ellipse> = catalogue.traps.ellipses.iter().filter(at).collect();
                assert!(!own.is_empty(), "{} has no trap at point {k}", attractor.name);
                assert!(own.iter().all(|e| distance(e.centre, *point) < 1e-9));
            }
        }
        // A useful trap is large: it stops an integration long before convergence.
        let widest = catalogue.traps.ellipses.iter().map(|e| 1.0 / e.shape[0]).fold(0.0, f64::max);
        assert!(widest > 0.005, "{pendulum:?}: {widest}");
    }
}

#[test]
fn capture_agrees_with_waiting() {
    // Labels by traps against the states of trajectories after 3000 periods, at a smooth point.
    let pendulum = driven(0.1, 0.6, 2.0);
    let (strobe, catalogue) = searched(&pendulum, &plane(100), simd());
    let starts: Vec<State> = (0..1600).map(|i| plane(40).get(i)).collect();
    let fine = fine_strobe(&pendulum, 3 * strobe.steps(), simd());
    let ends = advanced(&fine, &starts, 3000);
    let mut different = 0;
    for (outcome, end) in
        outcomes(&strobe, &catalogue.traps, 4000, &starts, &AtomicBool::new(false))
            .expect("outcomes")
            .iter()
            .zip(ends)
    {
        let Fate::Captured(label) = outcome.fate else { panic!("{outcome:?}") };
        let reached = catalogue
            .attractors
            .iter()
            .position(|a| a.points.iter().any(|p| distance(*p, end) < 1e-8))
            .expect("some attractor");
        different += usize::from(label != reached);
        assert!(outcome.periods < outcome.work, "two hits, and the first one counts");
    }
    assert_eq!(different, 0, "of 1600 labels");
}

#[test]
fn a_band_holds_the_running_state() {
    for pendulum in [undriven(0.1, 0.5), Pendulum::new(0.1, 0.1, 2.0, 0.0, 0.5).expect("in range")]
    {
        let (strobe, catalogue) = searched(&pendulum, &plane(100), simd());
        let [band] = catalogue.traps.bands.as_slice() else { panic!("one band: {pendulum:?}") };
        assert!(band.half_width > 0.1, "{}", band.half_width);
        let states: Vec<State> = (0..500)
            .map(|k| {
                let k = f64::from(k);
                let theta = TAU * ((k * 0.618_033_988_749_895).fract() - 0.5);
                let side = 0.999 * (2.0 * (k * 0.754_877_666_246_693).fract() - 1.0);
                [theta, band.at(theta) + side * band.half_width]
            })
            .collect();
        assert!(states.iter().all(|s| band.contains(*s)));
        let fine = fine_strobe(&pendulum, 3 * strobe.steps(), simd());
        for (start, end) in states.iter().zip(advanced(&fine, &states, 60)) {
            // Interpolation of the tabulated curve limits the resolved distance.
            let off = (end[1] - band.at(end[0])).abs();
            assert!(off < 5e-3, "{pendulum:?}: {start:?} to {end:?}, {off:e} off");
        }
    }
}

/// States in a band, spread over its width and along both edges.
fn within(band: &Band) -> Vec<State> {
    let state = |k: u32| {
        let k = f64::from(k);
        let theta = TAU * ((k * 0.618_033_988_749_895).fract() - 0.5);
        let side = 2.0 * (k * 0.754_877_666_246_693).fract() - 1.0;
        let side = if k < 100.0 { 0.999 * side.signum() } else { side };
        [theta, band.at(theta) + side * band.half_width]
    };
    (0..200).map(state).collect()
}

#[test]
fn a_trap_holds_no_other_attractor() {
    // Pendulums with a torque near the saddle-node of rest, or anywhere, undriven or weakly driven.
    let mut seen = [0; 2];
    for k in 1..=30_u32 {
        let draw = |ratio: f64| (0.5 + f64::from(k) * ratio).fract();
        let gamma = 0.05 * 30_f64.powf(draw(0.819_172_513_396_164_4));
        let near =
            1.0 - 10_f64.powf(-1.0 - 3.5 * draw(0.671_043_606_703_789_2)) * draw(0.237).signum();
        let size = if k % 3 == 0 { 1.2 * draw(0.549_700_477_901_970_3) } else { near };
        let torque = if k % 2 == 0 { size } else { -size };
        let p = [0.0, 0.0, 0.001, 0.01, 0.1, 0.5][k as usize % 6];
        let omega = 1.0 + 2.0 * draw(0.450_299_522_098_029_7);
        let mut pendulum = Pendulum::new(gamma, p, omega, 0.3, torque).expect("in range");
        if k % 5 == 0 {
            pendulum = pendulum.with_friction(0.002).expect("in range");
        }
        let (strobe, catalogue) = searched(&pendulum, &plane(100), simd());
        let fine = fine_strobe(&pendulum, 2 * strobe.steps(), simd());
        let periods = 300 + (60.0 / (gamma * pendulum.period())) as usize;
        for band in &catalogue.traps.bands {
            seen[0] += 1;
            let states = within(band);
            for (start, end) in states.iter().zip(advanced(&fine, &states, periods)) {
                let off = band.distance(end);
                assert!(off < 0.01, "{pendulum:?}: band {}, {start:?} to {end:?}", band.half_width);
            }
        }
        for ellipse in &catalogue.traps.ellipses {
            seen[1] += 1;
            let attractor = &catalogue.attractors[ellipse.attractor];
            let slowest = -attractor.exponent * pendulum.period();
            let n = attractor.n.expect("a cycle");
            let periods = (300 + (30.0 / slowest) as usize).min(200_000).next_multiple_of(n);
            let states = inside(ellipse);
            for (start, end) in states.iter().zip(advanced(&fine, &states, periods)) {
                let height = ellipse.height([end[0], end[1]]).min(
                    [-TAU, TAU]
                        .map(|turn| ellipse.height([end[0] + turn, end[1]]))
                        .into_iter()
                        .fold(f64::INFINITY, f64::min),
                );
                assert!(
                    height < 0.01,
                    "{pendulum:?}: {} from {start:?} to {end:?}",
                    attractor.name
                );
            }
        }
    }
    assert!(seen[0] > 5 && seen[1] > 15, "{seen:?}");
}
