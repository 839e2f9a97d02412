use std::sync::Arc;

use super::*;
use crate::scene::{AlphaMask, Glass, Material, Object, Primitive, Tint, Wrap};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn new() -> Self {
        Self(7)
    }

    /// In [−1, 1].
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }

    fn direction(&mut self) -> DVec3 {
        loop {
            let p = self.point();
            if p.length() > 0.1 && p.length() < 1.0 {
                return p.normalize();
            }
        }
    }
}

fn mesh(corners: &[[DVec3; 3]]) -> Mesh {
    Mesh {
        positions: corners.iter().flatten().copied().collect(),
        coordinates: corners.iter().flat_map(|_| [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]).collect(),
        triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        material_of: vec![0; corners.len()],
        materials: vec![Material { name: None, albedo: [0.5; 3], mask: None, glass: None }],
        object_of: vec![0; corners.len()],
        objects: vec![Object::default()],
    }
}

fn soup(random: &mut Random, count: usize, size: f64) -> Mesh {
    let corners: Vec<_> = (0..count)
        .map(|_| {
            let centre = random.point();
            [(); 3].map(|()| centre + random.point() * size)
        })
        .collect();
    mesh(&corners)
}

/// Moeller and Trumbore's test in f64 over all triangles: another formula than the one under test.
fn brute_force(mesh: &Mesh, ray: &Ray, limit: f64) -> Option<f64> {
    let distances = mesh.triangles.iter().filter_map(|&triangle| {
        let [a, b, c] = corners(mesh, triangle);
        let (e1, e2) = (b - a, c - a);
        let p = ray.direction.cross(e2);
        let det = e1.dot(p);
        let s = (ray.origin - a) / det;
        let u = s.dot(p);
        let q = s.cross(e1);
        let v = ray.direction.dot(q);
        let t = e2.dot(q);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < limit).then_some(t)
    });
    distances.min_by(f64::total_cmp)
}

fn assert_same(found: Option<f64>, expected: Option<f64>, tolerance: f64, ray: &Ray) {
    match (found, expected) {
        (Some(a), Some(b)) => assert!((a - b).abs() <= tolerance * b.abs(), "{a} and {b} for {ray:?}"),
        (a, b) => assert_eq!(a, b, "{ray:?}"),
    }
}

#[test]
fn agrees_with_brute_force_for_any_number_and_size_of_triangles() {
    let mut random = Random::new();
    for (count, size) in
        [(1, 0.5), (2, 0.5), (3, 0.5), (4, 0.3), (9, 0.3), (40, 0.2), (900, 0.05), (3000, 0.01)]
    {
        let geometry = Geometry::new(soup(&mut random, count, size)).unwrap();
        let mut hits = 0;
        for i in 0..1500 {
            let mut ray = Ray { origin: random.point() * 2.0, direction: random.direction() };
            match i % 5 {
                0 => ray.direction = DVec3::AXES[i % 3] * if i % 2 == 0 { 1.0 } else { -1.0 },
                1 => ray.direction = (DVec3::new(1e-8 * random.number(), random.number(), -0.0)).normalize(),
                _ => {
                    // Aimed at a triangle, so that small ones are hit as well.
                    let triangle = geometry.mesh().triangles[i % geometry.mesh().triangles.len()];
                    let [a, b, c] = corners(geometry.mesh(), triangle);
                    ray.direction = ((a + b + c) / 3.0 - ray.origin).normalize();
                }
            }
            let limit = if i % 2 == 0 { f64::INFINITY } else { 1.0 + random.number() };
            let expected = brute_force(geometry.mesh(), &ray, limit);
            hits += usize::from(expected.is_some());
            let hit = geometry.first_hit(&ray, limit);
            assert_same(hit.map(|hit| hit.distance), expected, 1e-12 / size, &ray);
            assert_eq!(geometry.blocks(&ray, limit), expected.is_some());
            if let Some(hit) = hit {
                assert!(hit.normal.dot(ray.direction) <= 0.0 && (hit.normal.length() - 1.0).abs() < 1e-12);
            }
        }
        assert!(hits > 200, "the test sees too few hits: {hits}");
    }
}

