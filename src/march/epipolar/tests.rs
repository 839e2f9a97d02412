use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::*;
use crate::march::LightMapTransport;
use crate::scene::{Camera, Extent, FovAxis, Lens, LightFrame, Medium, Projection, Quadrature, look_at};
use crate::visibility::ShadowMap;

/// A view of blocks that hang in light: what is seen, from where, and how large the maps are.
#[derive(Clone)]
struct Setting {
    camera: Camera,
    light: DVec3,
    /// Half the side of both maps, in metres.
    half: f64,
    texels: usize,
    sigma_t: [f64; 3],
    basis: Basis,
}

impl Setting {
    fn new(eye: DVec3, target: DVec3, light: DVec3) -> Self {
        let world_from_camera = look_at(eye, target, DVec3::Y).unwrap();
        Self {
            camera: Camera::new(world_from_camera, 50.0, FovAxis::X, [48, 32]).unwrap(),
            light: light.normalize(),
            half: 12.0,
            texels: 96,
            sigma_t: [0.08; 3],
            basis: Basis::Bilinear,
        }
    }

    fn rows(&self) -> LightMapTraversal {
        let frame = LightFrame::along(self.light);
        let extent = |half: f64| Extent { min: DVec2::splat(-half), max: DVec2::splat(half) };
        let grid = Grid::new(extent(self.half), [self.texels; 2]).unwrap();
        let depth = |k: usize| {
            let (i, j) = (k % self.texels * 16 / self.texels, k / self.texels * 16 / self.texels);
            let noise = (i * 7919 + j * 104_729) * 2_654_435_761 % 1000;
            if noise < 450 { (noise as f32 - 225.0) / 40.0 } else { f32::INFINITY }
        };
        let depths: Vec<f32> = (0..grid.len()).map(depth).collect();
        let shadow_map = Arc::new(ShadowMap::new(grid, 0.0, &depths).unwrap());
        let transport = LightMapTransport {
            sigma_t: self.sigma_t,
            shadow_map,
            light_map: Grid::new(extent(0.8 * self.half), [self.texels, self.texels / 2]).unwrap(),
            basis: self.basis,
            quadrature: Quadrature::Exact,
            transmittance_bound: 2.0_f64.powi(-24),
            mask: None,
        };
        let medium = Medium { sigma_t: self.sigma_t, albedo: [0.9, 0.8, 0.7], g: 0.3 };
        let [width, height] = self.camera.size();
        let ray = |k: usize| {
            let ray = self.camera.pixel_ray(k % width, k / width);
            // A floor, and nothing above the horizon.
            let down = (-6.0 - ray.origin.y) / ray.direction.y;
            ViewRay::new(&ray, if down > 0.0 { down } else { f64::INFINITY }, &frame, &medium)
        };
        LightMapTraversal::new(transport, (0..width * height).map(ray).collect())
    }

    fn angle(&self, row: usize) -> f64 {
        let width = self.camera.size()[0];
        self.camera.pixel_angle(row % width, row / width)
    }

    fn sliced(&self, settings: EpipolarSettings) -> EpipolarTraversal {
        EpipolarTraversal::new(&self.rows(), &|row| self.angle(row), settings).unwrap()
    }
}

/// The eye inside and outside the maps; the light across the view, towards it, away from it, on the screen and beside it.
fn settings() -> Vec<Setting> {
    let (inside, outside) = (DVec3::new(1.0, 0.5, 6.0), DVec3::new(2.0, 3.0, 40.0));
    let mut all = Vec::new();
    for eye in [inside, outside] {
        for light in [DVec3::new(0.3, -1.0, 0.2), DVec3::new(0.1, -0.2, 1.0), DVec3::new(-0.2, -0.3, -1.0)] {
            all.push(Setting::new(eye, DVec3::new(0.3, 0.0, 0.0), light));
        }
    }
    let fisheye = Lens { projection: Projection::Equidistant, ..Lens::new([14.0; 2], [24.0, 16.0]) };
    let camera =
        Camera::with_lens(look_at(inside, DVec3::ZERO, DVec3::Y).unwrap(), fisheye, [48, 32]).unwrap();
    all.push(Setting { camera, ..all[1].clone() });
    all.push(Setting { sigma_t: [0.05, 0.2, 0.9], basis: Basis::Nearest, ..all[0].clone() });
    all
}

