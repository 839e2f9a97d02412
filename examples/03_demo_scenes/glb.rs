//! A small writer of binary glTF: quads of leaves and of stained glass, which have pictures, and of what is one colour.

use std::error::Error;
use std::io::Cursor;

use glam::DVec3;
use image::{ImageFormat, Rgba, RgbaImage};
use serde_json::{Value, json};

use crate::stage::millimetres;

/// Triangles with texture coordinates.
#[derive(Default)]
pub(crate) struct Surface {
    positions: Vec<[f32; 3]>,
    /// In 255ths of the picture.
    coordinates: Vec<[u8; 2]>,
    indices: Vec<u16>,
}

impl Surface {
    /// A flat card with the whole picture on it: its middle and half of its sides.
    pub(crate) fn card(&mut self, middle: DVec3, [a, b]: [DVec3; 2]) {
        self.quad([middle - a - b, middle + a - b, middle + a + b, middle - a + b]);
    }

    /// Four corners, counter-clockwise.
    pub(crate) fn quad(&mut self, corners: [DVec3; 4]) {
        let first = self.positions.len() as u16;
        self.positions.extend(corners.map(|p| p.to_array().map(|c| millimetres(c) as f32)));
        self.coordinates.extend([[0, 255], [255, 255], [255, 0], [0, 0]]);
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }

    /// How many quads there are; at most 16384 fit.
    pub(crate) fn quads(&self) -> usize {
        self.positions.len() / 4
    }
}

/// What a surface is made of.
pub(crate) enum Made {
    /// A picture with holes where its alpha is low.
    OfLeaves(RgbaImage),
    /// A picture through which light passes, coloured by it.
    OfGlass(RgbaImage),
    /// One linear colour.
    Of([f32; 3]),
}

/// A glTF file with one node and one material a surface, each with the names of both.
pub(crate) fn glb(parts: &[([&str; 2], &Surface, Made)]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut file = File::default();
    let (mut images, mut materials) = (Vec::new(), Vec::new());
    for ([_, name], _, made) in parts {
        if let Made::OfLeaves(picture) | Made::OfGlass(picture) = made {
            let mut png = Vec::new();
            picture.write_to(&mut Cursor::new(&mut png), ImageFormat::Png)?;
            images.push(json!({ "bufferView": file.view(&png, json!({})), "mimeType": "image/png" }));
        }
        let pictured =
            json!({ "baseColorTexture": { "index": images.len().saturating_sub(1) }, "metallicFactor": 0.0 });
        materials.push(match made {
            Made::OfLeaves(_) => json!({
                "name": name, "alphaMode": "MASK", "alphaCutoff": 0.5, "doubleSided": true,
                "pbrMetallicRoughness": pictured
            }),
            Made::OfGlass(_) => json!({
                "name": name, "doubleSided": true, "pbrMetallicRoughness": pictured,
                "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1.0 } }
            }),
            Made::Of(color) => {
                let [r, g, b] = color.map(|c| millimetres(f64::from(c)));
                json!({ "name": name, "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0 } })
            }
        });
    }
    let meshes: Vec<Value> =
        parts.iter().enumerate().map(|(index, (_, surface, _))| file.mesh(surface, index)).collect();
    let mut root = json!({
        "asset": { "version": "2.0", "generator": "unscatter 03_demo_scenes" },
        "scene": 0,
        "scenes": [{ "nodes": (0..parts.len()).collect::<Vec<_>>() }],
        "nodes": parts.iter().enumerate().map(|(mesh, ([name, _], ..))| json!({ "name": name, "mesh": mesh })).collect::<Vec<_>>(),
        "meshes": meshes,
        "materials": materials,
        "textures": (0..images.len()).map(|image| json!({ "source": image })).collect::<Vec<_>>(),
        "images": images,
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{ "byteLength": file.bytes.len() }],
    });
    if parts.iter().any(|(.., made)| matches!(made, Made::OfGlass(_))) {
        root["extensionsUsed"] = json!(["KHR_materials_transmission"]);
    }
    Ok(container(&serde_json::to_vec(&root)?, &file.bytes))
}

#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl File {
    fn mesh(&mut self, surface: &Surface, material: usize) -> Value {
        let axis = |pick: fn(f32, f32) -> f32, axis: usize| {
            surface.positions.iter().map(|p| p[axis]).reduce(pick).unwrap_or_default()
        };
        let bounds = |pick| [axis(pick, 0), axis(pick, 1), axis(pick, 2)].map(|c| millimetres(f64::from(c)));
        let count = surface.positions.len();
        let positions: Vec<u8> = surface.positions.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        let view = self.view(&positions, json!({ "byteStride": 12 }));
        let positions = self.accessor(json!({
            "bufferView": view, "componentType": 5126, "type": "VEC3", "count": count,
            "min": bounds(f32::min), "max": bounds(f32::max)
        }));
        // Vertices begin at multiples of four bytes, so two are empty.
        let coordinates: Vec<u8> = surface.coordinates.iter().flat_map(|&[u, v]| [u, v, 0, 0]).collect();
        let view = self.view(&coordinates, json!({ "byteStride": 4 }));
        let coordinates = self.accessor(json!({
            "bufferView": view, "componentType": 5121, "normalized": true, "type": "VEC2", "count": count
        }));
        let indices: Vec<u8> = surface.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&indices, json!({}));
        let indices = self.accessor(json!({
            "bufferView": view, "componentType": 5123, "type": "SCALAR", "count": surface.indices.len()
        }));
        json!({ "primitives": [{
            "attributes": { "POSITION": positions, "TEXCOORD_0": coordinates },
            "indices": indices, "material": material
        }]})
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends bytes at a multiple of four.
    fn view(&mut self, bytes: &[u8], mut view: Value) -> usize {
        view["buffer"] = json!(0);
        view["byteOffset"] = json!(self.bytes.len());
        view["byteLength"] = json!(bytes.len());
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }
}

