//! Distances of a map's cells from the nearest change of label.

/// Largest number of cells whose distances are computed: their memory is 12 bytes each.
const MOST_CELLS: usize = 1 << 24;

/// The labels of every `k`-th cell of every `k`-th row of a map, `k` so large that there are at most
/// 2^24: all cells of a map up to 4096 x 4096.
#[derive(Debug)]
pub struct Thinned {
    /// Labels, rows of `columns`.
    pub labels: Vec<i16>,
    /// Number of columns.
    pub columns: usize,
}

impl Thinned {
    /// The labels of a map in rows of `columns` cells.
    #[must_use]
    pub fn new(cells: &[i16], columns: usize) -> Self {
        let rows = cells.len() / columns;
        let mut thin = Self { labels: Vec::new(), columns: Self::picks(columns, rows, 0).len() };
        for row in Self::picks(rows, columns, 0) {
            thin.labels.extend(Self::picks(columns, rows, row * columns).map(|k| cells[k]));
        }
        thin
    }

    /// Indices, from `first` on, of the cells of a side of `count` cells that are kept; the map's other
    /// side has `others`.
    #[must_use]
    pub fn picks(
        count: usize,
        others: usize,
        first: usize,
    ) -> impl ExactSizeIterator<Item = usize> {
        let k = (((count * others) as f64 / MOST_CELLS as f64).sqrt().ceil() as usize).max(1);
        (0..count / k).map(move |i| first + i * k + k / 2)
    }
}

/// Cells of a map, nearest to a change of label first.
#[derive(Debug)]
pub struct Nearness {
    /// Cells sorted by their distance from the next change.
    order: Vec<u32>,
    /// Cumulative number of cells by distance, in cells along the farther axis.
    within: Vec<usize>,
    columns: usize,
}

impl Nearness {
    /// Sorts the cells of a map.
    ///
    /// A cell with another label next to it, or at the edge of the map, has the distance 0.
    #[must_use]
    pub fn new(map: &Thinned) -> Self {
        let Thinned { labels, columns } = map;
        let columns = *columns;
        let rows = labels.len() / columns;
        let changes = |k: usize| {
            let (i, j) = (k % columns, k / columns);
            let edge = i == 0 || j == 0 || i + 1 == columns || j + 1 == rows;
            edge || around(k, columns).iter().any(|other| labels[*other] != labels[k])
        };
        let far = u32::MAX - 1;
        let mut distance: Vec<u32> =
            (0..labels.len()).map(|k| if changes(k) { 0 } else { far }).collect();
        // Along rows from either end each distance is at most one more than that of the cells passed.
        let inner = |k: &usize| !(k.is_multiple_of(columns) || k % columns + 1 == columns);
        let body = columns..labels.len().saturating_sub(columns);
        for k in body.clone().filter(inner) {
            let least = around(k, columns)[..4].iter().map(|o| distance[*o]).min();
            distance[k] = distance[k].min(least.unwrap_or(far) + 1);
        }
        for k in body.filter(inner).rev() {
            let least = around(k, columns)[4..].iter().map(|o| distance[*o]).min();
            distance[k] = distance[k].min(least.unwrap_or(far) + 1);
        }
        let longest = distance.iter().copied().max().unwrap_or(0) as usize;
        let mut within = vec![0; longest + 1];
        for d in &distance {
            within[*d as usize] += 1;
        }
        // Sorting by counting: the cells of a distance come after those that are nearer, in rising order.
        let mut nearer = 0;
        let mut next = within.clone();
        for (first, count) in next.iter_mut().zip(&mut within) {
            *first = nearer;
            nearer += *count;
            *count = nearer;
        }
        let mut order = vec![0; labels.len()];
        for (cell, d) in (0..).zip(&distance) {
            let place = &mut next[*d as usize];
            order[*place] = cell;
            *place += 1;
        }
        Self { order, within, columns }
    }

    /// Number of cells, from the first on, from which a step of `eps` sides of the window can reach
    /// a change.
    #[must_use]
    pub fn reached(&self, eps: f64) -> usize {
        let rows = self.order.len() / self.columns;
        let cells = (eps * self.columns.max(rows) as f64) as usize;
        self.within[cells.min(self.within.len() - 1)]
    }

    /// Number of cells.
    #[must_use]
    pub fn count(&self) -> usize {
        self.order.len()
    }

    /// A point in the cell of rank `rank`, in sides of the window; `part` is that in the cell.
    #[must_use]
    pub fn place(&self, rank: usize, part: [f64; 2]) -> [f64; 2] {
        let cell = self.order[rank] as usize;
        let [columns, rows] = [self.columns, self.order.len() / self.columns].map(|n| n as f64);
        let (i, j) = ((cell % self.columns) as f64, (cell / self.columns) as f64);
        [(i + part[0]) / columns, (j + part[1]) / rows]
    }
}

/// The eight cells around one that is not at the edge, in rising order.
fn around(k: usize, columns: usize) -> [usize; 8] {
    let (below, above) = (k - columns, k + columns);
    [below - 1, below, below + 1, k - 1, k + 1, above - 1, above, above + 1]
}