fn texels(len: usize) -> Vec<[f64; 3]> {
    (0..len).map(|k| [(k % 13) as f64 / 13.0, (k % 97) as f64 / 97.0, 1.0]).collect()
}

/// The largest difference between E x̂ and the sum over the samples, one by one, relative to the largest sum.
fn error_of_sweep(setting: &Setting, settings: EpipolarSettings) -> f64 {
    let sliced = setting.sliced(settings);
    let (fans, rows) = (sliced.fans(), setting.rows());
    let light = |fan: &Fan, j: usize| [1.0 + (j % 5) as f64, fan.middle(j).sin(), 0.5];
    let shown = fans.gather::<f64>(&|fan, samples| {
        for (&j, sample) in fan.needed().iter().zip(samples) {
            let [r, g, b] = light(fan, usize::from(j));
            *sample = [r, g, b, 0.0];
        }
    });
    let (mut worst, mut largest, mut place) = (0.0_f64, 0.0_f64, 0);
    for fan in fans.fans() {
        for ray in fans.rays_of(fan) {
            let (q, view) = (f64::from(ray.q), &rows.rays()[ray.row as usize]);
            for c in 0..3 {
                let sigma = setting.sigma_t[c];
                let mut sum = 0.0;
                for (j, &slope) in fan.slopes.iter().enumerate() {
                    let (a, mut b) = (fan.edge(j), fan.edge(j + 1));
                    let mut a = a;
                    let end = f64::from(ray.end);
                    if a >= end {
                        break;
                    }
                    let depth = f64::from(slope) * fan.middle(j);
                    let lit = if b > end {
                        // The last one is cut where the ray crosses its depth.
                        b = end;
                        let crossing = depth / f64::from(ray.kappa);
                        if ray.kappa > 0.0 {
                            b = b.min(crossing)
                        } else {
                            a = a.max(crossing)
                        };
                        b > a
                    } else {
                        ray.kappa <= slope
                    };
                    if lit {
                        sum += light(fan, j)[c] * ((-sigma * q * a).exp() - (-sigma * q * b).exp());
                    }
                }
                sum *= view.scattering[c];
                worst = worst.max((shown[place][c] - sum).abs());
                largest = largest.max(sum.abs());
            }
            place += 1;
        }
    }
    assert_eq!(place, shown.len());
    worst / largest
}

#[test]
fn rays_show_the_samples_that_are_lit() {
    let of = EpipolarSettings { samples: 300, ..EpipolarSettings::default() };
    for (number, setting) in settings().iter().enumerate() {
        let error = error_of_sweep(setting, of);
        assert!(error < 1e-6, "setting {number}: {error:.1e}");
        let projective = error_of_sweep(setting, EpipolarSettings { spacing: Spacing::Projective, ..of });
        assert!(projective < 1e-6, "setting {number}: {projective:.1e} in a projective map");
        let coarse = error_of_sweep(setting, EpipolarSettings { tolerance: 1e-3, ..of });
        assert!(coarse > error, "setting {number}: {coarse:.1e} with a coarse expansion");
    }
}

fn dot<X: Real>(a: &[[X; 3]], b: &[[X; 3]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a.wide() * b.wide()).sum()
}

fn norm<X: Real>(a: &[[X; 3]]) -> f64 {
    dot(a, a).sqrt()
}

fn adjoint_error<X: Real>(sliced: &EpipolarTraversal, off: f64) -> f64 {
    let rows = Traversal::<f64, 1>::rows(sliced);
    let value = |k: usize, prime: usize| (k * prime % 1009) as f64 / 1009.0 - 0.4;
    let x: Vec<[X; 3]> =
        (0..sliced.light_map.len()).map(|k| [7, 11, 13].map(|p| X::of(value(k, p)))).collect();
    let y: Vec<[X; 3]> = (0..rows).map(|k| [17, 19, 23].map(|p| X::of(value(k, p)))).collect();
    let shown = sliced.shown(&x);
    let back = Traversal::<f64, 1>::scatter_rows::<X>(sliced, rows, &|row| (row, y[row]), 0).unwrap();
    (dot(&shown, &y) - (1.0 + off) * dot(&x, &back)).abs() / (norm(&shown) * norm(&y))
}

