//! Geometry from Wavefront OBJ files.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use tobj::{LoadError, LoadOptions};

use crate::scene::{Material, Mesh, Object, Rgb};
use crate::{Error, Result};

/// Of faces without a material, or whose material has no diffuse colour.
const GREY: Rgb = [0.6; 3];

/// What the crate calls faces before the first object or group with a name.
const UNNAMED: &str = "unnamed_object";

/// Reads the triangles of a `.obj` file; polygons are cut into fans, points and lines left out.
///
/// Albedo is `Kd` of the `.mtl` files, clamped to [0, 1], and 0.6 where the file or the value is missing. Faces after an `o`
/// or a `g` are of the object of that name; the same name later on is the same object.
///
/// Errors: [`Error::File`] where the file cannot be read, [`Error::Format`] where it is broken or has no triangles.
pub fn load(path: &Path) -> Result<Mesh> {
    let broken = |reason: String| Error::Format { path: path.into(), format: "OBJ", reason };
    let bytes = std::fs::read(path);
    let bytes = bytes.map_err(|source| Error::File { action: "read", path: path.into(), source })?;
    // Names need not be UTF-8, and nothing but names can be something else.
    let text = String::from_utf8_lossy(&bytes);
    check_faces(&text).map_err(broken)?;
    let options =
        LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let folder = path.parent().unwrap_or(Path::new(""));
    let loaded = tobj::load_obj_buf(&mut text.as_bytes(), &options, |name| {
        let path = Some(folder.join(name)).filter(|path| path.is_file());
        let bytes = path.and_then(|path| std::fs::read(path).ok()).ok_or(LoadError::OpenFileFailed)?;
        let materials = read_materials(&bytes);
        let names = materials.iter().enumerate().map(|(index, material)| (material.name.clone(), index));
        let names = names.collect();
        Ok((materials, names))
    });
    let (models, materials) = loaded.map_err(|error| broken(reason(&error)))?;
    // A library that cannot be read leaves its materials out.
    let materials = materials.unwrap_or_default();

    let mut mesh = Mesh::default();
    mesh.materials.push(Material { name: None, albedo: GREY, mask: None });
    mesh.materials.extend(materials.iter().map(|material| Material {
        name: Some(material.name.clone()),
        albedo: albedo(material),
        mask: None,
    }));
    let mut objects = HashMap::new();
    for model in &models {
        let material = model.mesh.material_id.map_or(0, |index| index + 1);
        add(&mut mesh, &model.mesh, material as u32)
            .ok_or_else(|| broken("it has too many vertices".into()))?;
        if !model.mesh.indices.is_empty() {
            let object = *objects.entry(model.name.as_str()).or_insert_with(|| {
                let name = Some(model.name.clone()).filter(|name| name != UNNAMED);
                mesh.objects.push(Object { name, occluder: 0 });
                mesh.objects.len() as u32 - 1
            });
            mesh.object_of.resize(mesh.triangles.len(), object);
        }
    }
    if mesh.triangles.is_empty() {
        return Err(broken("it has no triangles".into()));
    }
    mesh.validate().map_err(|error| broken(error.to_string()))?;
    Ok(mesh)
}

/// None where vertices are too many to be numbered.
fn add(mesh: &mut Mesh, part: &tobj::Mesh, material: u32) -> Option<()> {
    let first = u32::try_from(mesh.positions.len()).ok()?;
    u32::try_from(mesh.positions.len() + part.positions.len() / 3).ok()?;
    let vertices = part.positions.chunks_exact(3);
    mesh.positions.extend(vertices.map(|p| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))));
    // OBJ counts v from the bottom of the picture.
    let mut coordinates = part.texcoords.chunks_exact(2).map(|uv| [uv[0], 1.0 - uv[1]]);
    mesh.coordinates.resize_with(mesh.positions.len(), || coordinates.next().unwrap_or_default());
    let triangles = part.indices.chunks_exact(3).map(|t| [t[0] + first, t[1] + first, t[2] + first]);
    mesh.triangles.extend(triangles);
    mesh.material_of.resize(mesh.triangles.len(), material);
    Some(())
}

fn albedo(material: &tobj::Material) -> Rgb {
    material.diffuse.map_or(GREY, |color| color.map(|c| c.clamp(0.0, 1.0)))
}

/// Names and diffuse colours of a `.mtl` file.
///
/// The crate's own reader panics on a `Kd` of less than three numbers, and gives up on a broken line that does
/// not matter here.
fn read_materials(bytes: &[u8]) -> Vec<tobj::Material> {
    let mut materials: Vec<tobj::Material> = Vec::new();
    for line in String::from_utf8_lossy(bytes).lines() {
        let (word, rest) = line.trim().split_once(char::is_whitespace).unwrap_or_default();
        match (word, materials.last_mut()) {
            ("newmtl", _) => {
                materials.push(tobj::Material { name: rest.trim().to_owned(), ..Default::default() });
            }
            ("Kd", Some(material)) => {
                let numbers = rest.split_whitespace().map_while(|word| word.parse().ok());
                let numbers: Vec<f32> = numbers.filter(|number: &f32| number.is_finite()).collect();
                material.diffuse = numbers.first_chunk().copied();
            }
            _ => {}
        }
    }
    materials
}

