//! The paper's size (Kol 2017, sec. 5.2): 3 views, 41,240 painted pixels, light map and shadow map 512², 32 iterations.
//!
//! `citadel` is the demo scene, built and solved as the command does it. `paper-size` is an open field of pillars whose
//! rays are lit for longer; it also times walking and keeping T, and each product.
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench that cannot go on should stop")]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use unscatter::cpu::{Transport, WalkPlan};
use unscatter::march::{LightMapTransport, LightMapTraversal, ViewRay};
use unscatter::operator::{Blocks, CpuVector, Identity, LinearOperator, Stacked, Vector};
use unscatter::problem::{LightMapProblem, TransportOperator};
use unscatter::scene::{
    Basis, Camera, Extent, FovAxis, Grid, LightFrame, Medium, Quadrature, ShadowMap, Strategy, look_at,
};
use unscatter::solve::{Beginning, Cgls, Control, LeastSquares, Limits, drive};

/// Rows of pillars under a slanted sun, seen from three places; 41,240 rays through a disc of pixels of each view.
fn paper_size(basis: Basis, quadrature: Quadrature) -> LightMapTraversal {
    let frame = LightFrame::along(DVec3::new(0.5, -1.0, 0.3).normalize());
    let extent = Extent { min: DVec2::splat(-20.0), max: DVec2::splat(20.0) };
    let shadow_grid = Grid::new(extent, [512, 512]).unwrap();
    let depths: Vec<f32> = (0..shadow_grid.len())
        .map(|index| {
            let p = shadow_grid.centre(index % 512, index / 512);
            let pillar = (p.x * 1.7).sin() * (p.y * 0.9).cos() > 0.1;
            if pillar { -6.0 } else { f32::INFINITY }
        })
        .collect();
    let medium = Medium::new([0.05; 3], [0.9; 3], 0.3).unwrap();
    let transport = LightMapTransport {
        sigma_t: medium.sigma_t,
        shadow_map: Arc::new(ShadowMap::new(shadow_grid, 0.0, &depths).unwrap()),
        light_map: Grid::new(extent, [512, 512]).unwrap(),
        basis,
        quadrature,
        transmittance_bound: f64::powi(2.0, -24),
        mask: None,
    };
    let mut rays = Vec::with_capacity(41_240);
    for (view, eye) in [[14.0, 2.0, 12.0], [-15.0, 3.0, 8.0], [2.0, 6.0, -17.0]].into_iter().enumerate() {
        let eye = DVec3::from_array(eye);
        let camera =
            Camera::new(look_at(eye, DVec3::ZERO, DVec3::Y).unwrap(), 60.0, FovAxis::X, [640, 360]).unwrap();
        let wanted = (view + 1) * 41_240 / 3;
        'view: for y in 100..360 {
            for x in 220..420 {
                if rays.len() == wanted {
                    break 'view;
                }
                rays.push(ViewRay::new(&camera.pixel_ray(x, y), 32.0, &frame, &medium));
            }
        }
    }
    LightMapTraversal::new(transport, rays.into())
}

fn build(traversal: &LightMapTraversal, strategy: Strategy) -> Transport<LightMapTraversal, f32, 1> {
    let plan = WalkPlan::new::<f32, 1>(traversal);
    Transport::new(traversal.clone(), &plan, strategy, u64::MAX).unwrap()
}

fn solve(operator: &Transport<LightMapTraversal, f32, 1>) -> f32 {
    let pull = Identity::scaled(&operator.domain(), [0.05; 3]);
    let stacked = Stacked::new(operator).over(pull).unwrap();
    let mut targets = operator.range();
    for (index, target) in targets.0.iter_mut().enumerate() {
        *target = std::array::from_fn(|c| ((index / 700 + c) % 3) as f32 * 0.02);
    }
    let rhs = Blocks(vec![targets, operator.domain()]);
    let mut method = Cgls::new(&stacked);
    let limits = Limits::new(32, 0.0);
    let problem = LeastSquares::new(&stacked, &rhs);
    let start = stacked.domain();
    drive(&mut method, &problem, Beginning::At(&start), &limits, |_, _| Ok(Control::Continue)).unwrap();
    use unscatter::solve::Method;
    method.solution().0[0][0]
}

fn benches(criterion: &mut Criterion) {
    for (name, basis) in [("nearest", Basis::Nearest), ("bilinear", Basis::Bilinear)] {
        let mut group = criterion.benchmark_group(format!("paper-size/{name}"));
        group.sample_size(10);
        let traversal = paper_size(basis, Quadrature::Exact);
        let operator = build(&traversal, Strategy::Assembled);
        let walked = build(&traversal, Strategy::MatrixFree);
        group.throughput(Throughput::Elements(operator.storage().kept_nonzeros));
        let (mut x, mut y) = (operator.domain(), operator.range());
        x.fill([1.0, 0.5, 0.25]);
        y.fill([1.0, 0.5, 0.25]);
        group.bench_function("assemble", |b| b.iter(|| black_box(build(&traversal, Strategy::Assembled))));
        group.bench_function("gather", |b| b.iter(|| operator.apply(&x, &mut y).unwrap()));
        group.bench_function("scatter", |b| b.iter(|| operator.apply_adjoint(&y, &mut x).unwrap()));
        group.bench_function("gather, walked", |b| b.iter(|| walked.apply(&x, &mut y).unwrap()));
        group.bench_function("scatter, walked", |b| b.iter(|| walked.apply_adjoint(&y, &mut x).unwrap()));
        let weights = CpuVector(vec![[1.0; 3]; y.len()]);
        group.bench_function("squares", |b| b.iter(|| black_box(operator.squares(&weights).unwrap())));
        group.bench_function("build and solve", |b| {
            b.iter(|| black_box(solve(&build(&traversal, Strategy::Assembled))));
        });
        let marched = paper_size(basis, Quadrature::March { steps: 768 });
        group.bench_function("assemble, march of 768 steps", |b| {
            b.iter(|| black_box(build(&marched, Strategy::Assembled)));
        });
        group.finish();
    }
}

fn citadel(criterion: &mut Criterion) {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("strokes/citadel.json");
    let scene = unscatter::io::scene_file::load(&file, &[]).unwrap();
    let problem = LightMapProblem::new(&scene).unwrap();
    let mut group = criterion.benchmark_group("citadel");
    group.sample_size(10);
    group.bench_function("build and solve", |b| {
        b.iter(|| {
            let operator = problem.operator(&scene, u64::MAX).unwrap();
            let coverage = operator.squares(&problem.weights()).unwrap();
            black_box(
                unscatter::problem::solve(&problem, &operator, &coverage, &scene.solve, None, |_, _| {
                    Ok(Control::Continue)
                })
                .unwrap(),
            )
        });
    });
    group.finish();
}

criterion_group!(all, citadel, benches);
criterion_main!(all);