#[test]
fn the_sweep_backwards_is_the_transpose() {
    for (number, setting) in settings().iter().enumerate() {
        let sliced =
            setting.sliced(EpipolarSettings { between: number % 2 == 0, ..EpipolarSettings::default() });
        let [wide, single] = [adjoint_error::<f64>(&sliced, 0.0), adjoint_error::<f32>(&sliced, 0.0)];
        assert!(wide < 1e-13 && single < 1e-6, "setting {number}: {wide:.1e} in f64, {single:.1e} in f32");
        let off = [adjoint_error::<f64>(&sliced, 1e-11), adjoint_error::<f32>(&sliced, 1e-4)];
        assert!(off[0] > 1e-13 && off[1] > 1e-6, "setting {number}: {off:?}");
    }
}

#[test]
fn walks_gathers_and_scatters_are_one_matrix() {
    for (number, setting) in settings().iter().enumerate() {
        let sliced = setting.sliced(EpipolarSettings {
            density: 1.7,
            between: number % 2 == 0,
            spacing: if number % 3 == 0 { Spacing::Projective } else { Spacing::Even },
            ..EpipolarSettings::default()
        });
        let x = texels(sliced.light_map.len());
        let rows = Traversal::<f64, 3>::rows(&sliced);
        let y: Vec<[f64; 3]> = texels(rows);
        let (shown, mut walked) = (sliced.shown(&x), vec![[0.0; 3]; rows]);
        let mut back = vec![[0.0; 3]; x.len()];
        for row in 0..rows {
            let mut seen = std::collections::BTreeSet::new();
            Traversal::<f64, 3>::walk(&sliced, row, &mut |element, weight: [f64; 3]| {
                assert!(seen.insert(element), "row {row} visits {element} twice");
                for c in 0..3 {
                    walked[row][c] += weight[c] * x[element][c];
                    back[element][c] += weight[c] * y[row][c];
                }
            });
        }
        let scattered =
            Traversal::<f64, 3>::scatter_rows::<f64>(&sliced, rows, &|row| (row, y[row]), 0).unwrap();
        let apart = |a: &[[f64; 3]], b: &[[f64; 3]]| {
            let difference: Vec<[f64; 3]> =
                a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
            norm(&difference) / norm(b)
        };
        let errors = [apart(&shown, &walked), apart(&scattered, &back)];
        assert!(errors.iter().all(|&error| error < 1e-12), "setting {number}: {errors:?}");
    }
}

/// How far the ray that is farthest from its slice is, in pixels.
fn farthest(setting: &Setting, settings: EpipolarSettings) -> f64 {
    let (rows, sliced) = (setting.rows(), setting.sliced(settings));
    let mut farthest = 0.0_f64;
    for fan in sliced.fans().fans() {
        for ray in sliced.fans().rays_of(fan) {
            let view = &rows.rays()[ray.row as usize];
            let across = DVec2::new(view.direction.x, view.direction.y).perp_dot(fan.direction).abs();
            farthest = farthest.max(across / setting.angle(ray.row as usize));
        }
    }
    farthest
}

#[test]
fn a_pixel_is_at_most_half_a_pixel_from_its_slice() {
    let mut farthest_of_half = 0.0_f64;
    for (number, setting) in settings().iter().enumerate() {
        let [one, half] = [1.0, 0.5]
            .map(|slices| farthest(setting, EpipolarSettings { slices, ..EpipolarSettings::default() }));
        assert!(one <= 0.501, "setting {number}: {one} pixels");
        assert!(half <= 1.02, "setting {number}: {half} pixels with half as many");
        farthest_of_half = farthest_of_half.max(half);
    }
    assert!(farthest_of_half > 0.8, "{farthest_of_half} pixels with half as many");
}

/// The root mean square of the difference from the exact rows, relative to that of these.
fn error(setting: &Setting, settings: EpipolarSettings) -> f64 {
    let (rows, sliced) = (setting.rows(), setting.sliced(settings));
    let x = texels(sliced.light_map.len());
    let truth: Vec<[f64; 3]> =
        (0..rows.rays().len()).map(|row| Traversal::<f64, 3>::gather(&rows, row, &x)).collect();
    let difference: Vec<[f64; 3]> =
        sliced.shown(&x).iter().zip(&truth).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
    norm(&difference) / norm(&truth)
}

