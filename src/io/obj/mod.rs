//! Geometry from Wavefront OBJ files.

mod materials;
mod mtl;
mod polygon;
mod statements;

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use self::materials::Materials;
use self::statements::{Statement, Statements, name, number, shown, words};
use super::input;
use crate::scene::{Mesh, Object};
use crate::{Error, Result, Warning};

/// No file is read beyond this many bytes.
const MAX_FILE: u64 = 1 << 32;

/// Beyond this nobody measures, and areas could not be computed.
const FARTHEST: f64 = 1e100;

/// Reads the triangles of a `.obj` file. Polygons are cut into triangles in their plane; points, lines,
/// curves and free-form surfaces are left out, the latter two with a warning.
///
/// Albedo is `Kd` of the `.mtl` files, clamped to [0, 1], and 0.6 where the file or the value is missing. A
/// material is there where its opacity, `d` (or 1 − `Tr`) times `map_d`, is at least one half; faces that are
/// nowhere are left out. Faces after an `o` or a `g` are of the object of that name; the same name later on
/// is the same object.
///
/// Errors: [`Error::File`] where the file cannot be read, [`Error::Format`] where it is broken or has no
/// triangles, [`Error::TooLarge`] beyond 4 GiB or `most_triangles`, and those of a picture that is there and cannot be read.
pub fn load(path: &Path, most_triangles: usize) -> Result<Mesh> {
    let (mesh, warnings) = read(path, &input::bytes(path, MAX_FILE, "split the scene")?, most_triangles)?;
    for warning in warnings {
        Warning::new("ignored", format!("{}: {warning}", path.display()), "").tell();
    }
    Ok(mesh)
}

/// The triangles of a file with these bytes, and what was left out.
fn read(path: &Path, bytes: &[u8], most_triangles: usize) -> Result<(Mesh, Vec<String>)> {
    let mut reader = Reader::new(path, most_triangles);
    for statement in Statements::new(bytes).map_err(|reason| reader.broken(reason.into()))? {
        reader.add(&statement)?;
    }
    reader.finish()
}

/// A corner of a face: the numbers of its vertex and of its texture coordinates, from 1; 0 for none.
type Corner = [u32; 2];

