//! Differences between neighbours on a lattice of which only some elements are unknown.
//!
//! Source  first differences as in Klehm 2015, sec. 7.4.2; boundary rows are left out, so that a constant has no
//!         gradient and no Laplacian wherever the unknown elements end.

use std::sync::{Arc, Mutex};

use super::{Indexed, Lattices, LinearOperator, NOWHERE};
use crate::{Error, Result};

/// Which unknown elements of a lattice lie side by side: an edge for every such pair.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighbours {
    elements: usize,
    /// The unknown at the beginning of each edge, and the one at its end, one further along an axis.
    tails: Arc<[u32]>,
    heads: Arc<[u32]>,
    /// For every list of edges and every unknown the edge that ends there, and the one that begins there, or [`NOWHERE`].
    into: Vec<Arc<[u32]>>,
    out_of: Vec<Arc<[u32]>>,
}

impl Neighbours {
    /// `columns` are the places of the unknown elements in lattices, in any order and none twice; different lattices are no neighbours of
    /// each other. What is [`NOWHERE`] has no neighbours.
    ///
    /// Errors: [`Error::Value`] for a place behind the last one, or one that comes twice.
    pub fn new(lattices: impl Into<Lattices>, columns: &[u32]) -> Result<Self> {
        let lattices = lattices.into();
        let mut unknown = vec![NOWHERE; lattices.len()];
        for (&column, index) in columns.iter().zip(0u32..).filter(|(column, _)| **column != NOWHERE) {
            let place = unknown.get_mut(column as usize);
            let place = place.ok_or_else(|| Error::value("columns", column, "places of the lattices"))?;
            if std::mem::replace(place, index) != NOWHERE {
                return Err(Error::value("columns", column, "different elements"));
            }
        }
        let pairs = (0..lattices.axes()).map(|axis| {
            let mut pairs = Vec::new();
            for (&column, tail) in columns.iter().zip(0u32..) {
                let Some((_, size, within)) = lattices.locate(column) else { continue };
                let Some(&side) = size.get(axis) else { continue };
                let stride: usize = size[..axis].iter().product();
                if (within / stride) % side + 1 == side || unknown[column as usize + stride] == NOWHERE {
                    continue;
                }
                pairs.push([tail, unknown[column as usize + stride]]);
            }
            pairs
        });
        Ok(Self::of_pairs(columns.len(), &pairs.collect::<Vec<_>>()))
    }

    /// So many unknown elements, of which these pairs lie side by side along each axis. An element may be in several pairs, but in few at
    /// either end.
    pub fn of_pairs(elements: usize, axes: &[Vec<[u32; 2]>]) -> Self {
        let (mut tails, mut heads) = (Vec::new(), Vec::new());
        let mut into: Vec<Arc<[u32]>> = Vec::new();
        let mut out_of: Vec<Arc<[u32]>> = Vec::new();
        for pairs in axes {
            // Lists in which every element has room for one edge at either end; as many as the pairs need.
            let mut lists: Vec<[Vec<u32>; 2]> = Vec::new();
            for &[tail, head] in pairs {
                let edge = tails.len() as u32;
                tails.push(tail);
                heads.push(head);
                let is_free = |[ends, begins]: &[Vec<u32>; 2]| {
                    ends[head as usize] == NOWHERE && begins[tail as usize] == NOWHERE
                };
                let list = lists.iter().position(is_free).unwrap_or_else(|| {
                    lists.push([vec![NOWHERE; elements], vec![NOWHERE; elements]]);
                    lists.len() - 1
                });
                let [ends, begins] = &mut lists[list];
                (begins[tail as usize], ends[head as usize]) = (edge, edge);
            }
            for [ends, begins] in lists {
                into.push(ends.into());
                out_of.push(begins.into());
            }
        }
        Self { elements, tails: tails.into(), heads: heads.into(), into, out_of }
    }

    /// The number of pairs.
    pub fn edges(&self) -> usize {
        self.tails.len()
    }

    /// How many neighbours each unknown has.
    pub fn degrees(&self) -> Vec<u32> {
        let mut degrees = vec![0; self.elements];
        self.tails.iter().chain(&*self.heads).for_each(|&element| degrees[element as usize] += 1);
        degrees
    }

