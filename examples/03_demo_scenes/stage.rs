//! Building blocks of the scenes: walls with openings, crenellations, boxes of voxels, and the numbers they are made with.

use unscatter::io::scene_file::{
    BoxShape, Channels, CylinderShape, Extent, Field, GridSize, Light, Occluder,
};
use unscatter::io::scene_file::{Camera, FovAxis, MapSize, PlaneShape, ShadowMap, Transform, View};
use unscatter::io::scene_file::{Interpolation, Scale, Volume, Weight};
use unscatter::scene::{LightFrame, RegularizationWeight};

use glam::DVec3;

/// Things that stand in a scene, all of stone of one reflectance at a time.
pub(crate) struct Stage {
    pub(crate) occluders: Vec<Occluder>,
    albedo: Channels,
}

/// A hole in a wall: upright sides up to the springing line, an arch over them.
#[derive(Clone, Copy)]
pub(crate) struct Opening {
    /// Middle, along the wall.
    pub(crate) middle: f64,
    pub(crate) width: f64,
    /// Where it begins; 0 for a gate.
    pub(crate) sill: f64,
    /// Where the arch begins.
    pub(crate) spring: f64,
    pub(crate) arch: Arch,
}

#[derive(Clone, Copy)]
pub(crate) enum Arch {
    /// A half circle.
    Round,
    /// Two arcs whose radius is the width of the opening.
    Pointed,
}

/// A wall along x.
#[derive(Clone, Copy)]
pub(crate) struct Wall {
    pub(crate) x: [f64; 2],
    pub(crate) y: [f64; 2],
    pub(crate) z: [f64; 2],
}

/// Of stone.
const SOLID: Channels = Channels::Grey(0.0);

/// Columns that an arch is made of.
const COLUMNS: usize = 14;

impl Stage {
    pub(crate) fn new(albedo: [f64; 3]) -> Self {
        Self { occluders: Vec::new(), albedo: Channels::Rgb(albedo) }
    }

    /// The reflectance of what comes next.
    pub(crate) fn of(&mut self, albedo: [f64; 3]) -> &mut Self {
        self.albedo = Channels::Rgb(albedo);
        self
    }

    /// Level ground at height `y`.
    pub(crate) fn ground(&mut self, [x, z]: [[f64; 2]; 2], y: f64) {
        let center = [0.5 * (x[0] + x[1]), y, 0.5 * (z[0] + z[1])];
        let sides = [[0.0, 0.0, z[1] - z[0]], [x[1] - x[0], 0.0, 0.0]];
        let plane = PlaneShape { center, sides, albedo: self.albedo, transmittance: SOLID, to_world: None };
        self.occluders.push(Occluder::Plane(plane));
    }

    /// A box, from its least to its greatest x, y and z.
    pub(crate) fn block(&mut self, [x, y, z]: [[f64; 2]; 3]) {
        let center = [x, y, z].map(|side| millimetres(0.5 * (side[0] + side[1])));
        let size = [x, y, z].map(|side| millimetres(side[1] - side[0]));
        let block = BoxShape { center, size, albedo: self.albedo, transmittance: SOLID, to_world: None };
        self.occluders.push(Occluder::Box(block));
    }

    /// A round pillar or tower.
    pub(crate) fn pillar(&mut self, [x, z]: [f64; 2], radius: f64, y: [f64; 2]) {
        let [from, to] = y.map(|y| [x, y, z].map(millimetres));
        let radius = millimetres(radius);
        let pillar =
            CylinderShape { from, to, radius, albedo: self.albedo, transmittance: SOLID, to_world: None };
        self.occluders.push(Occluder::Cylinder(pillar));
    }

    /// A disc that faces along z.
    pub(crate) fn disc(&mut self, [x, y, z]: [f64; 3], radius: f64, thickness: f64) {
        let [from, to] = [z - 0.5 * thickness, z + 0.5 * thickness].map(|z| [x, y, z].map(millimetres));
        self.occluders.push(Occluder::Cylinder(CylinderShape {
            from,
            to,
            radius,
            albedo: self.albedo,
            transmittance: SOLID,
            to_world: None,
        }));
    }

    /// A round bar from −`half` to +`half` around a point.
    pub(crate) fn bar(&mut self, middle: [f64; 3], half: [f64; 3], radius: f64) {
        let end = |side: f64| std::array::from_fn(|axis| millimetres(middle[axis] + side * half[axis]));
        let (from, to) = (end(-1.0), end(1.0));
        self.occluders.push(Occluder::Cylinder(CylinderShape {
            from,
            to,
            radius,
            albedo: self.albedo,
            transmittance: SOLID,
            to_world: None,
        }));
    }

    /// A wall along x; `openings` from the least x to the greatest.
    pub(crate) fn wall(&mut self, wall: Wall, openings: &[Opening]) {
        let mut x = wall.x[0];
        for opening in openings {
            let [left, right] = [-0.5, 0.5].map(|side| opening.middle + side * opening.width);
            self.block([[x, left], wall.y, wall.z]);
            if opening.sill > wall.y[0] {
                self.block([[left, right], [wall.y[0], opening.sill], wall.z]);
            }
            self.arch(wall, opening);
            x = right;
        }
        self.block([[x, wall.x[1]], wall.y, wall.z]);
    }

