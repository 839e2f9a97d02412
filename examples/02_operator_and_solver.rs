//! The operator layer on its own: `cargo run --release --example 02_operator_and_solver -- DIR`.
//!
//! What one learns: a traversal walks the rows of T; [`Transport`] turns it into a linear operator on the CPU; the
//! adjoint test holds it to its law; operators are put together ([`Stacked`], [`Scaled`]) into a regularized
//! least-squares problem; [`drive`] runs a method on it; and the explicit matrix of the same traversal, an operator
//! like any other, says whether all that was right.

#![allow(clippy::print_stdout, reason = "an example says what it does")]

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use unscatter::cpu::Transport;
use unscatter::io::image::write_png;
use unscatter::march::{LightMapTransport, LightMapTraversal, ViewRay};
use unscatter::operator::{
    Blocks, Bounds, CpuVector, Identity, LinearOperator, Scaling, Stacked, Vector, WalkPlan, adjoint_test,
};
use unscatter::scene::{
    Basis, Camera, Extent, FovAxis, Grid, Image, LightFrame, Medium, Quadrature, Strategy, look_at,
};
use unscatter::solve::{Beginning, Control, Fista, LeastSquares, Limits, Method, Mprgp, drive};
use unscatter::sparse::ExplicitMatrix;
use unscatter::visibility::ShadowMap;

/// Texels along each side of the light map.
const SIDE: usize = 48;
/// λ of ½ λ ‖x‖².
const LAMBDA: f64 = 1e-4;

/// The rays of a small picture through air that is lit in stripes.
fn traversal() -> unscatter::Result<LightMapTraversal> {
    let frame = LightFrame::along(DVec3::new(0.3, -1.0, 0.2).normalize());
    let extent = Extent { min: DVec2::splat(-4.0), max: DVec2::splat(4.0) };
    // Depths along the light: stripes stop at depth −5 (shade everything), the others never.
    let shadow_grid = Grid::new(extent, [64, 64])?;
    let depths: Vec<f32> =
        (0..shadow_grid.len()).map(|texel| if texel % 64 % 8 < 4 { f32::INFINITY } else { -5.0 }).collect();
    let medium = Medium::new([0.15; 3], [0.9; 3], 0.0)?;
    let transport = LightMapTransport {
        sigma_t: medium.sigma_t,
        shadow_map: Arc::new(ShadowMap::new(shadow_grid, 0.0, &depths)?),
        light_map: Grid::new(extent, [SIDE, SIDE])?,
        basis: Basis::Bilinear,
        quadrature: Quadrature::Exact,
        transmittance_bound: f64::powi(2.0, -24),
        mask: None,
    };
    let eye = look_at(DVec3::new(0.0, 1.0, 9.0), DVec3::ZERO, DVec3::Y)?;
    let camera = Camera::new(eye, 50.0, FovAxis::X, [96, 64])?;
    let [width, height] = camera.size();
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rays: Vec<ViewRay> =
        pixels.map(|(x, y)| ViewRay::new(&camera.pixel_ray(x, y), 14.0, &frame, &medium)).collect();
    Ok(LightMapTraversal::new(transport, rays.into()))
}

/// A light map with a warm and a cold half: the truth that is looked for.
fn truth() -> CpuVector {
    let texel = |index: usize| if index % SIDE < SIDE / 2 { [1.0, 0.4, 0.1] } else { [0.1, 0.4, 1.0] };
    CpuVector((0..SIDE * SIDE).map(texel).collect())
}

/// ‖a − b‖ / ‖b‖ over all channels.
fn relative_difference(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    let difference = squares(&mut a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a - b));
    (difference / squares(&mut b.iter().flatten().copied())).sqrt()
}

