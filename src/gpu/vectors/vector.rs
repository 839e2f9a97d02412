//! Vectors in the memory of a device: three planes, one a channel.

use std::iter;
use std::sync::Arc;

use super::sums::DeviceSum;
use crate::gpu::device::{Allocation, Binding, Fold, Gpu, Pieces};
use crate::gpu::kernels::layout::VectorParams;
use crate::gpu::kernels::{Kernel, LANES, PIECE};
use crate::operator::{Bounds, Indexed, PendingSum, Scalars, Vector};
use crate::{Error, Result};

/// Numbers between two places where a binding may begin.
const ALIGNMENT: usize = 64;
const NUMBER: u64 = size_of::<f32>() as u64;

/// Three channels an element, in f32, on a device.
///
/// Where a plane, or all three, exceed what a kernel may see at once, kernels take it plane by plane or slab by slab.
#[derive(Debug)]
pub struct GpuVector {
    pub(in crate::gpu) gpu: Gpu,
    len: usize,
    /// Numbers from one channel to the next.
    pub(in crate::gpu) stride: usize,
    memory: Allocation,
}

/// Indices on a device.
#[derive(Debug, Clone)]
pub struct Index {
    memory: Arc<Allocation>,
    len: usize,
}

/// A part of a vector that is bound: one channel or all three, some elements of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::gpu) struct Slab {
    pub(in crate::gpu) channel: u32,
    pub(in crate::gpu) channels: u32,
    pub(in crate::gpu) first: usize,
    pub(in crate::gpu) len: usize,
}

impl GpuVector {
    /// `len` elements of zero.
    ///
    /// Where there is no room, the next call that returns a result says so.
    pub fn zeros(gpu: &Gpu, len: usize) -> Self {
        let stride = len.next_multiple_of(ALIGNMENT).max(ALIGNMENT);
        let memory = gpu.allocate(&format!("a vector of {len} elements"), 3 * stride as u64 * NUMBER);
        Self { gpu: gpu.clone(), len, stride, memory }
    }

    /// Whether all three channels can be bound together.
    pub(in crate::gpu) fn fits(&self) -> bool {
        3 * self.stride as u64 * NUMBER <= self.gpu.binding_limit()
    }

    /// The channels that kernels over these vectors take together: first, and how many.
    pub(in crate::gpu) fn channels(vectors: &[&Self]) -> Vec<[u32; 2]> {
        if vectors.iter().all(|vector| vector.fits()) { vec![[0, 3]] } else { vec![[0, 1], [1, 1], [2, 1]] }
    }

    /// The slabs of these channels.
    pub(in crate::gpu) fn slabs(&self, [channel, channels]: [u32; 2]) -> impl Iterator<Item = Slab> + use<> {
        let at_once = if channels == 3 {
            self.stride
        } else {
            ((self.gpu.binding_limit() / NUMBER) as usize / ALIGNMENT * ALIGNMENT).max(ALIGNMENT)
        };
        let len = self.len;
        let slab = move |first| Slab { channel, channels, first, len: at_once.min(len - first) };
        (0..len).step_by(at_once).map(slab)
    }

    /// What to bind for a slab.
    pub(in crate::gpu) fn binding(&self, slab: Slab) -> Binding {
        let first = slab.channel as usize * self.stride + slab.first;
        let numbers = if slab.channels == 3 { 3 * self.stride } else { slab.len };
        self.memory.part(first as u64 * NUMBER, numbers as u64 * NUMBER)
    }

    /// Lets a kernel change every element by its partners in vectors of the same length.
    fn each(&mut self, kernel: Kernel, others: &[&Self], a: Scalars, b: Scalars) {
        let (a, b) = (numbers(a), numbers(b));
        self.each_with(kernel, others, |_, params| iter::once(VectorParams { a, b, ..params }));
    }

    /// The same, part by part of the bounds.
    fn each_within(&mut self, kernel: Kernel, others: &[&Self], bounds: &Bounds) {
        self.each_with(kernel, others, |slab, params| params.within(bounds, slab));
    }