struct Reader<'a> {
    path: &'a Path,
    most_triangles: usize,
    positions: Vec<DVec3>,
    coordinates: Vec<[f32; 2]>,
    normals: usize,
    mesh: Mesh,
    /// The vertices of the mesh.
    vertices: HashMap<Corner, u32>,
    objects: HashMap<String, u32>,
    object: String,
    materials: Materials,
    material: String,
    /// Materials by name and by whether they can have a picture: an index into those of the mesh, none for
    /// what is nowhere.
    surfaces: HashMap<(String, bool), Option<u32>>,
    /// Those of `material`, where they are known.
    current: [Option<Option<u32>>; 2],
    transparent: usize,
    degenerate: usize,
    curved: usize,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, most_triangles: usize) -> Self {
        Self {
            path,
            most_triangles,
            positions: Vec::new(),
            coordinates: Vec::new(),
            normals: 0,
            mesh: Mesh::default(),
            vertices: HashMap::new(),
            objects: HashMap::new(),
            object: String::new(),
            materials: Materials::of(path),
            material: String::new(),
            surfaces: HashMap::new(),
            current: [None; 2],
            transparent: 0,
            degenerate: 0,
            curved: 0,
        }
    }

    fn broken(&self, reason: String) -> Error {
        Error::Format { path: self.path.into(), format: "OBJ", reason }
    }

    fn add(&mut self, statement: &Statement) -> Result<()> {
        let (word, rest) = statement.parts();
        let at_fault = |reader: &Self, fault| reader.broken(format!("line {}: {fault}", statement.line));
        match word {
            b"v" => {
                let position = position(rest).map_err(|fault| at_fault(self, fault))?;
                self.positions.push(position);
            }
            b"vt" => self.coordinates.push(coordinates(rest)),
            b"vn" => self.normals += 1,
            b"f" | b"fo" => {
                let corners: Result<Vec<Corner>, String> =
                    words(rest).map(|word| self.corner(word)).collect();
                let corners = corners.map_err(|fault| at_fault(self, fault))?;
                self.add_face(corners, statement.line)?;
            }
            b"o" | b"g" => self.object = name(rest),
            b"usemtl" => {
                self.material = name(rest);
                self.current = [None; 2];
            }
            b"mtllib" => self.materials.add_libraries(rest),
            b"curv" | b"surf" => self.curved += 1,
            _ => {}
        }
        Ok(())
    }

    /// A corner as `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&self, word: &[u8]) -> Result<Corner, String> {
        let [mut vertex, mut coordinates] = [0; 2];
        for (part, text) in word.split(|&byte| byte == b'/').enumerate() {
            let (what, count) = match part {
                0 => ("vertex", self.positions.len()),
                1 => ("texture coordinate", self.coordinates.len()),
                2 => ("normal", self.normals),
                _ => return Err(format!("`{}` is no corner of a face", shown(word))),
            };
            if text.is_empty() && part > 0 {
                continue;
            }
            let index = std::str::from_utf8(text).ok().and_then(|text| text.parse::<i64>().ok());
            let index = index.ok_or_else(|| format!("`{}` is no number of a {what}", shown(text)))?;
            // Faces may be numbered for what the exporter has then left out.
            if part > 0 && count == 0 && index != 0 {
                continue;
            }
            let number = from_first(index, count)
                .ok_or_else(|| format!("a face has the {what} {index}, and there are {count} so far"))?;
            match part {
                0 => vertex = number,
                1 => coordinates = number,
                _ => {}
            }
        }
        Ok([vertex, coordinates])
    }

    fn add_face(&mut self, mut corners: Vec<Corner>, line: usize) -> Result<()> {
        let place = |corner: &Corner| self.positions[corner[0] as usize - 1];
        corners.dedup_by(|b, a| place(a) == place(b));
        while corners.len() > 1 && corners.first().map(place) == corners.last().map(place) {
            corners.pop();
        }
        let outline: Vec<DVec3> = corners.iter().map(place).collect();
        let triangles = polygon::triangles(&outline).map_err(|polygon::TooManyCorners| {
            let (corners, most) = (corners.len(), polygon::MAX_CORNERS);
            self.broken(format!(
                "line {line}: a face that is not convex has {corners} corners, and {most} are the most; triangulate it in \
                 the modelling program"
            ))
        })?;
        if triangles.is_empty() {
            self.degenerate += 1;
            return Ok(());
        }
        let has_coordinates = corners.iter().all(|corner| corner[1] > 0);
        let Some(material) = self.surface(has_coordinates)? else {
            self.transparent += 1;
            return Ok(());
        };
        if u32::try_from(self.mesh.positions.len() + corners.len()).is_err() {
            return Err(self.broken("it has too many vertices; split it".into()));
        }
        if self.mesh.triangles.len() + triangles.len() > self.most_triangles {
            return Err(Error::TooLarge {
                what: self.path.display().to_string(),
                needed: format!("more than {} triangles", self.most_triangles),
                limit: self.most_triangles.to_string(),
                remedy: "simplify the scene, or raise solve.memory",
            });
        }
        let vertices: Vec<u32> = corners.into_iter().map(|corner| self.vertex(corner)).collect();
        let object = self.object();
        let mesh = &mut self.mesh;
        mesh.triangles.extend(triangles.into_iter().map(|triangle| triangle.map(|corner| vertices[corner])));
        mesh.material_of.resize(mesh.triangles.len(), material);
        mesh.object_of.resize(mesh.triangles.len(), object);
        Ok(())
    }

    fn surface(&mut self, has_coordinates: bool) -> Result<Option<u32>> {
        if let Some(known) = self.current[usize::from(has_coordinates)] {
            return Ok(known);
        }
        let key = (self.material.clone(), has_coordinates);
        let surface = match self.surfaces.get(&key) {
            Some(&known) => known,
            None => {
                let material = self.materials.material(&self.material, has_coordinates)?;
                let index = self.mesh.materials.len() as u32;
                let surface = material.is_some().then_some(index);
                self.mesh.materials.extend(material);
                self.surfaces.insert(key, surface);
                surface
            }
        };
        self.current[usize::from(has_coordinates)] = Some(surface);
        Ok(surface)
    }

    fn vertex(&mut self, corner: Corner) -> u32 {
        let [position, coordinates] = corner.map(|number| (number as usize).checked_sub(1));
        let next = self.mesh.positions.len() as u32;
        *self.vertices.entry(corner).or_insert_with(|| {
            self.mesh.positions.extend(position.map(|index| self.positions[index]));
            self.mesh.coordinates.push(coordinates.map(|index| self.coordinates[index]).unwrap_or_default());
            next
        })
    }

    fn object(&mut self) -> u32 {
        if let Some(&known) = self.objects.get(&self.object) {
            return known;
        }
        let index = self.mesh.objects.len() as u32;
        let name = Some(self.object.clone()).filter(|name| !name.is_empty());
        self.mesh.objects.push(Object { name, occluder: 0 });
        self.objects.insert(self.object.clone(), index);
        index
    }

    fn finish(mut self) -> Result<(Mesh, Vec<String>)> {
        let mut warnings = self.materials.warnings();
        for (count, warning) in [
            (self.degenerate, "faces without an area are left out"),
            (self.transparent, "faces are transparent and block no light"),
            (self.curved, "curves and free-form surfaces are left out; export them as polygons"),
        ] {
            if count > 0 {
                warnings.push(format!("{warning} ({count})"));
            }
        }
        // Glass alone is fine, and stands in nobody's light.
        if self.mesh.triangles.is_empty() && self.transparent == 0 {
            return Err(self.broken("it has no triangles".into()));
        }
        // Broken coordinates that nothing here needs are not in the way of other occluders, which may have
        // masks.
        if self.mesh.materials.iter().all(|material| material.mask.is_none()) {
            let broken = |coordinates: &&mut [f32; 2]| !coordinates.iter().all(|c| c.is_finite());
            self.mesh.coordinates.iter_mut().filter(broken).for_each(|coordinates| *coordinates = [0.0; 2]);
        }
        self.mesh.validate().map_err(|error| self.broken(error.to_string()))?;
        Ok((self.mesh, warnings))
    }
}