/// Header, JSON chunk, binary chunk (glTF 2.0, sec. 4).
fn container(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut json = json.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |length: usize| (length as u32).to_le_bytes();
    let mut file = Vec::new();
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(word(12 + 8 + json.len() + 8 + binary.len()));
    file.extend(word(json.len()));
    file.extend(b"JSON");
    file.extend(&json);
    file.extend(word(binary.len()));
    file.extend(b"BIN\0");
    file.extend(binary);
    file
}

/// A spray of leaves on nothing: pointed ovals along a stalk.
pub(crate) fn leaf_picture() -> RgbaImage {
    const SIZE: u32 = 64;
    // Foot and tip of each leaf, in 64ths of the picture, and its half width.
    const LEAVES: [([f64; 4], f64); 9] = [
        ([32.0, 34.0, 31.0, 1.0], 7.5),
        ([31.0, 40.0, 8.0, 12.0], 7.0),
        ([33.0, 40.0, 57.0, 11.0], 7.0),
        ([31.0, 46.0, 2.0, 33.0], 6.5),
        ([33.0, 46.0, 62.0, 34.0], 6.5),
        ([31.0, 52.0, 7.0, 55.0], 5.5),
        ([33.0, 52.0, 58.0, 54.0], 5.5),
        ([31.0, 54.0, 22.0, 63.0], 4.5),
        ([33.0, 54.0, 43.0, 62.0], 4.5),
    ];
    let covers = |x: f64, y: f64, [ax, ay, bx, by]: [f64; 4], half: f64| {
        let (dx, dy) = (bx - ax, by - ay);
        let squared = dx * dx + dy * dy;
        let along = ((x - ax) * dx + (y - ay) * dy) / squared;
        let across = ((x - ax) * dy - (y - ay) * dx).abs() / squared.sqrt();
        // A parabola: nothing at foot and tip, widest in the middle.
        (0.0..=1.0).contains(&along) && across < 4.0 * half * along * (1.0 - along)
    };
    RgbaImage::from_fn(SIZE, SIZE, |i, j| {
        let (x, y) = (f64::from(i) + 0.5, f64::from(j) + 0.5);
        let leaf = LEAVES.iter().position(|&(ends, half)| covers(x, y, ends, half));
        let stalk = (x - 32.0).abs() < 1.0 && y > 30.0;
        match leaf {
            Some(leaf) => Rgba([70 + 4 * leaf as u8, 104 + 5 * leaf as u8, 40, 255]),
            None if stalk => Rgba([74, 60, 40, 255]),
            None => Rgba([80, 110, 44, 0]),
        }
    })
}
