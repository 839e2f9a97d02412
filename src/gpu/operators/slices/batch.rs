//! Some fans as kernels read them.

use std::ops::Range;

use crate::Result;
use crate::gpu::device::{Allocation, Gpu};
use crate::gpu::kernels::layout::{SweepItem, SweepRay, SweepSample};
use crate::march::{Fan, Fans};

/// Bytes of trees or sums that one batch has at most.
pub(super) const ROOM: u64 = 256 << 20;

/// Fans that are swept together.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) items: Allocation,
    pub(super) samples: Allocation,
    pub(super) order: Allocation,
    pub(super) rays: Allocation,
    pub(super) coefficients: Allocation,
    /// Terms of all fans, rays and samples.
    pub(super) counts: [u32; 3],
    /// The first sample among those of all fans.
    pub(super) first_sample: u32,
}

/// Fans in order, as many together as have `most` numbers, of which `numbers` counts those of one; one fan at least. Beside them the
/// largest number of any batch.
pub(super) fn batches(
    fans: &[Fan],
    most: usize,
    numbers: impl Fn(&Fan) -> usize,
) -> (Vec<Range<usize>>, usize) {
    let (mut batches, mut sum, mut largest): (Vec<Range<usize>>, _, _) = (Vec::new(), 0, 0);
    for (number, fan) in fans.iter().enumerate() {
        let of_fan = numbers(fan);
        match batches.last_mut().filter(|_| sum + of_fan <= most) {
            Some(range) => range.end += 1,
            None => {
                batches.push(number..number + 1);
                sum = 0;
            }
        }
        sum += of_fan;
        largest = largest.max(sum);
    }
    (batches, largest)
}

impl Batch {
    /// Hands some fans over.
    ///
    /// Errors: [`Error::AdapterMemory`](crate::Error::AdapterMemory).
    pub(super) fn new(gpu: &Gpu, of: &Fans, fans: &[Fan], first_sample: usize) -> Result<Self> {
        let (mut items, mut samples, mut order) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rays, mut coefficients, mut first_node) = (Vec::new(), Vec::<f32>::new(), 0);
        for fan in fans {
            let (rays_of, terms) = (of.rays_of(fan), fan.nodes().len() as u32);
            let item = SweepItem {
                terms,
                samples: fan.needed().len() as u32,
                first_sample: samples.len() as u32,
                lit: fan.order().len() as u32,
                first_lit: order.len() as u32,
                rays: rays_of.len() as u32,
                first_ray: rays.len() as u32,
                first_coefficient: coefficients.len() as u32,
                first_node,
                ..SweepItem::default()
            };
            let first_item = items.len() as u32;
            let of_term = |(term, q): (u32, &f64)| {
                let rates = of.sigma_t().map(|sigma| (sigma * q) as f32);
                SweepItem { term, rates, ..item }
            };
            items.extend((0..).zip(fan.nodes()).map(of_term));
            samples.extend(fan.needed().iter().copied().map(usize::from).map(|sample| {
                let (begin, end) = (fan.edge(sample), fan.edge(sample + 1));
                SweepSample { begin: begin as f32, width: (end - begin) as f32, item: first_item }
            }));
            order.extend(fan.order().iter().map(|&needed| u32::from(needed)));
            for (number, ray) in rays_of.iter().enumerate() {
                rays.push(SweepRay {
                    scattering: ray.scattering(),
                    row: ray.row,
                    whole: ray.whole(),
                    lit: fan.lit(ray) as u32,
                    terms,
                    first_coefficient: coefficients.len() as u32,
                });
                coefficients.extend_from_slice(fan.coefficients(number));
            }
            first_node += terms * (item.samples + 1);
        }
        let what = "the slices";
        Ok(Self {
            counts: [items.len(), rays.len(), samples.len()].map(|count| count as u32),
            first_sample: first_sample as u32,
            items: gpu.upload(what, &items)?,
            samples: gpu.upload(what, &samples)?,
            order: gpu.upload(what, &order)?,
            rays: gpu.upload(what, &rays)?,
            coefficients: gpu.upload(what, &coefficients)?,
        })
    }
}