/// The number from 1 that an index stands for; negative ones count back from the last.
fn from_first(index: i64, count: usize) -> Option<u32> {
    let distance =
        usize::try_from(index.unsigned_abs()).ok().filter(|distance| (1..=count).contains(distance))?;
    u32::try_from(if index > 0 { distance } else { count - distance + 1 }).ok()
}

/// Three numbers; colours and weights may follow.
fn position(text: &[u8]) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = words(text).take(3).map(number).collect();
    let position = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()).map(DVec3::from_array);
    let fault = |what| format!("the vertex `{}` {what}", shown(text));
    let position = position.ok_or_else(|| fault("is not three numbers"))?;
    if !position.is_finite() {
        return Err(fault("has a number that is not finite"));
    }
    if position.abs().max_element() > FARTHEST {
        return Err(fault("lies beyond 1e100"));
    }
    Ok(position)
}

/// As glTF counts them: v from the top of the picture. What is no number is NaN, which matters to masks
/// alone.
fn coordinates(text: &[u8]) -> [f32; 2] {
    let mut numbers = words(text).map(|word| number(word).unwrap_or(f64::NAN) as f32);
    let (u, v) = (numbers.next().unwrap_or(f32::NAN), numbers.next().unwrap_or(0.0));
    [u, 1.0 - v]
}

#[cfg(test)]
mod tests;