    /// The same for whatever parts of a slab.
    fn each_with<P: Iterator<Item = VectorParams>>(
        &mut self,
        kernel: Kernel,
        others: &[&Self],
        parts: impl Fn(Slab, VectorParams) -> P,
    ) {
        let all: Vec<&Self> = others.iter().copied().chain([&*self]).collect();
        debug_assert!(others.iter().all(|other| other.len == self.len));
        for channels in Self::channels(&all) {
            for slab in self.slabs(channels) {
                let mut bindings = vec![self.binding(slab)];
                bindings.extend(others.iter().map(|other| other.binding(slab)));
                for params in parts(slab, self.params(slab)) {
                    let workgroups = self.workgroups(params.len, slab.channels);
                    self.gpu.dispatch(kernel, &params, &[&bindings], workgroups);
                }
            }
        }
    }

    /// Lanes take every so-many-th element, so fewer workgroups do.
    fn workgroups(&self, len: u32, channels: u32) -> [u32; 3] {
        [len.div_ceil(LANES).min(self.gpu.workgroup_limit()), channels, 1]
    }

    /// Workgroups of a reduction: a piece each.
    fn workgroups_of_pieces(&self, len: u32, channels: u32) -> [u32; 3] {
        let [across, down, _] = self.gpu.grid(len as usize, PIECE);
        [across, down, channels]
    }

    fn params(&self, slab: Slab) -> VectorParams {
        VectorParams {
            len: slab.len as u32,
            stride: self.stride as u32,
            channel: slab.channel,
            ..VectorParams::default()
        }
    }

    /// Lets a kernel look up elements of another vector by index, slab by slab of both.
    fn look_up(&mut self, kernel: Kernel, other: &Self, indices: &[&Index]) {
        debug_assert!(indices.iter().all(|index| index.len == self.len));
        for channels in Self::channels(&[self, other]) {
            for slab in self.slabs(channels) {
                for (again, there) in (0u32..).zip(other.slabs(channels)) {
                    let mut bindings = vec![self.binding(slab), other.binding(there)];
                    bindings.extend(indices.iter().map(|index| index.binding(slab)));
                    let params = VectorParams { again, ..self.params(slab).looking_at(other, there) };
                    let workgroups = self.workgroups(params.len, slab.channels);
                    self.gpu.dispatch(kernel, &params, &[&bindings], workgroups);
                }
            }
        }
    }

    /// Lets a kernel reduce some vectors of the same length; the pieces stand where the answer says.
    fn reduce(kernel: Kernel, vectors: [&Self; 2], bounds: &Bounds, fold: Fold) -> Result<DeviceSum> {
        let [first, second] = vectors;
        debug_assert_eq!(first.len, second.len);
        let gpu = &first.gpu;
        let slabs = Self::channels(&vectors).into_iter().flat_map(|channels| first.slabs(channels));
        let parts: Vec<(Slab, VectorParams)> = slabs
            .flat_map(|slab| first.params(slab).within(bounds, slab).map(move |params| (slab, params)))
            .collect();
        let count = |params: &VectorParams| params.len.div_ceil(PIECE);
        let numbers = parts.iter().map(|(slab, params)| slab.channels * count(params)).sum();
        // Until the sum is asked for, nobody else may fetch what stands in the results.
        let mut waiting = gpu.room_for_pieces(numbers)?;
        let (mut begin, results) = waiting.take(numbers);
        let mut pieces = Vec::with_capacity(parts.len());
        for (slab, params) in parts {
            let (channel, channels, count) = (slab.channel, slab.channels, count(&params));
            let bindings = [results.clone(), first.binding(slab), second.binding(slab)];
            let workgroups = first.workgroups_of_pieces(params.len, channels);
            gpu.dispatch(kernel, &VectorParams { results: begin, ..params }, &[&bindings], workgroups);
            pieces.push(Pieces { begin, channel, channels, count });
            begin += channels * count;
        }
        Ok(DeviceSum { gpu: gpu.clone(), answer: waiting.ask(pieces, fold) })
    }