#[test]
fn the_hierarchy_finds_exactly_what_the_triangle_test_finds() {
    let mut random = Random::new();
    let geometry = Geometry::new(soup(&mut random, 2000, 0.03)).unwrap();
    for _ in 0..2000 {
        // From inside of the box, where the ray is not moved, so that the numbers are the same ones.
        let ray = Ray { origin: random.point() * 0.9, direction: random.direction() };
        let probe = Probe::new(&ray);
        let expected =
            geometry.mesh.triangles.iter().filter_map(|&t| probe.meet(&corners(&geometry.mesh, t)));
        let expected = expected.map(|m| m.distance).filter(|&t| t > 0.0).min_by(f64::total_cmp);
        assert_eq!(geometry.first_hit(&ray, f64::INFINITY).map(|hit| hit.distance), expected);
    }
}

/// The same scene and rays at any scale and place give the same distances, to what f64 coordinates hold.
#[test]
fn scale_and_place_of_a_scene_do_not_matter() {
    let mut random = Random::new();
    let base = soup(&mut random, 500, 0.1);
    let rays: Vec<Ray> =
        (0..500).map(|_| Ray { origin: random.point() * 1.5, direction: random.direction() }).collect();
    let reference = Geometry::new(base.clone()).unwrap();
    let far = DVec3::new(3e6, -7e6, 5e6);
    for (scale, offset, tolerance) in [
        (1e-6, DVec3::ZERO, 1e-9),
        (1e6, DVec3::ZERO, 1e-9),
        (1.0, far, 1e-5),
        (1e3, far * 1e3, 1e-5),
        (1e-3, DVec3::splat(1e3), 1e-5),
    ] {
        let mut moved = base.clone();
        moved.positions.iter_mut().for_each(|p| *p = *p * scale + offset);
        let geometry = Geometry::new(moved).unwrap();
        let mut differing = 0;
        for ray in &rays {
            let there = Ray { origin: ray.origin * scale + offset, direction: ray.direction };
            let found = geometry.first_hit(&there, f64::INFINITY).map(|hit| hit.distance / scale);
            let expected = reference.first_hit(ray, f64::INFINITY).map(|hit| hit.distance);
            let same = match (found, expected) {
                (Some(a), Some(b)) => (a - b).abs() <= tolerance,
                (a, b) => a.is_none() && b.is_none(),
            };
            differing += usize::from(!same);
        }
        // Rounded coordinates may decide a ray at the very border of a triangle otherwise.
        assert!(differing <= 1, "{differing} rays differ at scale {scale}, offset {offset}");
    }
}