    /// |L|ᵀ |L| 1 of the Laplacian: a diagonal that majorizes Lᵀ L.
    pub fn laplacian_majorizer(&self) -> Vec<f64> {
        let degrees: Vec<f64> = self.degrees().into_iter().map(f64::from).collect();
        let mut sums: Vec<f64> = degrees.iter().map(|degree| 2.0 * degree * degree).collect();
        for (&tail, &head) in self.tails.iter().zip(&*self.heads) {
            sums[tail as usize] += 2.0 * degrees[head as usize];
            sums[head as usize] += 2.0 * degrees[tail as usize];
        }
        sums
    }

    /// |G|ᵀ |G| 1 of the gradient: a diagonal that majorizes Gᵀ G.
    pub fn gradient_majorizer(&self) -> Vec<f64> {
        self.degrees().into_iter().map(|degree| 2.0 * f64::from(degree)).collect()
    }
}

/// x_head − x_tail for every pair of neighbours.
#[derive(Debug)]
pub struct Gradient<V: Indexed> {
    neighbours: Arc<Neighbours>,
    prototype: V,
    tails: V::Index,
    heads: V::Index,
    /// Of each list the edges that end at an element, and those that begin there.
    axes: Vec<[V::Index; 2]>,
}

impl<V: Indexed> Gradient<V> {
    /// On vectors that live where `prototype` does.
    ///
    /// Errors: where there is no room for the indices.
    pub fn new(neighbours: Arc<Neighbours>, prototype: &V) -> Result<Self> {
        let axes = neighbours.into.iter().zip(&neighbours.out_of);
        Ok(Self {
            tails: prototype.index(&neighbours.tails)?,
            heads: prototype.index(&neighbours.heads)?,
            axes: axes
                .map(|(into, out_of)| Ok([prototype.index(into)?, prototype.index(out_of)?]))
                .collect::<Result<_>>()?,
            prototype: prototype.zeros(0),
            neighbours,
        })
    }
}

impl<V: Indexed> LinearOperator for Gradient<V> {
    type Domain = V;
    type Range = V;

    fn domain(&self) -> V {
        self.prototype.zeros(self.neighbours.elements)
    }

    fn range(&self) -> V {
        self.prototype.zeros(self.neighbours.edges())
    }

    fn apply(&self, x: &V, y: &mut V) -> Result<()> {
        super::expect_len("x", x, self.neighbours.elements)?;
        super::expect_len("y", y, self.neighbours.edges())?;
        y.difference(x, &self.heads, &self.tails);
        Ok(())
    }

    fn apply_adjoint(&self, y: &V, x: &mut V) -> Result<()> {
        super::expect_len("x", x, self.neighbours.elements)?;
        super::expect_len("y", y, self.neighbours.edges())?;
        x.fill([0.0; 3]);
        self.axes.iter().for_each(|[into, out_of]| x.divergence(y, into, out_of));
        Ok(())
    }
}

/// For every element the sum of its differences to its neighbours: Gᵀ G, the Laplacian with its sign turned.
#[derive(Debug)]
pub struct Laplacian<V: Indexed> {
    gradient: Gradient<V>,
    differences: Mutex<V>,
}

impl<V: Indexed> Laplacian<V> {
    /// On vectors that live where `prototype` does.
    ///
    /// Errors: where there is no room for the indices.
    pub fn new(neighbours: Arc<Neighbours>, prototype: &V) -> Result<Self> {
        let gradient = Gradient::new(neighbours, prototype)?;
        let differences = Mutex::new(gradient.range());
        Ok(Self { gradient, differences })
    }
}

impl<V: Indexed> LinearOperator for Laplacian<V> {
    type Domain = V;
    type Range = V;

    fn domain(&self) -> V {
        self.gradient.domain()
    }

    fn range(&self) -> V {
        self.gradient.domain()
    }

    fn apply(&self, x: &V, y: &mut V) -> Result<()> {
        let mut differences = super::lock(&self.differences);
        self.gradient.apply(x, &mut differences)?;
        self.gradient.apply_adjoint(&differences, y)
    }

    fn apply_adjoint(&self, y: &V, x: &mut V) -> Result<()> {
        self.apply(y, x)
    }
}