/// Half the error with twice as many slices and samples, and it goes on.
#[test]
fn slices_converge_to_the_exact_rows() {
    for (number, setting) in settings().iter().enumerate() {
        let errors = [1.0, 2.0, 4.0, 8.0].map(|times| {
            let density = 2.0 * times;
            error(
                setting,
                EpipolarSettings {
                    slices: times,
                    density,
                    samples: MOST_SAMPLES,
                    tolerance: 1e-7,
                    ..EpipolarSettings::default()
                },
            )
        });
        assert!(errors[0] < 0.08, "setting {number}: {errors:?}");
        let falls = errors.windows(2).all(|pair| pair[1] < 0.85 * pair[0]);
        assert!(falls && errors[3] < 0.7 * errors[2], "setting {number}: {errors:?}");
    }
}

/// Between two slices a ray is nearer to the exact one than in the nearest slice.
#[test]
fn rays_between_two_slices_are_nearer() {
    let of = EpipolarSettings { density: 8.0, samples: MOST_SAMPLES, ..EpipolarSettings::default() };
    let settings = settings();
    let errors = settings
        .iter()
        .map(|setting| [false, true].map(|between| error(setting, EpipolarSettings { between, ..of })));
    let errors: Vec<[f64; 2]> = errors.collect();
    let sum = |which: usize| errors.iter().map(|errors| errors[which]).sum::<f64>();
    assert!(sum(1) < 0.8 * sum(0), "{errors:?}");
    let fan = settings[0].sliced(EpipolarSettings { between: true, ..of });
    let mut shares = vec![0.0; Traversal::<f64, 1>::rows(&fan)];
    let rows = settings[0].rows();
    for ray in fan.fans().rays() {
        shares[ray.row as usize] +=
            f64::from(ray.scattering()[0]) / rows.rays()[ray.row as usize].scattering[0];
    }
    assert!(shares.iter().all(|share| (share - 1.0).abs() < 1e-6));
}

/// Columns of a projective map are narrow near the eye. There is none where the light comes from within the picture, and samples are even.
#[test]
fn projective_maps_are_made_where_they_can_be() {
    let projective = EpipolarSettings {
        spacing: Spacing::Projective,
        density: 8.0,
        samples: MOST_SAMPLES,
        ..EpipolarSettings::default()
    };
    let mut projected = 0;
    for (number, setting) in settings().iter().enumerate() {
        let sliced = setting.sliced(projective);
        let widest = |fan: &Fan| {
            let last = fan.slopes.len() - 1;
            (fan.edge(last + 1) - fan.edge(last)) / (fan.edge(2) - fan.edge(1))
        };
        let with_samples = sliced.fans().fans().iter().filter(|fan| fan.slopes.len() > 2);
        let is_projected = with_samples.map(widest).all(|widest| widest > 1.0 + 1e-9);
        let light = setting.light;
        let in_picture = [light, -light].into_iter().any(|towards| {
            let at = setting.camera.project(setting.camera.position() + towards);
            at.is_some_and(|at| at.x >= 0.0 && at.y >= 0.0 && at.x <= 48.0 && at.y <= 32.0)
        });
        assert_eq!(is_projected, !in_picture, "setting {number}");
        projected += usize::from(is_projected);
        let errors = [8.0, 32.0]
            .map(|density| error(setting, EpipolarSettings { density, slices: 4.0, ..projective }));
        assert!(errors[1] < 1.01 * errors[0] && errors[1] < 0.05, "setting {number}: {errors:?}");
    }
    assert!((1..settings().len()).contains(&projected), "{projected}");
}

#[test]
fn rays_along_the_light_are_seen() {
    let eye = DVec3::new(0.4, 0.0, 0.3);
    let setting = Setting::new(eye, eye + DVec3::new(0.0, 0.0, -1.0), DVec3::new(0.0, 0.0, 1.0));
    let setting =
        Setting { camera: setting.camera.moved(glam::DAffine3::IDENTITY, [49, 33]).unwrap(), ..setting };
    let fine = EpipolarSettings {
        slices: 4.0,
        density: 4.0,
        samples: MOST_SAMPLES,
        tolerance: 1e-7,
        ..EpipolarSettings::default()
    };
    assert!(error(&setting, fine) < 0.02, "{:.1e}", error(&setting, fine));
    let nothing = EpipolarTraversal::new(&setting.rows().picked(&[]), &|_| 1e-3, fine).unwrap();
    assert!(nothing.shown(&texels(nothing.light_map.len())).is_empty());
}