    /// Records max|self| a channel, by pieces, into `results`: where each channel's begin, and how many they are.
    pub(in crate::gpu) fn record_largest(&self, results: &Allocation) -> ([u32; 4], [u32; 4]) {
        let (mut begins, mut counts, mut begin) = ([0; 4], [0; 4], 0);
        for channels in Self::channels(&[self]) {
            for slab in self.slabs(channels) {
                let count = (slab.len as u32).div_ceil(PIECE);
                let params = VectorParams { results: begin, ..self.params(slab) };
                let bindings = [results.whole(), self.binding(slab)];
                let workgroups = self.workgroups_of_pieces(params.len, slab.channels);
                self.gpu.dispatch(Kernel::LargestBits, &params, &[&bindings], workgroups);
                for c in 0..slab.channels {
                    let channel = (slab.channel + c) as usize;
                    if counts[channel] == 0 {
                        begins[channel] = begin;
                    }
                    counts[channel] += count;
                    begin += count;
                }
            }
        }
        (begins, counts)
    }

    /// The number of pieces that [`Self::record_largest`] writes at most.
    pub(in crate::gpu) fn pieces(&self) -> usize {
        let slabs = self.slabs([0, 1]).count();
        3 * (self.len.div_ceil(PIECE as usize) + slabs)
    }

    /// self[index[k]] ← other[k], and nothing else.
    pub(in crate::gpu) fn overwrite(&self, other: &Self, index: &Index) {
        debug_assert_eq!(other.len, index.len);
        for channels in Self::channels(&[self, other]) {
            for slab in other.slabs(channels) {
                for there in self.slabs(channels) {
                    let bindings = [self.binding(there), other.binding(slab), index.binding(slab)];
                    let params = other.params(slab).looking_at(self, there);
                    let workgroups = self.workgroups(params.len, slab.channels);
                    self.gpu.dispatch(Kernel::Place, &params, &[&bindings], workgroups);
                }
            }
        }
    }

    /// Puts the channels of each element side by side, with a fourth number of zero, for kernels that look elements up anywhere.
    pub(in crate::gpu) fn interleave(&self, together: &Allocation) {
        for slab in self.slabs([0, 3]) {
            let workgroups = self.workgroups(slab.len as u32, 1);
            let bindings = [together.whole(), self.binding(slab)];
            self.gpu.dispatch(Kernel::Interleave, &self.params(slab), &[&bindings], workgroups);
        }
    }

    /// Makes the same sums from two words of fixed point.
    pub(in crate::gpu) fn finish_fixed(&mut self, words: &[Self; 2], scales: &Allocation) {
        let [low, high] = words;
        for channels in Self::channels(&[self]) {
            for slab in self.slabs(channels) {
                let bindings = [self.binding(slab), low.binding(slab), high.binding(slab), scales.whole()];
                let (params, workgroups) =
                    (self.params(slab), self.workgroups(slab.len as u32, slab.channels));
                self.gpu.dispatch(Kernel::FixedFinish, &params, &[&bindings], workgroups);
            }
        }
    }
}

impl VectorParams {
    /// A slab's parameters, once a part of the bounds.
    fn within(self, bounds: &Bounds, slab: Slab) -> impl Iterator<Item = Self> {
        bounds.parts_of(slab.first..slab.first + slab.len).map(move |(part, [lower, upper])| Self {
            first: (part.start - slab.first) as u32,
            len: part.len() as u32,
            a: bound(lower),
            b: bound(upper),
            ..self
        })
    }

    fn looking_at(self, other: &GpuVector, slab: Slab) -> Self {
        Self {
            other_first: slab.first as u32,
            other_len: slab.len as u32,
            other_stride: other.stride as u32,
            ..self
        }
    }
}

impl Index {
    fn binding(&self, slab: Slab) -> Binding {
        self.memory.part(slab.first as u64 * NUMBER, slab.len as u64 * NUMBER)
    }
}

pub(in crate::gpu) fn numbers(scalars: Scalars) -> [f32; 4] {
    let [r, g, b] = scalars.map(|value| value as f32);
    [r, g, b, 0.0]
}

/// Bounds as kernels know them: the largest number stands for none.
pub(in crate::gpu) fn bound(scalars: Scalars) -> [f32; 4] {
    numbers(scalars).map(|value| value.clamp(f32::MIN, f32::MAX))
}

impl Vector for GpuVector {
    type Sum = DeviceSum;

    fn len(&self) -> usize {
        self.len
    }

    fn zeros_like(&self) -> Self {
        Self::zeros(&self.gpu, self.len)
    }

    fn fill(&mut self, value: Scalars) {
        self.each(Kernel::Fill, &[], value, [0.0; 3]);
    }

    fn copy_from(&mut self, other: &Self) {
        self.axpby([1.0; 3], other, [0.0; 3]);
    }

