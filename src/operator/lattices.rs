use super::NOWHERE;

/// Where elements lie side by side: lattices, whose places are counted one lattice after the other, and in each the first axis
/// running fastest.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Lattices(Vec<Vec<usize>>);

impl Lattices {
    /// Lattices of so many places along each axis.
    pub fn new(sizes: impl IntoIterator<Item = Vec<usize>>) -> Self {
        Self(sizes.into_iter().collect())
    }

    /// Each with the number of places before it.
    pub fn each(&self) -> impl Iterator<Item = (usize, &[usize])> {
        self.0.iter().scan(0, |first, size| {
            let before = *first;
            *first += size.iter().product::<usize>();
            Some((before, size.as_slice()))
        })
    }

    /// The number of places.
    pub fn len(&self) -> usize {
        self.0.iter().map(|size| size.iter().product::<usize>()).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Axes of the lattice with the most.
    pub fn axes(&self) -> usize {
        self.0.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// The lattice of a place, by its number, its size, and the place in it; none for [`NOWHERE`].
    pub fn locate(&self, place: u32) -> Option<(usize, &[usize], usize)> {
        if place == NOWHERE {
            return None;
        }
        let mut within = place as usize;
        for (number, size) in self.0.iter().enumerate() {
            let len = size.iter().product();
            if within < len {
                return Some((number, size, within));
            }
            within -= len;
        }
        None
    }
}

impl<const N: usize> From<[usize; N]> for Lattices {
    fn from(size: [usize; N]) -> Self {
        Self(vec![size.to_vec()])
    }
}