    /// What is above an opening. Its steps lie inside the curve, so that the arch is never too wide.
    fn arch(&mut self, wall: Wall, opening: &Opening) {
        let half = 0.5 * opening.width;
        let rise = |x: f64| match opening.arch {
            Arch::Round => (half * half - x * x).max(0.0).sqrt(),
            Arch::Pointed => {
                let (across, radius) = (x.abs() + half, opening.width);
                (radius * radius - across * across).max(0.0).sqrt()
            }
        };
        let edge = |column: usize| opening.width * (column as f64 / COLUMNS as f64 - 0.5);
        for column in 0..COLUMNS {
            let (left, right) = (edge(column), edge(column + 1));
            let under = opening.spring + rise(0.5 * (left + right));
            let x = [opening.middle + left, opening.middle + right];
            self.block([x, [under.min(wall.y[1] - 0.01), wall.y[1]], wall.z]);
        }
    }

    /// Merlons on a wall along x, as wide as the gaps between them.
    pub(crate) fn merlons(&mut self, wall: Wall, height: f64, count: usize) {
        let step = (wall.x[1] - wall.x[0]) / (2 * count + 1) as f64;
        for index in 0..=count {
            let left = wall.x[0] + 2.0 * index as f64 * step;
            self.block([[left, left + step], [wall.y[1], wall.y[1] + height], wall.z]);
        }
    }

    /// A round tower with a parapet that stands out and is crenellated.
    pub(crate) fn tower(&mut self, [x, z]: [f64; 2], radius: f64, height: f64) {
        self.pillar([x, z], radius, [0.0, height - 1.6]);
        self.pillar([x, z], radius + 0.35, [height - 1.6, height]);
        // Eight merlons; the directions are exact, so that files do not depend on a machine's sine.
        for [a, b] in [[1.0, 0.0], [0.7, 0.7], [0.0, 1.0], [-0.7, 0.7]] {
            for side in [1.0, -1.0] {
                let [u, v] = [x + side * a * radius, z + side * b * radius];
                let half = 0.16 * radius + 0.15;
                self.block([[u - half, u + half], [height, height + 1.3], [v - half, v + half]]);
            }
        }
    }
}

/// A view of the pictures' common size, without strokes.
pub(crate) fn view(name: &str, origin: [f64; 3], target: [f64; 3], fov: f64) -> View {
    let camera = camera(origin, target, (fov, FovAxis::X), [640, 360]);
    View {
        name: name.to_owned(),
        camera,
        strokes: Vec::new(),
        layers: Vec::new(),
        association: None,
        keep: 0.0,
    }
}

/// A camera that stands at `origin` and looks at `target`.
pub(crate) fn camera(
    origin: [f64; 3],
    target: [f64; 3],
    (fov, axis): (f64, FovAxis),
    size: [u32; 2],
) -> Camera {
    Camera {
        to_world: Some(Transform::looking(origin, target)),
        fov: Some(fov),
        fov_axis: Some(axis),
        lens: None,
        gltf: None,
        size: size.map(|side| side as usize),
    }
}

/// A sun.
pub(crate) fn sun(direction: [f64; 3], radiance: [f64; 3]) -> Light {
    Light { direction: Some(direction), gltf: None, radiance: Some(Channels::Rgb(radiance)) }
}

/// A box of voxels between two corners, of a medium that neither scatters nor emits.
pub(crate) fn volume(size: GridSize, extinction: Field, [low, high]: [[f64; 3]; 2]) -> Volume {
    let place = Transform {
        translate: Some(low),
        scale: Some(Scale::Axes(std::array::from_fn(|axis| millimetres(high[axis] - low[axis])))),
        ..Transform::default()
    };
    Volume {
        extinction,
        albedo: Field::Constant(Channels::Grey(0.0)),
        emission: Field::Constant(Channels::Grey(0.0)),
        to_world: Some(place),
        size: Some(size),
        interpolation: Some(Interpolation::Nearest),
        g: 0.0,
        refraction: None,
    }
}

/// The weight of a regularizer, relative to the columns.
pub(crate) fn weight(relative: f64) -> Weight {
    RegularizationWeight::Relative(relative).into()
}

/// A shadow map of `size`² texels that covers the box between two corners.
pub(crate) fn shadow_map(size: usize, direction: DVec3, corners: [DVec3; 2]) -> ShadowMap {
    ShadowMap { size: MapSize::Square(size), extent: Some(map_extent(direction, corners)) }
}

/// What the box between two corners covers in the plane of the light.
fn map_extent(direction: DVec3, corners: [DVec3; 2]) -> Extent {
    let frame = LightFrame::along(direction.normalize());
    let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in 0..8 {
        let pick = |axis: usize| corners[(corner >> axis) & 1][axis];
        let p = frame.light_from_world(DVec3::new(pick(0), pick(1), pick(2)));
        for axis in 0..2 {
            min[axis] = p[axis].min(min[axis]);
            max[axis] = p[axis].max(max[axis]);
        }
    }
    Extent { min: min.map(millimetres), max: max.map(millimetres) }
}

/// Rounded to a thousandth, so that the last bits of a machine's arithmetic do not reach the files.
pub(crate) fn millimetres(value: f64) -> f64 {
    // Adding zero turns −0 into 0.
    (value * 1000.0).round() / 1000.0 + 0.0
}
