//! What casts shadows.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scene::{Glass, Mesh, Primitive};
use crate::visibility::Geometry;

use super::assets::Assets;
use super::channels::Channels;
use super::file_name::FileName;
use super::flaw::{At, Built, Flaw};
use super::gltf_node::GltfNode;
use super::transform::{FARTHEST, Transform};

/// Something that casts shadows and that the views see: a built-in shape or the triangles of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Occluder {
    /// A box along the axes.
    Box(BoxShape),
    /// A rectangle or parallelogram.
    Plane(PlaneShape),
    /// A sphere.
    Sphere(SphereShape),
    /// A cylinder with closed ends.
    Cylinder(CylinderShape),
    /// A node of a glTF file with everything below it, or the whole file.
    Gltf(GltfMesh),
    /// A Wavefront OBJ file.
    Obj(ObjMesh),
}

/// A box along the axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxShape {
    /// Its middle, in metres.
    pub center: [f64; 3],
    /// Full side lengths, in metres.
    pub size: [f64; 3],
    /// Diffuse reflectance from 0 to 1: one number or [r, g, b].
    #[serde(default = "default_albedo", skip_serializing_if = "is_default_albedo")]
    #[schemars(!skip_serializing_if)]
    pub albedo: Channels,
    /// What of light passes it, from 0 to 1, straight on: one number or [r, g, b]. It is glass then.
    #[serde(default = "nothing", skip_serializing_if = "is_nothing")]
    #[schemars(!skip_serializing_if)]
    pub transmittance: Channels,
    /// Moves the shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
}

/// A parallelogram around its centre.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaneShape {
    /// Its middle, in metres.
    pub center: [f64; 3],
    /// Its two sides as vectors of their full lengths, in metres.
    pub sides: [[f64; 3]; 2],
    /// Diffuse reflectance from 0 to 1: one number or [r, g, b].
    #[serde(default = "default_albedo", skip_serializing_if = "is_default_albedo")]
    #[schemars(!skip_serializing_if)]
    pub albedo: Channels,
    /// What of light passes it, from 0 to 1, straight on: one number or [r, g, b]. It is glass then.
    #[serde(default = "nothing", skip_serializing_if = "is_nothing")]
    #[schemars(!skip_serializing_if)]
    pub transmittance: Channels,
    /// Moves the shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
}

/// A sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereShape {
    /// Its middle, in metres.
    pub center: [f64; 3],
    /// Its radius, in metres.
    pub radius: f64,
    /// Diffuse reflectance from 0 to 1: one number or [r, g, b].
    #[serde(default = "default_albedo", skip_serializing_if = "is_default_albedo")]
    #[schemars(!skip_serializing_if)]
    pub albedo: Channels,
    /// What of light passes it, from 0 to 1, straight on: one number or [r, g, b]. It is glass then.
    #[serde(default = "nothing", skip_serializing_if = "is_nothing")]
    #[schemars(!skip_serializing_if)]
    pub transmittance: Channels,
    /// Moves the shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
}

/// A cylinder with closed ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderShape {
    /// The middle of one end, in metres.
    pub from: [f64; 3],
    /// The middle of the other end, in metres.
    pub to: [f64; 3],
    /// Its radius, in metres.
    pub radius: f64,
    /// Diffuse reflectance from 0 to 1: one number or [r, g, b].
    #[serde(default = "default_albedo", skip_serializing_if = "is_default_albedo")]
    #[schemars(!skip_serializing_if)]
    pub albedo: Channels,
    /// What of light passes it, from 0 to 1, straight on: one number or [r, g, b]. It is glass then.
    #[serde(default = "nothing", skip_serializing_if = "is_nothing")]
    #[schemars(!skip_serializing_if)]
    pub transmittance: Channels,
    /// Moves the shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
}

/// Triangles of a glTF file, with their materials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GltfMesh {
    /// The .gltf or .glb file, relative to the scene file.
    pub file: FileName,
    /// Name of the node to take, with everything below it; the whole file when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
    /// Moves the triangles from where the file puts them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
}

/// Triangles of a Wavefront OBJ file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObjMesh {
    /// The .obj file, relative to the scene file.
    pub file: FileName,
    /// Moves the triangles from where the file puts them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_world: Option<Transform>,
}

/// The triangles of all occluders, which a hierarchy can be built over.
pub(super) fn mesh_of(occluders: &[Occluder], assets: &mut Assets) -> Built<Arc<Mesh>> {
    let mut mesh = Mesh::default();
    for (i, occluder) in occluders.iter().enumerate() {
        occluder.add_to(i, &mut mesh, assets).at(&format!("occluders[{i}]"))?;
    }
    Geometry::check(&mesh).at("occluders")?;
    Ok(mesh.into())
}

