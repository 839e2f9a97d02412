//! The first surface behind every pixel, by rasterizing.

use bytemuck::{Pod, Zeroable};

use super::device::Gpu;
use super::kernels::SURFACES;
use crate::Result;
use crate::operator::NOWHERE;

/// Pixels a side that are drawn at once.
const TILE: usize = 4096;
/// Bytes that rows of a copied picture are multiples of.
const ROW: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// A corner of a triangle, as `Corner` of kernels/surfaces.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Corner {
    clip: [f32; 4],
    triangle: u32,
}

/// The triangle that each pixel of a picture sees first, row by row from the top left; [`NOWHERE`] for the sky.
///
/// `clip` are the corners in homogeneous coordinates: x and y from −1 to 1 across the picture, y upwards, and z from 0 far away
/// to 1 near by, all times w.
///
/// Errors: [`crate::Error::AdapterMemory`], and what has gone wrong on the device.
pub fn surfaces_seen(
    gpu: &Gpu,
    clip: &[[f64; 4]],
    triangles: &[[u32; 3]],
    [width, height]: [usize; 2],
) -> Result<Vec<u32>> {
    let mut seen = vec![NOWHERE; width * height];
    if triangles.is_empty() {
        return Ok(seen);
    }
    let drawing = gpu.compile_drawing("surfaces", SURFACES, pipeline)?;
    for top in (0..height).step_by(TILE) {
        for left in (0..width).step_by(TILE) {
            let size = [TILE.min(width - left), TILE.min(height - top)];
            // The part of the picture, stretched over all of it.
            let part = |low: usize, len: usize, all: usize| {
                let scale = all as f64 / len as f64;
                (scale, scale * (1.0 - (2 * low + len) as f64 / all as f64))
            };
            let ((sx, ox), (sy, oy)) = (part(left, size[0], width), part(top, size[1], height));
            let corner = |triangle: usize, vertex: u32| {
                let [x, y, z, w] = clip[vertex as usize];
                let clip = [sx * x + ox * w, sy * y - oy * w, z, w].map(|value| value as f32);
                Corner { clip, triangle: triangle as u32 + 1 }
            };
            let corners: Vec<Corner> = triangles
                .iter()
                .enumerate()
                .flat_map(|(index, vertices)| vertices.map(|vertex| corner(index, vertex)))
                .collect();
            let numbers = draw(gpu, &drawing, &corners, size)?;
            for (y, row) in numbers.chunks(size[0]).enumerate() {
                let begin = (top + y) * width + left;
                // 0 becomes NOWHERE.
                seen[begin..begin + size[0]]
                    .iter_mut()
                    .zip(row)
                    .for_each(|(seen, number)| *seen = number.wrapping_sub(1));
            }
        }
    }
    Ok(seen)
}

fn pipeline(device: &wgpu::Device, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("surfaces"),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("corner"),
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Corner>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Uint32],
            })],
        },
        // Both sides of a triangle are seen.
        primitive: wgpu::PrimitiveState { cull_mode: None, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("seen"),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::TextureFormat::R32Uint.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn draw(
    gpu: &Gpu,
    pipeline: &wgpu::RenderPipeline,
    corners: &[Corner],
    [width, height]: [usize; 2],
) -> Result<Vec<u32>> {
    let vertices = gpu.upload_corners("the triangles", corners)?;
    let device = gpu.device();
    let size = wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 };
    let picture = |format, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
            view_formats: &[],
        })
    };
    let seen = picture(wgpu::TextureFormat::R32Uint, wgpu::TextureUsages::COPY_SRC);
    let depth = picture(wgpu::TextureFormat::Depth32Float, wgpu::TextureUsages::empty());
    let (seen_view, depth_view) =
        (seen.create_view(&Default::default()), depth.create_view(&Default::default()));
    let row = (4 * size.width).next_multiple_of(ROW);
    let numbers: Vec<u32> =
        gpu.draw_and_read(u64::from(row) * u64::from(size.height), |encoder, staging| {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &seen_view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &depth_view,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_vertex_buffer(0, vertices.slice(..));
            pass.draw(0..corners.len() as u32, 0..1);
            drop(pass);
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
            encoder.copy_texture_to_buffer(
                seen.as_image_copy(),
                wgpu::TexelCopyBufferInfo { buffer: staging, layout },
                size,
            );
        })?;
    Ok(numbers.chunks(row as usize / 4).flat_map(|row| &row[..width]).copied().collect())
}