#[test]
fn closed_shapes_never_leak_not_even_along_edges_and_through_vertices() {
    let mut random = Random::new();
    for centre in [DVec3::ZERO, DVec3::new(1e5, -2e5, 3e4)] {
        let shapes = [
            Primitive::Sphere { centre, radius: 1.0 },
            Primitive::Box { centre, size: DVec3::new(1.0, 2.0, 3.0) },
            Primitive::Cylinder {
                from: centre - DVec3::new(1.0, 0.5, 0.3),
                to: centre + DVec3::Y,
                radius: 0.7,
            },
        ];
        for shape in shapes {
            let geometry = Geometry::new(shape.mesh([0.5; 3]).unwrap()).unwrap();
            let inside = match shape {
                Primitive::Cylinder { from, to, .. } => from.midpoint(to),
                _ => centre,
            };
            let mesh = geometry.mesh();
            let vertices = mesh.positions.iter().copied();
            let middles = mesh.triangles.iter().map(|t| {
                let [a, b, _] = corners(mesh, *t);
                a.lerp(b, 0.37)
            });
            let anywhere: Vec<DVec3> = (0..2000).map(|_| inside + random.direction()).collect();
            for target in vertices.chain(middles).chain(anywhere) {
                let offset = random.point() * 0.1;
                for origin in [inside, inside + offset] {
                    let out = Ray { origin, direction: (target - origin).normalize() };
                    assert!(geometry.blocks(&out, f64::INFINITY), "{shape:?} leaks along {out:?}");
                    let hit = geometry.first_hit(&out, f64::INFINITY).unwrap();
                    assert!(hit.distance < 4.0);
                    // And from outside, from near and from very far.
                    for away in [5.0, 1e4, 1e7] {
                        let back = Ray { origin: out.at(away), direction: -out.direction };
                        assert!(geometry.blocks(&back, f64::INFINITY), "{shape:?} leaks along {back:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_missing_triangle_is_noticed_by_the_leak_test() {
    let mut mesh = Primitive::Sphere { centre: DVec3::ZERO, radius: 1.0 }.mesh([0.5; 3]).unwrap();
    let removed = mesh.triangles.swap_remove(700);
    mesh.material_of.pop();
    mesh.object_of.pop();
    let [a, b, c] = corners(&mesh, removed);
    let geometry = Geometry::new(mesh).unwrap();
    let ray = Ray { origin: DVec3::ZERO, direction: (a + b + c).normalize() };
    assert!(!geometry.blocks(&ray, f64::INFINITY));
}

fn leaf_card() -> Geometry {
    // Left half of the texture transparent; the card is the unit square at z = 0, seen from both sides.
    let mask = AlphaMask { size: [4, 1], alpha: vec![0, 0, 255, 255], cutoff: 0.5, wrap: [Wrap::Clamp; 2] };
    let mut card = mesh(&[
        [DVec3::ZERO, DVec3::X, DVec3::Y],
        [DVec3::new(1.0, 1.0, 0.0), DVec3::Y, DVec3::X],
        // And something behind it.
        [DVec3::new(-9.0, -9.0, -1.0), DVec3::new(9.0, -9.0, -1.0), DVec3::new(0.0, 9.0, -1.0)],
    ]);
    card.coordinates = card.positions.iter().map(|p| [p.x as f32, p.y as f32]).collect();
    card.materials.push(Material {
        name: None,
        albedo: [0.1, 0.9, 0.1],
        mask: Some(Arc::new(mask)),
        glass: None,
    });
    card.material_of = vec![1, 1, 0];
    Geometry::new(card).unwrap()
}

#[test]
fn rays_pass_through_the_holes_of_a_leaf_card() {
    let geometry = leaf_card();
    for (x, z, expected) in [(0.2, 1.0, 2.0), (0.8, 1.0, 1.0), (0.45, 1.0, 2.0), (0.55, 1.0, 1.0)] {
        let ray = Ray { origin: DVec3::new(x, 0.3, z), direction: DVec3::NEG_Z };
        let hit = geometry.first_hit(&ray, 10.0).unwrap();
        assert!((hit.distance - expected).abs() < 1e-12, "x = {x}");
        assert_eq!(hit.albedo == [0.1, 0.9, 0.1], expected == 1.0);
        assert_eq!(geometry.blocks(&ray, 1.5), expected < 1.5);
    }
    let from_behind = Ray { origin: DVec3::new(0.8, 0.9, -0.5), direction: DVec3::Z };
    assert_eq!(geometry.first_hit(&from_behind, 10.0).unwrap().normal, DVec3::NEG_Z);
}

#[test]
fn open_air_and_impossible_rays_hit_nothing() {
    let air = Geometry::new(Mesh::default()).unwrap();
    assert!(air.bounds().is_none());
    let ray = Ray { origin: DVec3::ZERO, direction: DVec3::X };
    assert!(!air.blocks(&ray, f64::INFINITY));
    let geometry = leaf_card();
    assert_eq!(geometry.bounds().unwrap()[1], DVec3::new(9.0, 9.0, 0.0));
    for bad in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(f64::MAX)] {
        assert!(!geometry.blocks(&Ray { origin: bad, ..ray }, f64::INFINITY));
    }
    assert!(!geometry.blocks(&Ray { direction: DVec3::ZERO, ..ray }, f64::INFINITY));
    let down = Ray { origin: DVec3::new(0.8, 0.3, 1.0), direction: DVec3::NEG_Z };
    for limit in [f64::NAN, -1.0, 0.0, 1.0] {
        assert!(!geometry.blocks(&down, limit) && geometry.first_hit(&down, limit).is_none());
    }
    assert!(geometry.blocks(&down, 1.0 + 1e-12));
}

#[test]
fn triangles_without_area_are_never_hit_and_equal_ones_are_no_burden() {
    let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut many = vec![[a, b, c]; 50_000];
    many.extend([[a, a, c], [a, b, b.lerp(a, 0.5)], [b, b, b]]);
    // The first that has an area, whose index stays what it is in the mesh.
    many.insert(0, [a, a, b]);
    let geometry = Geometry::new(mesh(&many)).unwrap();
    let ray = Ray { origin: DVec3::new(0.2, 0.2, 1.0), direction: DVec3::NEG_Z };
    let hit = geometry.first_hit(&ray, 2.0).unwrap();
    assert_eq!((hit.distance, hit.triangle), (1.0, 1));
    let along = Ray { origin: DVec3::new(0.5, -1.0, 0.0), direction: DVec3::Y };
    for (index, [a, ..]) in many.iter().enumerate().filter(|(index, _)| *index == 0 || *index > 50_000) {
        let towards = Ray { origin: *a + DVec3::Z, direction: DVec3::NEG_Z };
        assert!([ray, along, towards].iter().all(|ray| geometry.hit_on(ray, index).is_none()));
    }
    assert!(Geometry::new(mesh(&many[50_001..])).unwrap().is_open());
}

/// Many spheres, so that the hierarchy reorders their triangles.
#[test]
fn hits_know_the_object_and_the_material_of_their_triangle() {
    let mut mesh = Mesh::default();
    let centre = |index: usize| DVec3::new((index % 7) as f64, (index / 7 % 5) as f64, (index / 35) as f64);
    let albedo = |index: usize| [index as f32 / 105.0; 3];
    for index in (0..105).rev() {
        let sphere = Primitive::Sphere { centre: centre(index), radius: 0.3 };
        let mut part = sphere.mesh(albedo(index)).unwrap();
        part.objects[0].name = Some(index.to_string());
        mesh.append(part, glam::DAffine3::IDENTITY);
    }
    let geometry = Geometry::new(mesh).unwrap();
    let mut random = Random::new();
    for index in 0..105 {
        let direction = random.direction();
        let ray = Ray { origin: centre(index) - 0.45 * direction, direction };
        let hit = geometry.first_hit(&ray, 0.45).unwrap();
        let triangle = hit.triangle;
        let on = geometry.hit_on(&ray, triangle);
        assert_same(on.map(|hit| hit.distance), Some(hit.distance), 1e-12, &ray);
        assert_eq!(geometry.mesh().object(triangle).name, Some(index.to_string()));
        assert_eq!((geometry.mesh().material(triangle).albedo, hit.albedo), (albedo(index), albedo(index)));
    }
}

#[test]
fn broken_meshes_are_refused() {
    let good = || mesh(&[[DVec3::ZERO, DVec3::X, DVec3::Y]]);
    assert!(Geometry::new(good()).is_ok());
    let broken: [fn(&mut Mesh); 11] = [
        |m| m.positions[1].y = f64::NAN,
        |m| m.positions[1].y = 1e300,
        |m| m.triangles[0][2] = 3,
        |m| m.material_of[0] = 1,
        |m| m.material_of.clear(),
        |m| m.object_of[0] = 1,
        |m| m.object_of.clear(),
        |m| m.coordinates.truncate(2),
        |m| m.materials[0].albedo[1] = f32::NAN,
        |m| {
            let wrap = [Wrap::Repeat; 2];
            let mask = AlphaMask { size: [usize::MAX, 3], alpha: vec![0; 3], cutoff: 0.5, wrap };
            m.materials[0].mask = Some(Arc::new(mask));
        },
        |m| {
            let mask = AlphaMask { size: [1, 1], alpha: vec![255], cutoff: 0.5, wrap: [Wrap::Repeat; 2] };
            m.materials[0].mask = Some(Arc::new(mask));
            m.coordinates[2] = [f32::INFINITY, 0.0];
        },
    ];
    for (case, breaks) in broken.iter().enumerate() {
        let mut mesh = good();
        breaks(&mut mesh);
        assert!(Geometry::new(mesh).is_err(), "case {case}");
    }
}

/// A rectangle across z, as two triangles.
fn window(z: f64, half: f64) -> [[DVec3; 3]; 2] {
    let at = |x: f64, y: f64| DVec3::new(half * x, half * y, z);
    [[at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0)], [at(-1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]]
}

fn glass(transmittance: Rgb) -> Material {
    Material { name: None, albedo: [0.5; 3], mask: None, glass: Some(Glass { transmittance, picture: None }) }
}

const RED: Rgb = [0.9, 0.2, 0.1];
const BLUE: Rgb = [0.1, 0.3, 0.8];

/// A red and a blue window, one behind the other, and a wall behind both.
fn windows() -> Geometry {
    let mut windows = mesh(&[window(2.0, 1.0), window(1.0, 1.0), window(-1.0, 1.0)].concat());
    windows.materials.extend([glass(RED), glass(BLUE)]);
    windows.material_of = vec![1, 1, 2, 2, 0, 0];
    Geometry::new(windows).unwrap()
}

#[test]
fn light_through_panes_is_coloured_by_each_and_a_pane_is_no_hit() {
    let geometry = windows();
    // Along the common edge of the two triangles of each window, and beside it.
    for [x, y] in [[0.25, 0.25], [0.3, -0.2]] {
        let ray = Ray { origin: DVec3::new(x, y, 4.0), direction: DVec3::NEG_Z };
        assert_eq!(geometry.first_hit(&ray, 10.0).unwrap().distance, 5.0);
        assert_eq!(geometry.first_surface(&ray, 10.0).unwrap().distance, 2.0);
        let panes = geometry.panes(&ray, 10.0);
        assert_eq!(panes.iter().map(|pane| pane.distance).collect::<Vec<_>>(), [2.0, 3.0]);
        assert_eq!(geometry.transmittance(&ray, 2.5), RED);
        let both = [0, 1, 2].map(|c| RED[c] * BLUE[c]);
        assert_eq!(geometry.transmittance(&ray, 4.0), both);
        assert_eq!(geometry.transmittance(&ray, 6.0), [0.0; 3]);
        assert!(!geometry.blocks(&ray, 4.0) && geometry.blocks(&ray, 6.0));
        assert_eq!(geometry.hit_on(&ray, 0), None, "a pane is passed");
    }
    let beside = Ray { origin: DVec3::new(3.0, 0.0, 4.0), direction: DVec3::NEG_Z };
    assert_eq!(geometry.transmittance(&beside, 10.0), [1.0; 3]);
    assert!(!geometry.is_grey() && geometry.has_panes() && !geometry.is_open());
}

#[test]
fn a_box_of_glass_colours_light_once_and_two_boxes_twice() {
    let pane = |z| {
        let (centre, size) = (DVec3::new(0.0, 0.0, z + 0.05), DVec3::new(2.0, 2.0, 0.1));
        Primitive::Box { centre, size }.mesh([0.5; 3]).unwrap()
    };
    let mut both = Mesh::default();
    for z in [0.0, 1.0] {
        both.append(pane(z), glam::DAffine3::IDENTITY);
    }
    both.materials = vec![glass(RED), glass(RED)];
    let geometry = Geometry::new(both.clone()).unwrap();
    let square = RED.map(|share| share * share);
    for [x, y] in [[0.0, 0.0], [0.31, -0.2], [0.5, 0.5]] {
        let down = Ray { origin: DVec3::new(x, y, 4.0), direction: DVec3::NEG_Z };
        assert_eq!(geometry.transmittance(&down, 10.0), square);
        assert_eq!(geometry.transmittance(&down, 3.5), RED);
        let up = Ray { origin: DVec3::new(x, y, -4.0), direction: DVec3::Z };
        assert_eq!(geometry.transmittance(&up, 10.0), square);
        let inside = Ray { origin: DVec3::new(x, y, 0.05), direction: DVec3::NEG_Z };
        assert_eq!(geometry.transmittance(&inside, 10.0), RED);
    }
    // As one object, too.
    both.object_of.fill(0);
    let geometry = Geometry::new(both).unwrap();
    let down = Ray { origin: DVec3::new(0.31, -0.2, 4.0), direction: DVec3::NEG_Z };
    assert_eq!(geometry.transmittance(&down, 10.0), square);
}

#[test]
fn a_picture_of_glass_has_solid_places_panes_and_holes() {
    let picture = Tint { size: [3, 1], values: vec![[0; 3], [255, 0, 0], [255; 3]], wrap: [Wrap::Clamp; 2] };
    let mut leaded = mesh(&window(0.0, 1.0));
    leaded.coordinates = leaded.positions.iter().map(|p| [(0.5 + 0.5 * p.x) as f32, 0.5]).collect();
    leaded.materials = vec![Material {
        glass: Some(Glass { transmittance: [1.0; 3], picture: Some(Arc::new(picture)) }),
        ..glass(RED)
    }];
    let geometry = Geometry::new(leaded).unwrap();
    for (x, passes) in [(-0.9, [0.0; 3]), (0.0, [1.0, 0.0, 0.0]), (0.95, [1.0; 3])] {
        let ray = Ray { origin: DVec3::new(x, 0.3, 1.0), direction: DVec3::NEG_Z };
        assert_eq!(geometry.transmittance(&ray, 2.0), passes, "at {x}");
        assert_eq!(geometry.first_hit(&ray, 2.0).is_some(), passes == [0.0; 3]);
        assert_eq!(geometry.hit_on(&ray, 0).or(geometry.hit_on(&ray, 1)).is_some(), passes == [0.0; 3]);
    }
}

#[test]
fn a_shadow_map_knows_what_rays_to_the_light_know() {
    let geometry = windows();
    let frame = LightFrame::along(DVec3::new(0.2, -0.1, -1.0).normalize());
    let extent = crate::scene::Extent { min: glam::DVec2::splat(-3.0), max: glam::DVec2::splat(3.0) };
    let grid = crate::scene::Grid::new(extent, [60, 60]).unwrap();
    let map = crate::visibility::ShadowMap::render(&geometry, &frame, grid).unwrap();
    let towards = -frame.world_from_light(DVec3::Z);
    let mut seen = std::collections::BTreeMap::new();
    for texel in 0..grid.len() {
        for depth in [-3.0, -1.5, -0.5, 0.5, 1.5, 2.5] {
            let point = grid.centre(texel % 60, texel / 60).extend(depth);
            let ray = Ray { origin: frame.world_from_light(point), direction: towards };
            let expected = geometry.transmittance(&ray, f64::INFINITY);
            let stored = map.light_at(point);
            assert!((0..3).all(|c| (stored[c] - expected[c]).abs() < 1e-6), "{stored:?}, not {expected:?}");
            *seen.entry(expected.map(f32::to_bits)).or_insert(0) += 1;
        }
    }
    assert_eq!(seen.len(), 5, "light, darkness, red, blue and both: {seen:?}");
}

#[test]
fn more_panes_than_are_told_apart_colour_light_at_the_last() {
    let stack: Vec<_> = (0..20).flat_map(|k| window(f64::from(k), 1.0)).collect();
    let mut many = mesh(&stack);
    many.materials = (0..20).map(|_| glass([0.9; 3])).collect();
    many.material_of = (0..40).map(|triangle| triangle / 2).collect();
    let geometry = Geometry::new(many).unwrap();
    let frame = LightFrame::along(DVec3::NEG_Z);
    let extent = crate::scene::Extent { min: glam::DVec2::splat(-0.9), max: glam::DVec2::splat(0.9) };
    let grid = crate::scene::Grid::new(extent, [2, 2]).unwrap();
    let map = crate::visibility::ShadowMap::render(&geometry, &frame, grid).unwrap();
    assert_eq!(map.behind().unwrap().crowded(), 4);
    let behind = |panes: i32| {
        let z = f64::from(20 - panes) - 0.5;
        map.light_at(frame.light_from_world(DVec3::new(0.3, 0.3, z)))[0]
    };
    assert!((behind(15) - 0.9_f32.powi(15)).abs() < 1e-6);
    for panes in [16, 17, 20] {
        assert!((behind(panes) - 0.9_f32.powi(20)).abs() < 1e-6);
    }
}
