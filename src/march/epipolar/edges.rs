//! Where the samples of a slice lie.

/// How samples are spread over a slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spacing {
    /// All of one width.
    #[default]
    Even,
    /// As columns of a projective map, which a graphics adapter can draw as it is: near ones are narrow, and their width grows with the square of
    /// the distance (Klehm et al. 2014, section 4.2). Where the light's direction or its opposite is in the picture there is no such map, and samples are even.
    Projective,
}

/// A projective map begins at this part of its end, at least: its narrowest columns are as much narrower than even ones as its widest are wider.
const NEAREST: f64 = 1.0 / 16.0;

/// The edges of samples in ξ, in metres.
///
/// With n and f where a projective map begins and ends, column X of W has `ξ = n f / (f − (f − n) X/W)`. What is nearer than n belongs to the first one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edges {
    /// Where the first sample begins.
    pub first: f64,
    /// Where the last one ends.
    pub last: f64,
    count: usize,
    /// The width of even samples.
    step: f64,
    /// Where a projective map begins; none of even samples.
    near: Option<f64>,
}

impl Edges {
    /// So many samples in a part of a slice.
    pub(super) fn new([first, last]: [f64; 2], count: usize, spacing: Spacing) -> Self {
        let near = (spacing == Spacing::Projective).then(|| first.max(NEAREST * last));
        let step = (last - first) / count.max(1) as f64;
        Self { first, last, count, step, near }
    }

    /// Where a sample begins.
    #[inline(always)]
    pub fn edge(&self, sample: usize) -> f64 {
        if sample == 0 { self.first } else { self.at(sample as f64) }
    }

    /// The middle of a sample.
    #[inline(always)]
    pub fn middle(&self, sample: usize) -> f64 {
        self.at(sample as f64 + 0.5)
    }

    /// The width of all samples; none where they differ.
    pub(super) fn step(&self) -> Option<f64> {
        self.near.is_none().then_some(self.step)
    }

    /// How many samples lie before a ξ, and which part of the next one.
    pub(super) fn place(&self, xi: f64) -> f64 {
        match self.near {
            None => (xi - self.first) / self.step,
            Some(near) => {
                let part = self.last * (xi - near) / (xi.max(f64::MIN_POSITIVE) * (self.last - near));
                part * self.count as f64
            }
        }
    }

    #[inline(always)]
    fn at(&self, place: f64) -> f64 {
        match self.near {
            None => self.first + place * self.step,
            Some(near) => near * self.last / (self.last - place / self.count as f64 * (self.last - near)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lead_back_to_edges() {
        for (spacing, range) in [
            (Spacing::Even, [0.0, 7.0]),
            (Spacing::Even, [2.0, 9.0]),
            (Spacing::Projective, [0.0, 7.0]),
            (Spacing::Projective, [2.0, 9.0]),
        ] {
            let edges = Edges::new(range, 20, spacing);
            assert_eq!(edges.edge(0), range[0]);
            assert!((edges.edge(20) - range[1]).abs() < 1e-12);
            for sample in 1..20 {
                assert!(
                    edges.edge(sample) < edges.middle(sample)
                        && edges.middle(sample) < edges.edge(sample + 1)
                );
                assert!((edges.place(edges.edge(sample)) - sample as f64).abs() < 1e-9);
            }
            let widths = [1, 18].map(|sample| edges.edge(sample + 1) - edges.edge(sample));
            assert_eq!(spacing == Spacing::Projective, widths[1] > 1.5 * widths[0], "{widths:?}");
            assert!(edges.place(0.5 * range[0]) <= 0.0);
        }
    }
}
