//! Prefiltered visibility on the device: sums along the samples of fans, and what rays read of them, batch by batch of fans.

use std::sync::Mutex;

use super::batch::{ROOM, batches};
use super::sweeps::SMALLER;
use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::{PrefilterFan, PrefilterParams, PrefilterRay, PrefilterSample};
use crate::gpu::kernels::{Kernel, Program, RAYS, Variant};
use crate::gpu::operators::rounds;
use crate::gpu::vectors::{GpuVector, Slab};
use crate::march::{Fan, Fans, Prefilter, PrefilterWeighting, harmonics};
use crate::operator::{Vector, expect_len, lock};

/// From all samples of slices to rays, by M coefficients a ray.
///
/// Error   that of sines in f32, 1e-4 of the brightest pixel, beside what the method itself is off
#[derive(Debug)]
pub(super) struct PrefilteredSums {
    gpu: Gpu,
    samples: usize,
    rows: usize,
    harmonics: usize,
    batches: Vec<Batch>,
    room: Mutex<Allocation>,
}

#[derive(Debug)]
struct Batch {
    fans: Allocation,
    samples: Allocation,
    rays: Allocation,
    /// Fans and rays.
    counts: [u32; 2],
    first_sample: u32,
}

impl PrefilteredSums {
    /// Errors: as those of [`Sweeps::new`](super::sweeps::Sweeps::new).
    pub(super) fn new(gpu: &Gpu, fans: &Fans, coefficients: usize) -> Result<Self> {
        let (rows, harmonics) = (fans.rows(), harmonics(coefficients));
        let samples = fans.fans().iter().map(|fan| fan.slopes.len()).sum::<usize>();
        gpu.expect_visible("a channel of the samples of all slices", 4 * samples.max(rows) as u64, SMALLER)?;
        let longest = || fans.fans().iter().map(|fan| fan.slopes.len()).max().unwrap_or(0);
        rounds::check(gpu, longest, SMALLER)?;
        let most = gpu.binding_limit().min(ROOM) as usize / size_of::<[f32; 3]>();
        let numbers = |fan: &Fan| (fan.slopes.len() + 1) * (2 * harmonics + 1);
        let (ranges, largest) = batches(fans.fans(), most, numbers);
        let bytes = (largest * size_of::<[f32; 3]>()) as u64;
        gpu.expect_visible("the sums of a slice", bytes, SMALLER)?;
        let (mut handed, mut first_sample) = (Vec::new(), 0);
        for range in ranges {
            let of_batch = &fans.fans()[range];
            handed.push(Batch::new(gpu, fans, of_batch, first_sample)?);
            first_sample += of_batch.iter().map(|fan| fan.slopes.len()).sum::<usize>();
        }
        let room = Mutex::new(gpu.try_allocate("the sums of slices", bytes)?);
        Ok(Self { gpu: gpu.clone(), samples, rows, harmonics, batches: handed, room })
    }

    /// y ← what rays show of light at all samples.
    ///
    /// Errors: [`Error::Shape`](crate::Error::Shape) when a vector does not fit, and what has gone wrong on the device.
    pub(super) fn gather(&self, x: &GpuVector, y: &mut GpuVector) -> Result<()> {
        expect_len("the samples", x, self.samples)?;
        expect_len("the rows", y, self.rows)?;
        // Rows that pass no sample show nothing.
        y.fill([0.0; 3]);
        let sums = &*lock(&self.room);
        for [channel, channels] in GpuVector::channels(&[x, y]) {
            let bound =
                |vector: &GpuVector, len: usize| vector.binding(Slab { channel, channels, first: 0, len });
            for (number, batch) in self.batches.iter().enumerate() {
                // A batch takes long enough for a submission of its own.
                if number > 0 {
                    self.gpu.hand_over();
                }
                let [fans, rays] = batch.counts;
                let params = PrefilterParams {
                    fans,
                    rays,
                    first_sample: batch.first_sample,
                    harmonics: self.harmonics as u32,
                    channel,
                    channels,
                    x_stride: x.stride as u32,
                    y_stride: y.stride as u32,
                };
                let summed =
                    [sums.whole(), batch.fans.whole(), batch.samples.whole(), bound(x, self.samples)];
                let shown = [bound(y, self.rows), batch.rays.whole(), sums.whole()];
                let lanes = (fans * channels * (params.harmonics + 1)) as usize;
                let of = |kernel| Program::new(kernel, Variant::Lanes);
                let grid = |lanes| self.gpu.grid(lanes, RAYS);
                self.gpu.dispatch(of(Kernel::PrefilterSums), &params, &[&summed], grid(lanes));
                let lanes = (rays * channels) as usize;
                self.gpu.dispatch(of(Kernel::PrefilterShown), &params, &[&shown], grid(lanes));
            }
        }
        self.gpu.check()
    }
}

impl Batch {
    fn new(gpu: &Gpu, of: &Fans, fans: &[Fan], first_sample: usize) -> Result<Self> {
        let (mut all, mut samples, mut rays) = (Vec::new(), Vec::new(), Vec::new());
        let mut first_edge = 0;
        for fan in fans {
            let of_fan = of.rays_of(fan);
            let filter = Prefilter::new((fan, of_fan), of.sigma_t(), PrefilterWeighting::Transmittance);
            all.push(PrefilterFan {
                rates: filter.rates.map(|rate| rate as f32),
                samples: fan.slopes.len() as u32,
                first_sample: samples.len() as u32,
                first_edge,
                pad0: 0,
                pad1: 0,
            });
            samples.extend(fan.slopes.iter().enumerate().map(|(sample, &slope)| {
                let [begin, end] = [sample, sample + 1].map(|edge| fan.edge(edge) - fan.edge(0));
                let place = filter.place(slope) as f32;
                PrefilterSample { begin: begin as f32, width: (end - begin) as f32, place }
            }));
            rays.extend(of_fan.iter().filter_map(|ray| {
                let (lookup, scattering) = (filter.lookup(ray)?, ray.scattering());
                Some(PrefilterRay {
                    gain: std::array::from_fn(|c| scattering[c] * lookup.whole[c] as f32),
                    row: ray.row,
                    far: lookup.far.map(|far| far as f32),
                    edge: first_edge + lookup.edge as u32,
                    place: lookup.place as f32,
                    pad0: 0,
                    pad1: 0,
                    pad2: 0,
                })
            }));
            first_edge += fan.slopes.len() as u32 + 1;
        }
        let what = "the slices";
        Ok(Self {
            counts: [all.len() as u32, rays.len() as u32],
            first_sample: first_sample as u32,
            fans: gpu.upload(what, &all)?,
            samples: gpu.upload(what, &samples)?,
            rays: gpu.upload(what, &rays)?,
        })
    }
}