/// Checks indices that reach before the start of the file or are far too large: the crate's arithmetic
/// overflows on them. Errors are reasons.
fn check_faces(text: &str) -> std::result::Result<(), String> {
    let mut counts = [0_i64; 3];
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            Some("f") => {
                let corners = words.flat_map(|corner| corner.split('/').zip(counts));
                for (index, count) in corners.filter(|(index, _)| !index.is_empty()) {
                    let valid = |&index: &i64| index != 0 && (-count..=i64::from(u32::MAX)).contains(&index);
                    if index.parse::<i64>().ok().filter(valid).is_none() {
                        return Err(format!("line {}: a face has the index {index}", number + 1));
                    }
                }
            }
            _ => {}
        }
    }
    Ok(())
}

fn reason(error: &LoadError) -> String {
    match error {
        LoadError::PositionParseError => "a vertex is not three numbers".into(),
        LoadError::FaceVertexOutOfBounds => "a face has a vertex that is not in the file".into(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(text: &str, materials: Option<&str>) -> Result<Mesh> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.obj");
        std::fs::write(&path, text).unwrap();
        if let Some(materials) = materials {
            std::fs::write(folder.path().join("scene.mtl"), materials).unwrap();
        }
        load(&path)
    }

    const SQUARE: &str = "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                          usemtl Leaf\nf 1/1 2/2 3/3 4/4\nusemtl Other\nf -4 -2 -1\n";

    #[test]
    fn polygons_become_triangles_with_their_materials() {
        let mesh = loaded(SQUARE, Some("newmtl Leaf\nKd 0.1 0.8 7.0\nnewmtl Other\nNs 10\n")).unwrap();
        assert_eq!(mesh.triangles.len(), 3);
        let albedo = |triangle: usize| mesh.materials[mesh.material_of[triangle] as usize].albedo;
        assert_eq!([albedo(0), albedo(1), albedo(2)], [[0.1, 0.8, 1.0], [0.1, 0.8, 1.0], GREY]);
        let first = mesh.triangles[0].map(|vertex| vertex as usize);
        assert_eq!(first.map(|vertex| mesh.coordinates[vertex]), [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
        let last = mesh.triangles[2].map(|vertex| mesh.positions[vertex as usize]);
        assert_eq!(last, [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
    }

    #[test]
    fn triangles_know_their_object_or_group_and_their_material() {
        let text = "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
                    f 1 2 3\n\
                    o Tree\nusemtl Leaf\nf 1 2 3\nusemtl Bark\nf 1 3 4\n\
                    g Wall\nf 2 3 4\n\
                    o Empty\n\
                    o Tree\nusemtl Leaf\nf 1 2 4\n";
        let mesh = loaded(text, Some("newmtl Leaf\nKd 0 1 0\nnewmtl Bark\nKd 0.5 0.25 0\n")).unwrap();
        let names = |triangle: usize| {
            (mesh.object(triangle).name.as_deref(), mesh.material(triangle).name.as_deref())
        };
        let found: Vec<_> = (0..mesh.triangles.len()).map(names).collect();
        let expected = [
            (None, None),
            (Some("Tree"), Some("Leaf")),
            (Some("Tree"), Some("Bark")),
            (Some("Wall"), Some("Bark")),
            (Some("Tree"), Some("Leaf")),
        ];
        assert_eq!(found, expected);
        assert_eq!(mesh.objects.len(), 3, "what is named twice is one object, and what is empty is none");
    }

    #[test]
    fn a_missing_material_file_makes_things_grey() {
        let mesh = loaded(SQUARE, None).unwrap();
        assert!(mesh.material_of.iter().all(|&m| mesh.materials[m as usize].albedo == GREY));
    }

    #[test]
    fn broken_files_are_errors() {
        for text in [
            "",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -9\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/-9 2/1 3/1\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//9223372036854775807 2//1 3//1\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n",
            "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n",
            "v 0 0 0\nv 1 0 1e99\nv 0 1 0\nf 1 2 3\n",
            "v 0 0\nf 1 1 1\n",
            "v 0 0 0\nv 1 0 0\nf 1 2\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/2 3/3\n",
        ] {
            assert!(matches!(loaded(text, None), Err(Error::Format { .. })), "{text}");
        }
        // Coordinates that are not there at all are left out.
        assert!(loaded("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/2 3/3\n", None).is_ok());
        assert!(matches!(load(Path::new("/no/such/file.obj")), Err(Error::File { .. })));
    }
    #[test]
    fn damaged_bytes_never_panic() {
        let mut seed = 1_u64;
        for _ in 0..1500 {
            let mut damaged = SQUARE.as_bytes().to_vec();
            for _ in 0..2 {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let at = (seed >> 33) as usize % damaged.len();
                damaged[at] = b"0123456789-/ \nfv.e"[(seed >> 20) as usize % 18];
            }
            let _ = loaded(&String::from_utf8(damaged).unwrap(), Some("newmtl Leaf\nKd 0.1 nan\n"));
        }
    }
}