/// Aᵀ A 1: for a matrix without negative weights a diagonal that majorizes Aᵀ A.
fn scaling<O: LinearOperator>(operator: &O) -> unscatter::Result<Scaling<O::Domain>> {
    let (mut ones, mut sums) = (operator.domain(), operator.range());
    ones.fill([1.0; 3]);
    operator.apply(&ones, &mut sums)?;
    operator.apply_adjoint(&sums, &mut ones)?;
    Ok(Scaling::new(ones, true))
}

fn main() -> unscatter::Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out"), PathBuf::from);
    let traversal = traversal()?;

    // T in f32, one weight for all three channels, its non-zeros kept.
    let plan = WalkPlan::new::<1>(&traversal);
    let operator: Transport<_, f32, 1> =
        Transport::new(traversal.clone(), &plan, Strategy::Assembled, u64::MAX)?;
    let (rows, texels) = (operator.range().len(), operator.domain().len());
    println!("T: {rows} rows, {texels} texels, {} non-zeros", operator.storage().kept_nonzeros);
    println!("adjoint error {:.1e}", adjoint_test(&operator, 3, 1)?.error);

    // What the truth looks like, and the same from the explicit matrix in f64.
    let mut picture = operator.range();
    operator.apply(&truth(), &mut picture)?;
    let explicit = ExplicitMatrix::new::<1>(&traversal, 1 << 24)?;
    let (mut x, mut y) = (explicit.domain(), explicit.range());
    x.set_from_host(&truth().to_host()?)?;
    explicit.apply(&x, &mut y)?;
    println!(
        "T x against the explicit matrix: {:.1e}",
        relative_difference(&picture.to_host()?, &y.to_host()?)
    );

    // min ½‖T x − b‖² + ½ λ ‖x‖², x ≥ 0 is the plain problem of T stacked on √λ times the identity, with a bound.
    let start = operator.domain();
    let regularized = Stacked::new(&operator).over(Identity::scaled(&start, [LAMBDA.sqrt(); 3]))?;
    let rhs = Blocks::new(picture, vec![start.zeros_like()]);
    let scaling = scaling(&regularized)?;
    let problem = LeastSquares::new(&regularized, &rhs).bounded(Bounds::NOT_NEGATIVE).measured(&scaling);
    let mut method = Fista::new(&regularized);
    let limits = Limits::new(200, 1e-4);
    let outcome = drive(&mut method, &problem, Beginning::At(&start), &limits, |history, _| {
        if let Some(last) = history.progress.last().filter(|last| last.iteration % 10 == 0) {
            println!("iteration {:3}: projected gradient {:.2e}", last.iteration, last.normal_residual[0]);
        }
        Ok(Control::Continue)
    })?;
    println!("stopped by {} after {}", outcome.stop.reason.name(), outcome.stop.iteration);
    println!("certificate: {:.1e} of the gradient at the start", outcome.true_normal_residual[0]);

    // Another method on the explicit matrix in f64 finds the same light map.
    let zero = explicit.domain();
    let regularized = Stacked::new(&explicit).over(Identity::scaled(&zero, [LAMBDA.sqrt(); 3]))?;
    let rhs = Blocks::new(y, vec![explicit.domain()]);
    let check_scaling = self::scaling(&regularized)?;
    let problem =
        LeastSquares::new(&regularized, &rhs).bounded(Bounds::NOT_NEGATIVE).measured(&check_scaling);
    let mut check = Mprgp::new(&regularized);
    drive(&mut check, &problem, Beginning::At(&zero), &limits, |_, _| Ok(Control::Continue))?;
    let (found, expected) = (method.solution().to_host()?, check.solution().to_host()?);
    println!("light map against the explicit matrix: {:.1e}", relative_difference(&found, &expected));

    std::fs::create_dir_all(&folder).map_err(|source| unscatter::Error::File {
        action: "create the folder",
        path: folder.clone(),
        source,
    })?;
    let light_map = Image::new([SIDE, SIDE], method.solution().0.clone())?;
    write_png(&folder.join("light_map.png"), &light_map, 0.0)
}
