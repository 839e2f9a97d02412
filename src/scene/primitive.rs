use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::{Material, Mesh, Object, Rgb};
use crate::{Error, Result};

/// A built-in shape.
#[derive(Debug, Clone, PartialEq)]
pub enum Primitive {
    /// A box along the axes.
    Box {
        /// Its middle, in metres.
        centre: DVec3,
        /// Full side lengths, in metres.
        size: DVec3,
    },
    /// A rectangle or parallelogram.
    Plane {
        /// Its middle, in metres.
        centre: DVec3,
        /// Two sides, of full length in metres; its normal is along their cross product.
        sides: [DVec3; 2],
    },
    /// A sphere.
    Sphere {
        /// Its middle, in metres.
        centre: DVec3,
        /// In metres.
        radius: f64,
    },
    /// A cylinder with closed ends.
    Cylinder {
        /// Middle of one end, in metres.
        from: DVec3,
        /// Middle of the other end.
        to: DVec3,
        /// In metres.
        radius: f64,
    },
}

/// Around a sphere or cylinder. Chords of 64 are inside of the circle by 0.12 % of its radius.
const SECTORS: u32 = 64;
/// From pole to pole of a sphere.
const RINGS: u32 = 32;

impl Primitive {
    /// Its triangles: one object of one diffuse reflectance, counter-clockwise seen from outside.
    ///
    /// Surfaces lie within 0.3 % of the radius. Texture coordinates run from 0 to 1 over a plane, each face
    /// of a box, the circumference and height of a sphere or cylinder, and the square around an end.
    ///
    /// Errors: [`Error::Value`] for positions, sizes or a reflectance that are not finite, and sizes that are not
    /// positive.
    pub fn mesh(&self, albedo: Rgb) -> Result<Mesh> {
        let mut mesh = match *self {
            Self::Box { centre, size } => {
                finite("centre", centre)?;
                if !(size.is_finite() && size.min_element() > 0.0) {
                    return Err(Error::value("size", size, "three positive, finite lengths"));
                }
                cuboid(centre, 0.5 * size)
            }
            Self::Plane { centre, sides } => {
                finite("centre", centre)?;
                let normal = sides[0].normalize().cross(sides[1].normalize());
                if !(normal.is_finite() && normal.length() > 1e-9) {
                    let got = format!("{} and {}", sides[0], sides[1]);
                    return Err(Error::value("sides", got, "two finite sides that are not parallel"));
                }
                let mut mesh = Mesh::default();
                add_rectangle(&mut mesh, centre, sides.map(|side| 0.5 * side));
                mesh
            }
            Self::Sphere { centre, radius } => {
                finite("centre", centre)?;
                positive("radius", radius)?;
                sphere(centre, radius)
            }
            Self::Cylinder { from, to, radius } => {
                finite("from", from)?;
                finite("to", to)?;
                positive("radius", radius)?;
                let axis = (to - from).try_normalize().filter(|axis| axis.is_finite());
                let axis = axis.ok_or_else(|| Error::value("to", to, "another point than `from`"))?;
                cylinder(from, to, axis, radius)
            }
        };
        if !albedo.iter().all(|&c| (0.0..=1.0).contains(&c)) {
            return Err(Error::value("albedo", format!("{albedo:?}"), "between 0 and 1"));
        }
        if let Some(p) = mesh.positions.iter().find(|p| !p.is_finite()) {
            return Err(Error::value("size", p, "small enough for finite corners"));
        }
        mesh.material_of = vec![0; mesh.triangles.len()];
        mesh.materials = vec![Material { name: None, albedo, mask: None, glass: None }];
        mesh.object_of = vec![0; mesh.triangles.len()];
        mesh.objects = vec![Object::default()];
        Ok(mesh)
    }
}

fn finite(name: &str, point: DVec3) -> Result<()> {
    if point.is_finite() { Ok(()) } else { Err(Error::value(name, point, "a point with finite coordinates")) }
}