impl Occluder {
    /// Adds its triangles to `mesh`, as those of the occluder of this index.
    fn add_to(&self, index: usize, mesh: &mut Mesh, assets: &mut Assets) -> Built<()> {
        let (key, to_world) = self.place();
        let mut part = self.triangles(assets).at(key)?;
        part.objects.iter_mut().for_each(|object| object.occluder = index);
        let world_from_part = match to_world {
            Some(transform) => transform.build().at("to_world").at(key)?,
            None => DAffine3::IDENTITY,
        };
        append(mesh, part, world_from_part).at(key)
    }

    fn place(&self) -> (&'static str, Option<&Transform>) {
        match self {
            Self::Box(shape) => ("box", shape.to_world.as_ref()),
            Self::Plane(shape) => ("plane", shape.to_world.as_ref()),
            Self::Sphere(shape) => ("sphere", shape.to_world.as_ref()),
            Self::Cylinder(shape) => ("cylinder", shape.to_world.as_ref()),
            Self::Gltf(file) => ("gltf", file.to_world.as_ref()),
            Self::Obj(file) => ("obj", file.to_world.as_ref()),
        }
    }

    fn triangles(&self, assets: &mut Assets) -> Built<Mesh> {
        let (primitive, albedo, transmittance) = match self {
            Self::Box(shape) => (shape.primitive()?, shape.albedo, shape.transmittance),
            Self::Plane(shape) => (shape.primitive()?, shape.albedo, shape.transmittance),
            Self::Sphere(shape) => (shape.primitive()?, shape.albedo, shape.transmittance),
            Self::Cylinder(shape) => (shape.primitive()?, shape.albedo, shape.transmittance),
            Self::Gltf(GltfMesh { file, node, .. }) => {
                return Ok(assets.gltf_mesh(&GltfNode { file: file.clone(), node: node.clone() })?);
            }
            Self::Obj(obj) => return assets.obj_mesh(&obj.file).at("file"),
        };
        let mut mesh = primitive.mesh(albedo.rgb("albedo", 1.0)?)?;
        let glass = Glass { transmittance: transmittance.rgb("transmittance", 1.0)?, picture: None };
        if glass.transmittance != [0.0; 3] {
            mesh.materials[0].glass = Some(glass);
        }
        Ok(mesh)
    }
}

impl BoxShape {
    fn primitive(&self) -> Built<Primitive> {
        let size = point("size", self.size)?;
        if size.min_element() <= 0.0 {
            return Err(Flaw::value("size", format!("{:?}", self.size), "three lengths above 0"));
        }
        Ok(Primitive::Box { centre: point("center", self.center)?, size })
    }
}

impl PlaneShape {
    fn primitive(&self) -> Built<Primitive> {
        let sides = [point("sides[0]", self.sides[0])?, point("sides[1]", self.sides[1])?];
        let area = sides[0].cross(sides[1]).length();
        if area > 1e-9 * sides[0].length() * sides[1].length() {
            return Ok(Primitive::Plane { centre: point("center", self.center)?, sides });
        }
        Err(Flaw::value("sides", format!("{:?}", self.sides), "two sides that span an area"))
    }
}

impl SphereShape {
    fn primitive(&self) -> Built<Primitive> {
        Ok(Primitive::Sphere { centre: point("center", self.center)?, radius: radius(self.radius)? })
    }
}

impl CylinderShape {
    fn primitive(&self) -> Built<Primitive> {
        let (from, to) = (point("from", self.from)?, point("to", self.to)?);
        if from == to {
            return Err(Flaw::value("to", format!("{:?}", self.to), "another point than `from`"));
        }
        Ok(Primitive::Cylinder { from, to, radius: radius(self.radius)? })
    }
}

fn point(path: &str, coordinates: [f64; 3]) -> Built<DVec3> {
    let point = DVec3::from_array(coordinates);
    if is_near(point) {
        return Ok(point);
    }
    Err(Flaw::value(path, format!("{coordinates:?}"), "finite and within 1e9 metres"))
}

fn radius(radius: f64) -> Built<f64> {
    super::flaw::checked("radius", radius, "above 0 and at most 1e9 metres", |r| r > 0.0 && r <= FARTHEST)
}

fn is_near(point: DVec3) -> bool {
    point.is_finite() && point.abs().max_element() <= FARTHEST
}

