//! Groups of windows of long runs, and the transitions of runs between them.
//!
//! Windows with equal turns whose regions meet form a group. Groups between which runs move,
//! without leaving them, are a class, which identifies a set. A group that a run leaves for good,
//! for another group or for a trap, is a transient.

use super::long_runs::{Senses, Window};
use super::region::Region;

/// Windows with equal turns in regions that meet, and the transitions between them.
pub(super) struct Groups {
    /// The group of every window of every run.
    of: Vec<Vec<usize>>,
    /// The groups that the next windows belong to; `None` is a trap.
    next: Vec<Vec<Option<usize>>>,
}

impl Groups {
    pub(super) fn new(runs: &[Vec<Window>], captured: &[bool]) -> Self {
        // Groups that a window joins become one: `parent` leads to it.
        let mut found: Vec<(Senses, Region)> = Vec::new();
        let mut parent: Vec<usize> = Vec::new();
        let mut of: Vec<Vec<usize>> = Vec::with_capacity(runs.len());
        for windows in runs {
            let mut own = Vec::with_capacity(windows.len());
            for window in windows {
                let (senses, mut region) = (window.senses, window.region.clone());
                let place = found.len();
                for k in 0..place {
                    if parent[k] == k && found[k].0 == senses && found[k].1.meets(&window.region) {
                        region.unite(&found[k].1);
                        parent[k] = place;
                    }
                }
                found.push((senses, region));
                parent.push(place);
                own.push(place);
            }
            of.push(own);
        }
        let root = |mut k: usize| {
            while parent[k] != k {
                k = parent[k];
            }
            k
        };
        for group in of.iter_mut().flatten() {
            *group = root(*group);
        }
        let mut next = vec![Vec::new(); found.len()];
        for (own, captured) in of.iter().zip(captured) {
            for pair in own.windows(2) {
                next[pair[0]].push(Some(pair[1]));
            }
            if let (Some(last), true) = (own.last(), captured) {
                next[*last].push(None);
            }
        }
        Self { of, next }
    }

    /// The runs that end in a group without a following window.
    pub(super) fn without_next(&self) -> Vec<usize> {
        let unknown =
            |run: &usize| self.of[*run].last().is_some_and(|group| self.next[*group].is_empty());
        (0..self.of.len()).filter(unknown).collect()
    }

    /// The groups between which trajectories move without leaving them.
    pub(super) fn classes(&self) -> Vec<Vec<usize>> {
        let mut classes: Vec<Vec<usize>> = Vec::new();
        let mut used: Vec<usize> = self.of.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        for group in used {
            let Some(reached) = self.reached(group) else { continue };
            let back = |k: &usize| self.reached(*k).is_some_and(|others| others.contains(&group));
            if !reached.is_empty() && reached.iter().all(back) && !classes.contains(&reached) {
                classes.push(reached);
            }
        }
        classes
    }

    /// The groups reachable from this one, sorted; `None` if a trap is among them.
    fn reached(&self, group: usize) -> Option<Vec<usize>> {
        let mut reached: Vec<usize> = Vec::new();
        let mut from = vec![group];
        while let Some(group) = from.pop() {
            for next in &self.next[group] {
                let next = (*next)?;
                if !reached.contains(&next) {
                    reached.push(next);
                    from.push(next);
                }
            }
        }
        reached.sort_unstable();
        Some(reached)
    }

    pub(super) fn windows<'a>(&self, runs: &'a [Vec<Window>], class: &[usize]) -> Vec<&'a Window> {
        let all = runs.iter().flatten().zip(self.of.iter().flatten());
        all.filter(|(_, group)| class.contains(group)).map(|(window, _)| window).collect()
    }

    pub(super) fn members(&self, class: &[usize]) -> usize {
        let ends = |own: &&Vec<usize>| own.last().is_some_and(|group| class.contains(group));
        self.of.iter().filter(ends).count()
    }
}