fn positive(name: &str, length: f64) -> Result<()> {
    if length.is_finite() && length > 0.0 {
        return Ok(());
    }
    Err(Error::value(name, length, "positive and finite"))
}

/// Around `centre`, from −a−b to a+b, facing along a × b.
fn add_rectangle(mesh: &mut Mesh, centre: DVec3, [a, b]: [DVec3; 2]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([centre - a - b, centre + a - b, centre + a + b, centre - a + b]);
    mesh.coordinates.extend([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

fn cuboid(centre: DVec3, half: DVec3) -> Mesh {
    let corner = |signs: [f64; 3]| centre + half * DVec3::from_array(signs);
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for side in [1.0, -1.0] {
            // Corners are computed by one formula for all faces, so that neighbours share them to the last bit.
            let at = |u: f64, v: f64| {
                let mut signs = [side; 3];
                signs[(axis + 1) % 3] = u * side;
                signs[(axis + 2) % 3] = v;
                corner(signs)
            };
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]);
            mesh.coordinates.extend([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    mesh
}

/// Cosine and sine of the sector's angle; the last is the first to the last bit, so that a seam is closed.
fn sector(index: u32) -> (f64, f64) {
    let (sine, cosine) = (TAU * f64::from(index % SECTORS) / f64::from(SECTORS)).sin_cos();
    (cosine, sine)
}

/// Two triangles between this vertex of a grid with rows of SECTORS + 1 vertices and the next row.
fn grid_cell(first: u32) -> [[u32; 3]; 2] {
    let below = first + SECTORS + 1;
    [[first, below, below + 1], [first, below + 1, first + 1]]
}

fn sphere(centre: DVec3, radius: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for ring in 0..=RINGS {
        let v = f64::from(ring) / f64::from(RINGS);
        // Exactly one point at each pole, whatever the sector.
        let (sine, cosine) = match ring {
            0 => (0.0, 1.0),
            RINGS => (0.0, -1.0),
            _ => (PI * v).sin_cos(),
        };
        for index in 0..=SECTORS {
            let (x, z) = sector(index);
            mesh.positions.push(centre + radius * DVec3::new(sine * x, cosine, -sine * z));
            mesh.coordinates.push([index as f32 / SECTORS as f32, v as f32]);
        }
    }
    for ring in 0..RINGS {
        for index in 0..SECTORS {
            let [lower, upper] = grid_cell(ring * (SECTORS + 1) + index);
            // At a pole one of the two has no area.
            mesh.triangles.extend((ring + 1 < RINGS).then_some(lower));
            mesh.triangles.extend((ring > 0).then_some(upper));
        }
    }
    mesh
}

fn cylinder(from: DVec3, to: DVec3, axis: DVec3, radius: f64) -> Mesh {
    let (x, z) = axis.any_orthonormal_pair();
    let frame = DMat3::from_cols(x, axis, if x.cross(axis).dot(z) < 0.0 { -z } else { z });
    let rim = |end: DVec3, index: u32| {
        let (cosine, sine) = sector(index);
        end + frame * (radius * DVec3::new(cosine, 0.0, -sine))
    };
    let mut mesh = Mesh::default();
    for (end, v) in [(to, 0.0), (from, 1.0)] {
        for index in 0..=SECTORS {
            mesh.positions.push(rim(end, index));
            mesh.coordinates.push([index as f32 / SECTORS as f32, v]);
        }
    }
    mesh.triangles.extend((0..SECTORS).flat_map(grid_cell));
    for (end, outward) in [(to, true), (from, false)] {
        let middle = mesh.positions.len() as u32;
        mesh.positions.push(end);
        mesh.coordinates.push([0.5; 2]);
        for index in 0..SECTORS {
            let (cosine, sine) = sector(index);
            mesh.positions.push(rim(end, index));
            mesh.coordinates.push([(0.5 + 0.5 * cosine) as f32, (0.5 - 0.5 * sine) as f32]);
            let [this, next] = [index, (index + 1) % SECTORS].map(|i| middle + 1 + i);
            mesh.triangles.push(if outward { [middle, this, next] } else { [middle, next, this] });
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: right and positive only when every normal points outwards.
    fn volume(mesh: &Mesh) -> f64 {
        let triangles = mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize]));
        triangles.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    /// Every edge between two positions has as many triangles on one side as on the other.
    fn is_closed(mesh: &Mesh) -> bool {
        let mut edges = std::collections::HashMap::new();
        for t in &mesh.triangles {
            let p = t.map(|i| mesh.positions[i as usize].to_array().map(f64::to_bits));
            for (a, b) in [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])] {
                *edges.entry((a, b)).or_insert(0) += 1;
                *edges.entry((b, a)).or_insert(0) -= 1;
            }
        }
        edges.values().all(|&balance| balance == 0)
    }

    fn shapes() -> Vec<(Primitive, f64)> {
        let centre = DVec3::new(1.0, -2.0, 3.5);
        let axis = DVec3::new(0.3, -1.0, 0.7);
        vec![
            (Primitive::Box { centre, size: DVec3::new(1.0, 2.0, 3.0) }, 6.0),
            (Primitive::Sphere { centre, radius: 2.0 }, 4.0 / 3.0 * PI * 8.0),
            (Primitive::Cylinder { from: centre, to: centre + axis, radius: 0.5 }, PI * 0.25 * axis.length()),
            (Primitive::Cylinder { from: centre, to: centre - DVec3::Y, radius: 0.5 }, PI * 0.25),
        ]
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        for (shape, expected) in shapes() {
            let mut mesh = shape.mesh([0.5; 3]).unwrap();
            assert!(mesh.validate().is_ok());
            assert!((volume(&mesh) / expected - 1.0).abs() < 0.01, "{shape:?}: {}", volume(&mesh));
            assert!(is_closed(&mesh), "{shape:?}");
            mesh.triangles.pop();
            assert!(!is_closed(&mesh));
        }
    }

    #[test]
    fn a_sphere_is_within_half_a_percent_of_its_radius() {
        let mesh = Primitive::Sphere { centre: DVec3::ZERO, radius: 3.0 }.mesh([0.5; 3]).unwrap();
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            assert!(a.length() < 3.0 + 1e-12);
            let nearest = (b - a).cross(c - a).normalize().dot(a);
            assert!(nearest > 3.0 * 0.995, "{nearest}");
        }
    }

    #[test]
    fn a_plane_faces_along_the_cross_product_of_its_sides() {
        let sides = [DVec3::new(0.0, 0.0, 4.0), DVec3::new(6.0, 0.0, 0.0)];
        let mesh = Primitive::Plane { centre: DVec3::Y, sides }.mesh([0.5; 3]).unwrap();
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            assert_eq!((b - a).cross(c - a).normalize(), DVec3::Y);
        }
        assert_eq!(mesh.positions[2], DVec3::new(3.0, 1.0, 2.0));
    }

    #[test]
    fn impossible_sizes_are_refused() {
        let centre = DVec3::ZERO;
        let bad = [
            Primitive::Box { centre, size: DVec3::new(1.0, 0.0, 1.0) },
            Primitive::Box { centre, size: DVec3::splat(f64::NAN) },
            Primitive::Box { centre: DVec3::splat(f64::MAX), size: DVec3::splat(f64::MAX) },
            Primitive::Sphere { centre, radius: -1.0 },
            Primitive::Sphere { centre: DVec3::NAN, radius: 1.0 },
            Primitive::Plane { centre, sides: [DVec3::X, DVec3::X * 2.0] },
            Primitive::Plane { centre, sides: [DVec3::X, DVec3::ZERO] },
            Primitive::Cylinder { from: centre, to: centre, radius: 1.0 },
            Primitive::Cylinder { from: centre, to: DVec3::X, radius: f64::INFINITY },
        ];
        for shape in bad {
            assert!(shape.mesh([0.5; 3]).is_err(), "{shape:?}");
        }
        assert!(Primitive::Sphere { centre, radius: 1.0 }.mesh([1.5, 0.0, 0.0]).is_err());
    }
}