    fn axpby(&mut self, alpha: Scalars, x: &Self, beta: Scalars) {
        self.each(Kernel::Axpby, &[x], alpha, beta);
    }

    fn scale(&mut self, factor: Scalars) {
        self.each(Kernel::Scale, &[], factor, [0.0; 3]);
    }

    fn multiply(&mut self, x: &Self) {
        self.each(Kernel::Multiply, &[x], [0.0; 3], [0.0; 3]);
    }

    fn invert(&mut self) {
        self.each(Kernel::Invert, &[], [0.0; 3], [0.0; 3]);
    }

    fn extrapolate(&mut self, x: &Self, factor: Scalars) {
        self.each(Kernel::Extrapolate, &[x], factor, [0.0; 3]);
    }

    fn step_within(&mut self, factor: Scalars, x: &Self, y: &Self, bounds: &Bounds) {
        let c = numbers(factor);
        self.each_with(Kernel::StepWithin, &[x, y], |slab, params| {
            VectorParams { c, ..params }.within(bounds, slab)
        });
    }

    fn clamp(&mut self, bounds: &Bounds) {
        self.each_within(Kernel::Clamp, &[], bounds);
    }

    fn hold(&mut self, x: &Self, gradient: &Self, bounds: &Bounds) {
        self.each_within(Kernel::Hold, &[x, gradient], bounds);
    }

    fn hold_at_bounds(&mut self, x: &Self, bounds: &Bounds) {
        self.each_within(Kernel::HoldAtBounds, &[x], bounds);
    }

    fn shorten(&mut self, x: &Self, bounds: &Bounds) {
        self.each_within(Kernel::Shorten, &[x], bounds);
    }

    fn largest_step(&self, x: &Self, bounds: &Bounds) -> Result<Scalars> {
        Self::reduce(Kernel::LargestStep, [self, x], bounds, Fold::Least)?.value()
    }

    fn projected_norm_squared_later(&self, x: &Self, bounds: &Bounds) -> Result<DeviceSum> {
        Self::reduce(Kernel::ProjectedNormSquared, [self, x], bounds, Fold::Add)
    }

    fn dot_later(&self, other: &Self) -> Result<DeviceSum> {
        Self::reduce(Kernel::Dot, [self, other], &Bounds::NONE, Fold::Add)
    }

    fn epsilon(&self) -> f64 {
        f64::from(f32::EPSILON)
    }

    fn to_host(&self) -> Result<Vec<[f64; 3]>> {
        let numbers: Vec<f32> = self.gpu.read(&self.memory, 0, 3 * self.stride)?;
        let at = |c: usize, k: usize| f64::from(numbers[c * self.stride + k]);
        Ok((0..self.len).map(|k| [at(0, k), at(1, k), at(2, k)]).collect())
    }

    fn set_from_host(&mut self, values: &[[f64; 3]]) -> Result<()> {
        if values.len() != self.len {
            return Err(Error::Shape { what: "a vector", expected: self.len, got: values.len() });
        }
        for c in 0..3 {
            let plane: Vec<f32> = values.iter().map(|value| value[c] as f32).collect();
            self.gpu.write(&self.memory, (c * self.stride) as u64 * NUMBER, &plane);
        }
        self.gpu.check()
    }
}

impl Indexed for GpuVector {
    type Index = Index;

    fn index(&self, index: &Arc<[u32]>) -> Result<Index> {
        let memory = Arc::new(self.gpu.upload("indices", index)?);
        Ok(Index { memory, len: index.len() })
    }

    fn pick(&mut self, other: &Self, index: &Index) {
        self.look_up(Kernel::Pick, other, &[index]);
    }

    fn place(&mut self, other: &Self, index: &Index) {
        self.fill([0.0; 3]);
        self.overwrite(other, index);
    }

    fn difference(&mut self, x: &Self, heads: &Index, tails: &Index) {
        self.look_up(Kernel::Difference, x, &[heads, tails]);
    }

    fn divergence(&mut self, y: &Self, into: &Index, out_of: &Index) {
        self.look_up(Kernel::Divergence, y, &[into, out_of]);
    }

    fn zeros(&self, len: usize) -> Self {
        Self::zeros(&self.gpu, len)
    }
}