/// Adds `part` when the indices of the whole still fit and it ends up where numbers are precise.
fn append(mesh: &mut Mesh, part: Mesh, world_from_part: DAffine3) -> Built<()> {
    let vertices = mesh.positions.len().saturating_add(part.positions.len());
    let materials = mesh.materials.len().saturating_add(part.materials.len());
    let objects = mesh.objects.len().saturating_add(part.objects.len());
    if [vertices, materials, objects].into_iter().any(|count| u32::try_from(count).is_err()) {
        return Err(Flaw::new(
            "",
            "the scene has more than 4294967295 vertices; leave out or simplify occluders",
        ));
    }
    let first = mesh.positions.len();
    mesh.append(part, world_from_part);
    match mesh.positions[first..].iter().find(|&&position| !is_near(position)) {
        None => Ok(()),
        Some(far) => Err(Flaw::value("", format!("a vertex at {far}"), "finite and within 1e9 metres")),
    }
}

fn default_albedo() -> Channels {
    Channels::Grey(0.5)
}

fn nothing() -> Channels {
    Channels::Grey(0.0)
}

fn is_nothing(transmittance: &Channels) -> bool {
    *transmittance == nothing()
}

fn is_default_albedo(albedo: &Channels) -> bool {
    *albedo == default_albedo()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flaw_of(text: &str) -> String {
        let occluder: Occluder = serde_json::from_str(text).unwrap();
        let mut assets = Assets::beside("scene.json".as_ref());
        match occluder.add_to(0, &mut Mesh::default(), &mut assets) {
            Err(Flaw::Document { path, .. }) => path,
            other => format!("{other:?}"),
        }
    }

    #[test]
    fn shapes_without_substance_are_refused_at_their_fault() {
        let table = [
            (r#"{"box": {"center": [0,0,0], "size": [1,0,1]}}"#, "box.size"),
            (r#"{"box": {"center": [0,1e300,0], "size": [1,1,1]}}"#, "box.center"),
            (r#"{"box": {"center": [0,0,0], "size": [1,1,1], "albedo": 1.1}}"#, "box.albedo"),
            (
                r#"{"box": {"center": [0,0,0], "size": [1,1,1], "to_world": {"scale": 0}}}"#,
                "box.to_world.scale",
            ),
            (r#"{"plane": {"center": [0,0,0], "sides": [[1,0,0],[2,0,0]]}}"#, "plane.sides"),
            (r#"{"plane": {"center": [0,0,0], "sides": [[1,0,0],[0,1e10,0]]}}"#, "plane.sides[1]"),
            (r#"{"sphere": {"center": [0,0,0], "radius": -1}}"#, "sphere.radius"),
            (r#"{"cylinder": {"from": [1,1,1], "to": [1,1,1], "radius": 1}}"#, "cylinder.to"),
            (r#"{"obj": {"file": ""}}"#, "obj.file"),
        ];
        for (text, path) in table {
            assert_eq!(flaw_of(text), path, "{text}");
        }
        assert_eq!(flaw_of(r#"{"sphere": {"center": [0,0,0], "radius": 1}}"#), "Ok(())");
    }

    #[test]
    fn each_occluder_is_an_object_of_its_own() {
        let texts = [
            r#"{"box": {"center": [0,0,0], "size": [1,1,1], "albedo": 0.25}}"#,
            r#"{"sphere": {"center": [3,0,0], "radius": 1}}"#,
            r#"{"box": {"center": [6,0,0], "size": [1,1,1], "albedo": 0.75}}"#,
        ];
        let occluders = texts.map(|text| serde_json::from_str(text).unwrap());
        let mesh = mesh_of(&occluders, &mut Assets::beside("scene.json".as_ref())).unwrap();
        assert_eq!(mesh.objects.len(), 3);
        for (triangle, vertices) in mesh.triangles.iter().enumerate() {
            // They lie three metres apart.
            let expected = (mesh.positions[vertices[0] as usize].x / 3.0).round() as usize;
            assert_eq!(mesh.object_of[triangle] as usize, expected);
            assert_eq!(mesh.object(triangle).occluder, expected);
            assert_eq!(mesh.material(triangle).albedo, [[0.25; 3], [0.5; 3], [0.75; 3]][expected]);
        }
    }

    #[test]
    fn what_ends_up_too_far_away_is_refused() {
        let part = Mesh { positions: vec![DVec3::X * 1e6], ..Mesh::default() };
        let stretch = DAffine3::from_scale(DVec3::splat(1e6));
        assert!(append(&mut Mesh::default(), part.clone(), stretch).is_err());
        assert!(append(&mut Mesh::default(), part, DAffine3::IDENTITY).is_ok());
    }
}
