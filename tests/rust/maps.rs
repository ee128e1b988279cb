use crate::support::*;
use std::time::Instant;
#[test]
fn scratch() {
    for (g,p,w,t) in [(0.1,0.5,2.0,0.0),(0.1,1.0,2.0,0.0),(0.1,1.34,2.0,0.0),(0.1,0.6,2.0,0.0),(0.1,1.03,0.87,0.0),(0.1,1.7,0.87,0.0),(0.1,1.5,1.8,0.0),(0.1,2.0,2.0,0.0),(0.1,1.2,2.0,0.0),(0.1,1.8,2.0,0.0),(0.5,30.0,14.0,0.0),(0.0,1.0,2.0,0.0),(0.1,0.0,1.0,0.5),(0.1,0.1,1.0,0.5),(0.1,0.1,2.0,0.5),(0.1,0.1,0.87,0.5)] {
        let pend = pendmap::model::Pendulum::new(g,p,w,0.0,t).unwrap();
        let n = std::env::var("N").ok().and_then(|n| n.parse().ok()).unwrap_or(100);
        let start = Instant::now();
        let m = basins_on_plane(&pend, n);
        eprintln!("g {g} p {p} w {w} t {t}: {:.2}s steps {} err {:.1e} plane {:?} bound {} mean {:.0} open {} und {:.4} fail {:.4}", start.elapsed().as_secs_f64(), m.steps, m.reached_error, m.plane, m.bound, m.mean_periods(), m.labels.open.len(), m.share(0), m.share(-1));
        for (a,f) in m.attractors.iter().zip(&m.fractions) {
            eprintln!("    {} f {f:.4} n {:?} w {:?} twin {:?} exp {:.5}±{:.5} first {:?} period {:?} mult {:?} sense {}", a.name, a.n, a.w, a.twin, a.exponent, a.exponent_stderr, a.points[0], a.period, a.multipliers, a.sense);
        }
    }
}
