use std::io::Cursor;
use std::path::PathBuf;

use base64::Engine;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::Error;
use crate::scene::{Ray, Wrap};
use crate::visibility::Geometry;

/// More triangles than any test makes.
const MANY: usize = 1000;

/// A square of two triangles in the plane z = 0, as positions, indices and coordinates in one buffer.
fn square_bytes() -> Vec<u8> {
    let positions: [f32; 12] = [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
    let coordinates: [f32; 8] = [0., 1., 1., 1., 1., 0., 0., 0.];
    let indices: [u16; 6] = [0, 1, 2, 0, 2, 3];
    let mut bytes: Vec<u8> = positions.iter().chain(&coordinates).flat_map(|f| f.to_le_bytes()).collect();
    bytes.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

fn data_uri(bytes: &[u8]) -> String {
    format!(
        "data:application/octet-stream;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(bytes)
    )
}

/// One node `Square` with the square.
fn square() -> Value {
    let bytes = square_bytes();
    json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": bytes.len(), "uri": data_uri(&bytes)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}]}],
        "nodes": [{"name": "Square", "mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    })
}

fn written(file: &Value) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    (folder, path)
}

fn load(file: &Value) -> Result<GltfScene> {
    GltfScene::load(&written(file).1)
}

fn mesh(file: &Value) -> Result<Mesh> {
    let (_folder, path) = written(file);
    GltfScene::load(&path)?.mesh(None, MANY)
}

fn message<T: std::fmt::Debug>(result: Result<T>) -> String {
    result.unwrap_err().to_string()
}

fn glb(json: &Value, bin: Option<&[u8]>) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], content: &[u8], filler: u8| {
        let mut content = content.to_vec();
        content.resize(content.len().next_multiple_of(4), filler);
        let mut chunk = (content.len() as u32).to_le_bytes().to_vec();
        chunk.extend(kind);
        chunk.extend(content);
        chunk
    };
    let mut chunks = chunk(b"JSON", json.to_string().as_bytes(), b' ');
    chunks.extend(bin.map(|bin| chunk(b"BIN\0", bin, 0)).unwrap_or_default());
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((chunks.len() as u32 + 12).to_le_bytes());
    bytes.extend(chunks);
    bytes
}

/// Area seen from +z: negative where triangles face away.
fn signed_area(mesh: &Mesh) -> f64 {
    let corners = mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize]));
    corners.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).z).sum()
}

#[test]
fn triangles_know_their_node_and_their_material() {
    let mut file = square();
    file["materials"] = json!([
        {"name": "Red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}},
        {"name": "Blue", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]}},
    ]);
    let primitive = |material: Option<usize>| {
        let mut primitive = json!({"attributes": {"POSITION": 0}, "indices": 2});
        material.into_iter().for_each(|index| primitive["material"] = json!(index));
        primitive
    };
    file["meshes"] = json!([
        {"primitives": [primitive(Some(0)), primitive(Some(1))]},
        {"name": "Cloth", "primitives": [primitive(Some(1)), primitive(None)]},
    ]);
    // The second node has no triangles, and the third no name.
    file["nodes"] = json!([{"name": "Wall", "mesh": 0}, {"name": "Nothing"}, {"mesh": 1}]);
    file["scenes"] = json!([{"nodes": [0, 1, 2]}]);
    let mesh = mesh(&file).unwrap();
    mesh.validate().unwrap();
    assert_eq!(mesh.object_of, [0, 0, 0, 0, 1, 1, 1, 1]);
    let object = |triangle: usize| mesh.object(triangle).name.as_deref();
    let material = |triangle: usize| mesh.material(triangle).name.as_deref();
    let both = |triangle: usize| (object(triangle), material(triangle));
    assert_eq!([0, 1].map(both), [(Some("Wall"), Some("Red")); 2]);
    assert_eq!([2, 3].map(both), [(Some("Wall"), Some("Blue")); 2]);
    assert_eq!([4, 5].map(both), [(Some("Cloth"), Some("Blue")); 2]);
    assert_eq!([6, 7].map(both), [(Some("Cloth"), None); 2]);
}

#[test]
fn text_binary_and_external_buffers_hold_the_same_mesh() {
    let folder = TempDir::new().unwrap();
    let embedded = mesh(&square()).unwrap();
    assert_eq!((embedded.positions.len(), embedded.triangles.len()), (4, 2));
    assert_eq!(embedded.positions[2], DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(embedded.coordinates[1], [1.0, 1.0]);
    assert_eq!(embedded.materials[0].albedo, [1.0; 3]);
    assert!((signed_area(&embedded) - 1.0).abs() < 1e-12);

    let mut inside = square();
    inside["buffers"][0].as_object_mut().unwrap().remove("uri");
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, glb(&inside, Some(&square_bytes()))).unwrap();
    assert_eq!(GltfScene::load(&path).unwrap().mesh(None, MANY).unwrap().positions, embedded.positions);

    let mut beside = square();
    beside["buffers"][0]["uri"] = json!("my%20buffer.bin");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, beside.to_string()).unwrap();
    assert!(matches!(GltfScene::load(&path), Err(Error::File { .. })));
    std::fs::write(folder.path().join("my buffer.bin"), square_bytes()).unwrap();
    assert_eq!(GltfScene::load(&path).unwrap().mesh(None, MANY).unwrap().triangles, embedded.triangles);
}

#[test]
fn nodes_carry_their_parents_transform_and_mirrors_keep_the_outside_out() {
    let mut file = square();
    // Turned by 90 degrees around z, then scaled by 2, then moved; and a mirrored copy, by a matrix.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    file["nodes"] = json!([
        {"name": "Parent", "translation": [10, 20, 30], "scale": [2, 2, 2], "children": [1]},
        {"name": "Child", "rotation": [0, 0, half, half], "mesh": 0},
        {"name": "Mirror", "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 5,0,0,1], "mesh": 0},
        {"name": "Elsewhere", "mesh": 0},
    ]);
    file["scenes"] = json!([{"nodes": [0, 2]}]);
    let scene = load(&file).unwrap();
    let child = scene.mesh(Some("Child"), MANY).unwrap();
    assert!((child.positions[1] - DVec3::new(10.0, 22.0, 30.0)).length() < 1e-6);
    assert!((child.positions[3] - DVec3::new(8.0, 20.0, 30.0)).length() < 1e-6);
    assert_eq!(scene.mesh(Some("Parent"), MANY).unwrap().positions, child.positions);
    let mirror = scene.mesh(Some("Mirror"), MANY).unwrap();
    assert_eq!(mirror.positions[1], DVec3::new(4.0, 0.0, 0.0));
    assert!((signed_area(&mirror) - 1.0).abs() < 1e-12);
    assert_eq!(scene.mesh(None, MANY).unwrap().triangles.len(), 4);
    assert_eq!(scene.mesh(Some("Elsewhere"), MANY).unwrap().triangles.len(), 2);
}

#[test]
fn strips_fans_and_lists_cover_the_same_square() {
    for (mode, indices) in [(4, [0, 1, 2, 0, 2, 3]), (5, [0, 1, 3, 2, 2, 2]), (6, [0, 1, 2, 3, 3, 3])] {
        let mut bytes = square_bytes();
        bytes.truncate(80);
        bytes.extend(indices.iter().flat_map(|i: &u16| i.to_le_bytes()));
        let mut file = square();
        file["buffers"][0]["uri"] = json!(data_uri(&bytes));
        file["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let mesh = mesh(&file).unwrap();
        assert!((signed_area(&mesh) - 1.0).abs() < 1e-12, "mode {mode}");
        assert!(Geometry::new(mesh).is_ok());
    }
    let mut lines = square();
    lines["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(message(mesh(&lines)).contains("no triangles"));
}

#[test]
fn quantized_and_sparse_positions_are_read() {
    let mut file = square();
    let quantized: Vec<u8> = [0, 0, 0, 0, 32767, 0, 0, 0, 32767, 32767, 0, 0, 0, 32767, 0, 0]
        .iter()
        .flat_map(|i: &i16| i.to_le_bytes())
        .collect();
    // Vertex 2 is moved by a sparse accessor; positions are 8 bytes apart.
    let mut bytes = quantized.clone();
    bytes.extend([2, 0, 0, 0]);
    bytes.extend([-32767_i16, 16384, 0, 0].iter().flat_map(|i| i.to_le_bytes()));
    file["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    file["buffers"].as_array_mut().unwrap().push(json!({"byteLength": bytes.len(), "uri": data_uri(&bytes)}));
    let views = file["bufferViews"].as_array_mut().unwrap();
    views[0] = json!({"buffer": 1, "byteLength": 32, "byteStride": 8});
    views.push(json!({"buffer": 1, "byteOffset": 32, "byteLength": 4}));
    views.push(json!({"buffer": 1, "byteOffset": 36, "byteLength": 8}));
    file["accessors"][0] = json!({"bufferView": 0, "componentType": 5122, "normalized": true, "count": 4, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 4}}});
    let positions = mesh(&file).unwrap().positions;
    assert_eq!(positions[1], DVec3::X);
    assert!((positions[2] - DVec3::new(-1.0, 0.5, 0.0)).length() < 1e-4);
    // Sabotage: the same without the sparse part is the square.
    file["accessors"][0].as_object_mut().unwrap().remove("sparse");
    assert_eq!(mesh(&file).unwrap().positions[2], DVec3::new(1.0, 1.0, 0.0));
}

fn png(pixels: &[[u8; 4]]) -> String {
    let bytes = pixels.concat();
    let picture = image::RgbaImage::from_raw(pixels.len() as u32, 1, bytes).unwrap();
    let mut file = Cursor::new(Vec::new());
    picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
    data_uri(file.get_ref())
}

fn textured(mode: &str, texture: Value, pixels: &[[u8; 4]]) -> Value {
    let mut file = square();
    file["images"] = json!([{"uri": png(pixels), "mimeType": "image/png"}]);
    file["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
    file["textures"] = json!([{"source": 0, "sampler": 0}]);
    file["materials"] = json!([{"alphaMode": mode,
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": texture}}]);
    file["meshes"][0]["primitives"][0]["material"] = json!(0);
    file
}

const HALF_LEAF: [[u8; 4]; 2] = [[0, 0, 0, 0], [255, 255, 0, 255]];

#[test]
fn leaf_cards_have_holes_where_alpha_is_low() {
    let file = textured("MASK", json!({"index": 0}), &HALF_LEAF);
    let leaf = mesh(&file).unwrap();
    let mask = leaf.materials[0].mask.as_ref().unwrap();
    assert_eq!((mask.size, mask.cutoff, mask.wrap), ([2, 1], 0.5, [Wrap::Clamp, Wrap::Mirror]));
    // Only the pixels that are there count for the mean colour.
    assert_eq!(leaf.materials[0].albedo, [0.5, 1.0, 0.0]);
    let hits = |file: &Value, x: f64| {
        let geometry = Geometry::new(mesh(file).unwrap()).unwrap();
        geometry.blocks(&Ray { origin: DVec3::new(x, 0.4, 1.0), direction: DVec3::NEG_Z }, 2.0)
    };
    assert!(!hits(&file, 0.2) && hits(&file, 0.8));
    let blended = textured("BLEND", json!({"index": 0}), &HALF_LEAF);
    assert!(
        !hits(&blended, 0.2) && hits(&blended, 0.8),
        "what covers all is solid, and what covers nothing is not there"
    );
    assert!(hits(&textured("OPAQUE", json!({"index": 0}), &HALF_LEAF), 0.2));
    // The factor's alpha counts: 0.4 < 0.5 everywhere, so that nothing is left.
    let mut faint = file.clone();
    faint["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(0.4);
    assert!(message(mesh(&faint)).contains("no triangles"));
    // Without its coordinates a texture is no mask.
    let mut plain = file.clone();
    plain["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    assert!(hits(&plain, 0.2));
    // And the picture mirrored by KHR_texture_transform.
    let mirrored =
        json!({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [1, 0], "scale": [-1, 1]}}});
    let mirrored = textured("MASK", mirrored, &HALF_LEAF);
    assert!(hits(&mirrored, 0.2) && !hits(&mirrored, 0.8));
}

#[test]
fn the_example_of_the_texture_transform_specification_selects_the_lower_left_quadrant() {
    let turned = json!({"index": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0, 1], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 0.5]}}});
    for [u, v] in mesh(&textured("OPAQUE", turned, &HALF_LEAF)).unwrap().coordinates {
        assert!((-1e-6..=0.500001).contains(&u) && (0.499999..=1.000001).contains(&v), "{u}, {v}");
    }
}

#[test]
fn a_mean_colour_is_linear() {
    let file = textured("OPAQUE", json!({"index": 0}), &[[188, 188, 188, 255]; 3]);
    let [red, green, _] = mesh(&file).unwrap().materials[0].albedo;
    assert!((red - 0.25).abs() < 2e-3 && (green - 0.5).abs() < 4e-3, "{red}, {green}");
}

#[test]
fn a_grey_picture_has_the_mean_of_the_same_in_colour() {
    let bytes = [0_u8, 51, 128, 255];
    let colored = textured("OPAQUE", json!({"index": 0}), &bytes.map(|byte| [byte, byte, byte, 255]));
    let mut file = Cursor::new(Vec::new());
    image::GrayImage::from_raw(4, 1, bytes.to_vec())
        .unwrap()
        .write_to(&mut file, image::ImageFormat::Png)
        .unwrap();
    let mut grey = colored.clone();
    grey["images"][0]["uri"] = json!(data_uri(file.get_ref()));
    let [grey, colored] = [grey, colored].map(|file| mesh(&file).unwrap().materials[0].albedo);
    assert!((0..3).all(|c| (grey[c] - colored[c]).abs() < 1e-6), "{grey:?} {colored:?}");
    assert!(colored[0] < 1.0);
}

fn with_camera_and_suns() -> Value {
    let mut file = square();
    file["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1, "aspectRatio": 1.5}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9}},
    ]);
    file["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    file["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "directional", "color": [1, 0.5, 0.25], "intensity": 8}, {"type": "point"}]}});
    let light = |index: usize| json!({"KHR_lights_punctual": {"light": index}});
    file["nodes"] = json!([
        {"name": "Square", "mesh": 0},
        {"name": "Camera", "translation": [0, 1, 5], "children": [2]},
        {"name": "Camera_Orientation", "camera": 0},
        {"name": "Plan", "camera": 1},
        // Looks along −y.
        {"name": "Sun", "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0, 0, std::f64::consts::FRAC_1_SQRT_2],
            "scale": [3, 3, 3], "extensions": light(0)},
        {"name": "Lamp", "extensions": light(1)},
    ]);
    file
}

#[test]
fn cameras_and_suns_are_found_by_their_nodes() {
    let file = with_camera_and_suns();
    let scene = load(&file).unwrap();
    let camera = scene.camera("Camera").unwrap();
    assert_eq!(camera, scene.camera("Camera_Orientation").unwrap());
    assert_eq!(camera.world_from_camera.translation, DVec3::new(0.0, 1.0, 5.0));
    assert!((camera.fov - 28.6479).abs() < 1e-4);
    assert!(message(scene.camera("Plan")).contains("orthographic"));
    let (direction, radiance) = scene.sun(None).unwrap();
    assert!((direction - DVec3::NEG_Y).length() < 1e-6);
    assert_eq!(radiance, [8.0, 4.0, 2.0]);
    assert_eq!(scene.sun(Some("Sun")).unwrap().1, radiance);
    assert_eq!(scene.sun_names(), ["Sun"]);

    let mut two = file.clone();
    two["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    assert!(message(load(&two).unwrap().sun(None)).contains("`Square`, `Sun`"));
    assert!(message(load(&square()).unwrap().sun(None)).contains("no directional light"));
}

#[test]
fn an_unknown_name_is_answered_with_the_nearest_ones_first() {
    let scene = load(&with_camera_and_suns()).unwrap();
    assert!(message(scene.mesh(Some("squar"), MANY)).contains("there are `Square`"));
    assert!(message(scene.sun(Some("Lamp"))).contains("there are `Sun`"));
    assert!(message(scene.camera("pan")).contains("there are `Plan`, `Camera_Orientation`"));
}

#[test]
fn broken_files_are_errors_with_a_reason() {
    type Case = (&'static str, fn(&mut Value));
    let cases: Vec<Case> = vec![
        ("KHR_draco", |f| f["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
        ("version is 1.0", |f| f["asset"]["version"] = json!("1.0")),
        ("cycle", |f| f["nodes"] = json!([{"mesh": 0}, {"children": [2]}, {"children": [1]}])),
        ("two parents", |f| f["nodes"] = json!([{"children": [1, 1]}, {"mesh": 0}])),
        ("unknown child", |f| f["nodes"][0]["children"] = json!([9])),
        ("unknown node", |f| f["scenes"][0]["nodes"] = json!([4])),
        ("default scene", |f| f["scene"] = json!(7)),
        ("mesh 3", |f| f["nodes"][0]["mesh"] = json!(3)),
        ("accessor 8", |f| f["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(8)),
        ("vertex 3 of 3", |f| f["accessors"][0]["count"] = json!(3)),
        ("outside of its buffer view", |f| f["accessors"][0]["count"] = json!(5)),
        ("outside of its buffer view", |f| f["accessors"][0]["count"] = json!(u64::MAX)),
        ("outside of its buffer view", |f| f["accessors"][0]["byteOffset"] = json!(u64::MAX)),
        ("outside of its buffer", |f| f["bufferViews"][0]["byteOffset"] = json!(u64::MAX)),
        ("overlap", |f| f["bufferViews"][0]["byteStride"] = json!(4)),
        ("components", |f| f["accessors"][0]["type"] = json!("VEC2")),
        ("unknown type", |f| f["accessors"][0]["componentType"] = json!(5130)),
        ("unknown mode", |f| f["meshes"][0]["primitives"][0]["mode"] = json!(9)),
        ("instead of 1000", |f| f["buffers"][0]["byteLength"] = json!(1000)),
        ("base64", |f| f["buffers"][0]["uri"] = json!("data:text/plain,hello")),
        ("only files beside it", |f| f["buffers"][0]["uri"] = json!("https://example.org/a.bin")),
        ("node 0 is not finite", |f| f["nodes"][0]["translation"] = json!([1e300, 0, 0])),
        ("material 5", |f| f["meshes"][0]["primitives"][0]["material"] = json!(5)),
    ];
    for (expected, breaks) in cases {
        let mut file = square();
        breaks(&mut file);
        let message = message(mesh(&file));
        assert!(message.contains(expected), "`{expected}` is not in `{message}`");
    }
}

#[test]
fn truncated_files_are_errors_and_never_panics() {
    let folder = TempDir::new().unwrap();
    let mut inside = square();
    inside["buffers"][0].as_object_mut().unwrap().remove("uri");
    let whole = glb(&inside, Some(&square_bytes()));
    let path = folder.path().join("cut.glb");
    for length in (0..whole.len()).step_by(7).chain(0..24) {
        std::fs::write(&path, &whole[..length]).unwrap();
        assert!(GltfScene::load(&path).is_err(), "{length} bytes");
    }
    for length in 0..12_u32 {
        let mut short = whole.clone();
        short[8..12].copy_from_slice(&length.to_le_bytes());
        std::fs::write(&path, short).unwrap();
        assert!(GltfScene::load(&path).is_err());
    }
    std::fs::write(&path, glb(&inside, None)).unwrap();
    assert!(message(GltfScene::load(&path)).contains("binary chunk"));
    assert!(matches!(GltfScene::load(folder.path()), Err(Error::File { .. })));
    assert!(matches!(GltfScene::load(&folder.path().join("none.gltf")), Err(Error::File { .. })));
}

#[test]
fn damaged_bytes_never_panic() {
    let file = textured("MASK", json!({"index": 0}), &HALF_LEAF).to_string().into_bytes();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("damaged.gltf");
    let mut seed = 1_u64;
    for _ in 0..1500 {
        let mut damaged = file.clone();
        for _ in 0..2 {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let at = (seed >> 33) as usize % damaged.len();
            damaged[at] = b"0123456789-[]{},e."[(seed >> 20) as usize % 18];
        }
        std::fs::write(&path, &damaged).unwrap();
        if let Ok(mesh) = GltfScene::load(&path).and_then(|scene| scene.mesh(None, MANY)) {
            let _ = Geometry::new(mesh);
        }
    }
}

/// Adds bytes to a file as a buffer of their own, with an accessor over them; gives the accessor.
fn with_accessor(file: &mut Value, bytes: &[u8], accessor: Value) -> usize {
    let push = |file: &mut Value, name: &str, value: Value| {
        let all = file[name].as_array_mut().unwrap();
        all.push(value);
        all.len() - 1
    };
    let buffer = push(file, "buffers", json!({"byteLength": bytes.len(), "uri": data_uri(bytes)}));
    let view = push(file, "bufferViews", json!({"buffer": buffer, "byteLength": bytes.len()}));
    let mut accessor = accessor;
    accessor["bufferView"] = json!(view);
    push(file, "accessors", accessor)
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn warnings(file: &Value) -> Vec<String> {
    let scene = load(file).unwrap();
    scene.mesh(None, MANY).unwrap();
    scene.mesh(None, MANY).unwrap();
    scene.file.warnings()
}

#[test]
fn an_instanced_mesh_is_there_once_for_each_place() {
    let mut file = square();
    file["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    file["nodes"][0]["translation"] = json!([10, 0, 0]);
    let moves = floats(&[0., 0., 0., 0., 0., 5., 0., 0., 9.]);
    let moves = with_accessor(&mut file, &moves, json!({"componentType": 5126, "count": 3, "type": "VEC3"}));
    let sizes = floats(&[1., 1., 1., 2., 2., 2., 1., -1., 1.]);
    let sizes = with_accessor(&mut file, &sizes, json!({"componentType": 5126, "count": 3, "type": "VEC3"}));
    let node = |attributes: Value| json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    file["nodes"][0]["extensions"] = node(json!({"TRANSLATION": moves, "SCALE": sizes, "_ID": 77}));
    let three = mesh(&file).unwrap();
    three.validate().unwrap();
    assert_eq!((three.triangles.len(), three.positions.len(), three.objects.len()), (6, 12, 1));
    assert_eq!(
        [0, 4, 6, 8].map(|i| three.positions[i]),
        [DVec3::new(10., 0., 0.), DVec3::new(10., 0., 5.), DVec3::new(12., 2., 5.), DVec3::new(10., 0., 9.)]
    );
    // The mirrored copy keeps its outside out: areas of 1, 4 and 1.
    assert!((signed_area(&three) - 6.0).abs() < 1e-9);
    // Turned by 90 degrees around z, as numbers of each kind that is allowed.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let bytes: Vec<u8> = [0, 0, 90, 90].map(|i: i8| i as u8).to_vec();
    let words: Vec<u8> = [0, 0, 23170, 23170].iter().flat_map(|i: &i16| i.to_le_bytes()).collect();
    let kinds = [(5126, false, floats(&[0., 0., half, half])), (5120, true, bytes), (5122, true, words)];
    for (kind, normalized, bytes) in kinds {
        let mut turned = file.clone();
        let accessor = json!({"componentType": kind, "normalized": normalized, "count": 1, "type": "VEC4"});
        let rotations = with_accessor(&mut turned, &bytes, accessor);
        turned["nodes"][0]["extensions"] = node(json!({"ROTATION": rotations}));
        let corner = mesh(&turned).unwrap().positions[1];
        assert!((corner - DVec3::new(10., 1., 0.)).length() < 1e-4, "{kind}: {corner}");
        turned["nodes"][0]["extensions"] = node(json!({"ROTATION": rotations, "SCALE": sizes}));
        assert!(message(mesh(&turned)).contains("instances with 1 and with 3 places"));
    }
    file["nodes"][0]["extensions"] = node(json!({"TRANSLATION": -1}));
    assert!(message(mesh(&file)).contains("-1 as their TRANSLATION"));
}

#[test]
fn triangles_are_counted_before_any_is_made() {
    let mut file = square();
    file["nodes"] = json!([{"mesh": 0}, {"mesh": 0}]);
    file["scenes"] = json!([{"nodes": [0, 1]}]);
    let scene = load(&file).unwrap();
    assert_eq!(scene.mesh(None, 4).unwrap().triangles.len(), 4);
    let refused = scene.mesh(None, 3);
    assert!(matches!(refused, Err(Error::TooLarge { .. })));
    assert!(message(refused).contains("4 triangles"));
    // A million nodes' worth of instances from a few bytes: an accessor without data, all of whose places are zero.
    file["accessors"]
        .as_array_mut()
        .unwrap()
        .push(json!({"componentType": 5126, "count": 1_u64 << 40, "type": "VEC3"}));
    file["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 3}}});
    assert!(matches!(mesh(&file), Err(Error::TooLarge { .. })));
    // And as many vertices, of which one triangle is drawn.
    let mut sparse = square();
    sparse["accessors"][0] = json!({"componentType": 5126, "count": 1_u64 << 40, "type": "VEC3", "sparse": {
        "count": 1, "indices": {"bufferView": 2, "byteOffset": 2, "componentType": 5123},
        "values": {"bufferView": 0, "byteOffset": 12}}});
    sparse["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0});
    let drawn = mesh(&sparse).unwrap();
    assert_eq!((drawn.triangles.len(), drawn.positions.len()), (2, 6));
    assert_eq!([0, 1, 2].map(|i| drawn.positions[i]), [DVec3::ZERO, DVec3::X, DVec3::ZERO]);
}

#[test]
fn meshes_without_data_are_left_out_with_a_warning() {
    let mut file = square();
    let primitives = file["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(json!({"attributes": {"POSITION": 3}, "indices": 2}));
    primitives.push(json!({"attributes": {"POSITION": 0}, "indices": 4}));
    let accessors = file["accessors"].as_array_mut().unwrap();
    accessors.push(json!({"componentType": 5126, "count": 1_u64 << 40, "type": "VEC3"}));
    accessors.push(json!({"componentType": 5125, "count": 1_u64 << 40, "type": "SCALAR"}));
    assert_eq!(mesh(&file).unwrap().triangles.len(), 2);
    assert_eq!(warnings(&file), ["meshes whose vertices are all zero are left out"]);
    let draco = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}});
    file["meshes"][0]["primitives"][1]["extensions"] = draco.clone();
    let refused = message(mesh(&file));
    assert!(refused.contains("compressed") && refused.contains("gltf-transform copy"), "{refused}");
    // What is there unpacked as well is read.
    let mut both = square();
    both["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    both["meshes"][0]["primitives"][0]["extensions"] = draco;
    assert_eq!(mesh(&both).unwrap().triangles.len(), 2);
    assert_eq!(warnings(&both), [""; 0]);
}

#[test]
fn quantized_positions_and_coordinates_of_each_kind_are_read() {
    // Component type, whether it is normalized, and the number that stands for 1.
    let kinds = [(5120, true, 127), (5121, true, 255), (5122, true, 32767), (5123, true, 65535)];
    for (kind, normalized, one) in kinds.into_iter().chain(kinds.map(|(kind, ..)| (kind, false, 1))) {
        let packed = |values: &[u16]| -> Vec<u8> {
            let size = if kind < 5122 { 1 } else { 2 };
            values.iter().flat_map(|value| (value * one).to_le_bytes()[..size].to_vec()).collect()
        };
        let mut file = square();
        file["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let accessor =
            |of: &str| json!({"componentType": kind, "normalized": normalized, "count": 4, "type": of});
        let positions = packed(&[0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]);
        let positions = with_accessor(&mut file, &positions, accessor("VEC3"));
        let coordinates = packed(&[0, 1, 1, 1, 1, 0, 0, 0]);
        let coordinates = with_accessor(&mut file, &coordinates, accessor("VEC2"));
        file["meshes"][0]["primitives"][0]["attributes"] =
            json!({"POSITION": positions, "TEXCOORD_0": coordinates});
        let (read, plain) = (mesh(&file).unwrap(), mesh(&square()).unwrap());
        assert_eq!(read.positions, plain.positions, "{kind}");
        assert_eq!(read.coordinates, plain.coordinates, "{kind}");
    }
}

#[test]
fn sparse_numbers_need_increasing_places() {
    for (places, reads) in [([0_u16, 2], true), ([2, 0], false), ([2, 2], false), ([0, 4], false)] {
        let mut file = square();
        let bytes: Vec<u8> = places.iter().flat_map(|place| place.to_le_bytes()).collect();
        with_accessor(&mut file, &bytes, json!({"componentType": 5123, "count": 2, "type": "SCALAR"}));
        file["accessors"][0]["sparse"] = json!({"count": 2, "indices": {"bufferView": 3, "componentType": 5123},
            "values": {"bufferView": 0, "byteOffset": 12}});
        match mesh(&file) {
            Ok(mesh) => assert!(reads && mesh.positions[2] == DVec3::new(1., 1., 0.)),
            Err(error) => assert!(!reads && error.to_string().contains("do not increase"), "{error}"),
        }
    }
}

#[test]
fn extensions_are_refused_by_what_they_change() {
    let with = |list: &str, name: &str| {
        let mut file = square();
        file[list] = json!([name]);
        file
    };
    for name in
        ["KHR_materials_pbrSpecularGlossiness", "KHR_animation_pointer", "EXT_texture_webp", "MSFT_lod"]
    {
        assert_eq!(warnings(&with("extensionsRequired", name)), [""; 0], "{name}");
        assert_eq!(warnings(&with("extensionsUsed", name)), [""; 0], "{name}");
    }
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let refused = message(load(&with("extensionsRequired", name)));
        assert!(refused.contains(name) && refused.contains("Compression unticked"), "{refused}");
        assert_eq!(warnings(&with("extensionsUsed", name)), [""; 0], "{name}");
    }
    let refused = message(load(&with("extensionsRequired", "ACME_holes")));
    assert!(refused.contains("ACME_holes") && !refused.contains("ompress"), "{refused}");
    let told = warnings(&with("extensionsUsed", "ACME_holes"));
    assert!(told.len() == 1 && told[0].contains("ACME_holes is not read"), "{told:?}");
}

#[test]
fn hidden_nodes_and_all_below_them_are_left_out() {
    let mut file = square();
    file["nodes"] = json!([
        {"mesh": 0, "children": [1], "extensions": {"KHR_node_visibility": {"visible": false}}},
        {"mesh": 0, "children": [2], "extensions": {"KHR_node_visibility": {"visible": true}}},
        {"mesh": 0},
        {"mesh": 0, "extensions": {"KHR_node_visibility": {}}},
    ]);
    file["scenes"] = json!([{"nodes": [0, 3]}]);
    file["extensionsRequired"] = json!(["KHR_node_visibility"]);
    assert_eq!(mesh(&file).unwrap().triangles.len(), 2);
    assert_eq!(warnings(&file), ["nodes that are hidden (KHR_node_visibility) are left out"]);
}

#[test]
fn skins_and_morph_targets_are_told_once() {
    let mut file = square();
    file["skins"] = json!([{}]);
    file["nodes"] = json!([{"mesh": 0, "skin": 0}, {"mesh": 0, "skin": 0}]);
    file["scenes"] = json!([{"nodes": [0, 1]}]);
    file["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 0, "TEXCOORD_0": "of any name"}]);
    let said = warnings(&file);
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].contains("morph targets") && said[1].contains("skins"));
}

#[test]
fn what_nobody_reads_makes_no_file_unreadable() {
    let mut file = with_camera_and_suns();
    file["animations"] =
        json!([{"channels": [{"sampler": 0, "target": {"path": "pointer"}}], "samplers": 7}]);
    file["skins"] = json!("none");
    file["extras"] = json!("a note");
    file["nodes"][0]["extras"] = json!([1, 2]);
    file["scenes"].as_array_mut().unwrap().push(json!({"name": "empty"}));
    file["extensions"]["KHR_lights_punctual"]["lights"][0]["extensions"] = json!({"ACME_sun": {"size": 3}});
    file["materials"] = json!([{"normalTexture": {}, "occlusionTexture": 4, "emissiveFactor": "bright",
        "pbrMetallicRoughness": {"metallicRoughnessTexture": [], "roughnessFactor": null}}]);
    let scene = load(&file).unwrap();
    assert_eq!(scene.mesh(None, MANY).unwrap().triangles.len(), 2);
    assert_eq!(scene.sun(None).unwrap().1, [8.0, 4.0, 2.0]);
    // An empty scene is one without triangles, and a broken file says where it is broken.
    file["scene"] = json!(1);
    assert!(message(mesh(&file)).contains("the scene has no triangles"));
    file["accessors"][1].as_object_mut().unwrap().remove("count");
    assert!(message(mesh(&file)).contains("accessors[1]"), "{}", message(mesh(&file)));
    // A byte order mark at its beginning is none of its text.
    let (_folder, path) = written(&square());
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("\u{feff}{text}")).unwrap();
    assert_eq!(GltfScene::load(&path).unwrap().mesh(None, MANY).unwrap().triangles.len(), 2);
}

#[test]
fn names_that_are_equally_near_come_in_the_order_of_the_file() {
    let mut file = square();
    file["nodes"] = json!([{"name": "Wall"}, {"name": "Ball"}, {"name": "Hall"}, {"name": "Ball"}]);
    file["scenes"] = json!([{"nodes": [0, 1, 2, 3]}]);
    let told = message(load(&file).unwrap().mesh(Some("Call"), MANY));
    assert!(told.ends_with("there are `Wall`, `Ball`, `Hall`"), "{told}");
}

#[test]
fn the_older_material_model_has_its_own_colour_and_alpha() {
    let mut file = textured("MASK", json!({"index": 0}), &HALF_LEAF);
    file["materials"][0] = json!({"alphaMode": "MASK", "extensions": {"KHR_materials_pbrSpecularGlossiness":
        {"diffuseFactor": [0.5, 1, 1, 1], "diffuseTexture": {"index": 0}, "specularFactor": "any"}}});
    let leaf = mesh(&file).unwrap();
    assert_eq!(leaf.materials[0].albedo, [0.5, 1.0, 0.0]);
    assert_eq!(leaf.materials[0].mask.as_ref().unwrap().alpha, [0, 255]);
    file["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"]["diffuseFactor"][3] =
        json!(0.4);
    assert!(message(mesh(&file)).contains("no triangles"));
}

fn encoded(pixels: &[[u8; 4]], format: image::ImageFormat) -> String {
    let picture = image::RgbaImage::from_raw(pixels.len() as u32, 1, pixels.concat()).unwrap();
    let mut file = Cursor::new(Vec::new());
    picture.write_to(&mut file, format).unwrap();
    data_uri(file.get_ref())
}

#[test]
fn webp_pictures_are_read_where_there_is_no_other() {
    let mut file = textured("MASK", json!({"index": 0}), &HALF_LEAF);
    let plain = mesh(&file).unwrap();
    let webp = encoded(&[[9, 9, 9, 255], [9, 9, 9, 0]], image::ImageFormat::WebP);
    file["images"].as_array_mut().unwrap().push(json!({"uri": webp, "mimeType": "image/webp"}));
    file["extensionsRequired"] = json!(["EXT_texture_webp"]);
    // The other picture comes first.
    file["textures"][0] =
        json!({"source": 0, "sampler": 0, "extensions": {"EXT_texture_webp": {"source": 1}}});
    assert_eq!(mesh(&file).unwrap().materials, plain.materials);
    file["textures"][0].as_object_mut().unwrap().remove("source");
    assert_eq!(mesh(&file).unwrap().materials[0].mask.as_ref().unwrap().alpha, [255, 0]);
    // A picture of another kind is needed by a mask alone.
    file["textures"][0]["extensions"] = json!({"KHR_texture_basisu": {"source": 1}});
    assert!(message(mesh(&file)).contains("export the textures as PNG"));
    file["materials"][0]["alphaMode"] = json!("OPAQUE");
    assert_eq!(mesh(&file).unwrap().materials[0].albedo, [0.5, 1.0, 1.0]);
    assert!(warnings(&file)[0].contains("no picture that is read"));
}

#[test]
fn a_picture_is_decoded_once_a_file() {
    let mut file = textured("MASK", json!({"index": 0}), &HALF_LEAF);
    let mut material = file["materials"][0].clone();
    material["alphaCutoff"] = json!(0.25);
    let materials = file["materials"].as_array_mut().unwrap();
    materials.push(materials[0].clone());
    materials.push(material);
    let view = with_picture_view(&mut file);
    file["images"] = json!([{"bufferView": view, "mimeType": "image/png"}, {"bufferView": view}]);
    file["textures"] = json!([{"source": 0}, {"source": 1}]);
    file["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = json!(1);
    let primitive = file["meshes"][0]["primitives"][0].clone();
    for material in 1..3 {
        let mut primitive = primitive.clone();
        primitive["material"] = json!(material);
        file["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    let scene = load(&file).unwrap();
    let masks: Vec<_> =
        scene.mesh(None, MANY).unwrap().materials.into_iter().map(|m| m.mask.unwrap()).collect();
    assert_eq!(scene.mesh(None, MANY).unwrap().materials.len(), 3);
    assert_eq!(scene.pictures.decoded_bytes(), 8);
    assert!(std::sync::Arc::ptr_eq(&masks[0], &masks[1]));
    assert_eq!((masks[0].cutoff, masks[2].cutoff), (0.5, 0.25));
}

/// A buffer view that holds a picture of two pixels.
fn with_picture_view(file: &mut Value) -> usize {
    let picture = png(&HALF_LEAF);
    file["buffers"].as_array_mut().unwrap().push(json!({"byteLength": 60, "uri": picture}));
    let bytes = load(&json!({"asset": {"version": "2.0"}})).unwrap().file.read_uri(&picture).unwrap().len();
    file["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 1, "byteLength": bytes}));
    3
}

#[test]
fn too_large_a_picture_is_refused_by_its_header() {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let wide = vec![255; 16385];
    image::ImageEncoder::write_image(encoder, &wide, 16385, 1, image::ExtendedColorType::L8).unwrap();
    let mut file = textured("OPAQUE", json!({"index": 0}), &HALF_LEAF);
    // Nothing but the header is there.
    file["images"][0]["uri"] = json!(data_uri(&bytes[..60]));
    let refused = mesh(&file);
    assert!(matches!(refused, Err(Error::TooLarge { .. })));
    assert!(message(refused).contains("16385 by 1 pixels"));
}

#[test]
fn what_is_not_there_is_told_and_what_is_glass_lets_light_through() {
    let mut file = square();
    let transmission = |factor: f64| json!({"KHR_materials_transmission": {"transmissionFactor": factor}});
    let red = json!({"baseColorFactor": [1, 0.5, 0, 1]});
    file["materials"] = json!([
        {"name": "Air", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}},
        {"name": "Faint", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]}},
        {"name": "Film", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 0.5]}},
        {"name": "Glass", "pbrMetallicRoughness": red, "extensions": transmission(0.5)},
        {"name": "Dull", "pbrMetallicRoughness": red, "extensions": {"KHR_materials_transmission": {}}},
        {"name": "Both", "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 0.5]},
         "extensions": transmission(1.0)},
        {"name": "Thick", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
         "KHR_materials_volume": {"thicknessFactor": 2, "attenuationDistance": 1, "attenuationColor": [1, 0.5, 0.1]}}},
    ]);
    let primitive = |material| json!({"attributes": {"POSITION": 0}, "indices": 2, "material": material});
    file["meshes"][0]["primitives"] = (0..7).map(primitive).collect();
    let glass = mesh(&file).unwrap();
    assert_eq!(glass.triangles.len(), 12);
    let passes = |name: &str| {
        let material =
            glass.materials.iter().find(|material| material.name.as_deref() == Some(name)).unwrap();
        material.glass.as_ref().map(|glass| glass.transmittance)
    };
    for (name, expected) in [
        ("Air", None),
        ("Faint", Some([0.75; 3])),
        ("Film", Some([0.5, 0.375, 0.25])),
        ("Glass", Some([0.5, 0.25, 0.0])),
        ("Dull", None),
        ("Both", Some([1.0, 0.625, 0.25])),
        ("Thick", Some([1.0, 0.25, 0.01])),
    ] {
        let passes = passes(name);
        let is_near = passes.zip(expected).is_none_or(|(a, b)| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-6));
        assert!(is_near && passes.is_some() == expected.is_some(), "{name}: {passes:?}");
    }
    assert_eq!(
        warnings(&file),
        ["2 of its triangles left out, because the alpha of their material is below its cut-off: `Air`"]
    );
    file["meshes"][0]["primitives"] = json!([primitive(0)]);
    let refused = message(mesh(&file));
    assert!(refused.contains("below its cut-off (2 left out)"), "{refused}");
    file["materials"][3]["extensions"] = transmission(1.5);
    file["meshes"][0]["primitives"] = json!([primitive(3)]);
    assert!(message(mesh(&file)).contains("the transmission of material Glass is 1.5"));
}

#[test]
fn pictures_of_glass_say_what_passes_from_place_to_place() {
    let geometry = |file: &Value| Geometry::new(mesh(file).unwrap()).unwrap();
    let passes = |geometry: &Geometry, x: f64| {
        geometry.transmittance(&Ray { origin: DVec3::new(x, 0.4, 1.0), direction: DVec3::NEG_Z }, 2.0)
    };
    // Lead and red glass: the factor of the base colour is 0.5 in red.
    let mut file = textured("OPAQUE", json!({"index": 0}), &[[0, 0, 0, 255], [255, 0, 0, 255]]);
    file["materials"][0]["extensions"] = json!({"KHR_materials_transmission": {"transmissionFactor": 0.8}});
    let window = geometry(&file);
    assert_eq!(passes(&window, 0.1), [0.0; 3]);
    let [red, green, blue] = passes(&window, 0.9);
    // A step of the roots of shares is 1/255.
    assert!((red - 0.4).abs() < 3e-3 && green == 0.0 && blue == 0.0, "{red}");
    // The transmission may have a picture of its own, of another size.
    file["images"]
        .as_array_mut()
        .unwrap()
        .push(json!({"uri": png(&[[255, 0, 0, 255], [255, 9, 9, 255], [0, 0, 0, 255], [0, 0, 0, 255]])}));
    file["textures"].as_array_mut().unwrap().push(json!({"source": 1, "sampler": 0}));
    file["materials"][0]["extensions"]["KHR_materials_transmission"]["transmissionTexture"] =
        json!({"index": 1});
    assert_eq!(passes(&geometry(&file), 0.9), [0.0; 3], "there it lets nothing through");
    // One that lies otherwise counts by its mean.
    let turned = json!({"index": 1, "extensions": {"KHR_texture_transform": {"rotation": 1}}});
    file["materials"][0]["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = turned;
    let [red, ..] = passes(&geometry(&file), 0.9);
    assert!((red - 0.2).abs() < 3e-3, "{red}");
    assert!(warnings(&file).iter().any(|warning| warning.contains("lies otherwise")));
    // Without coordinates it is as its colour on the mean.
    let mut plain = textured("OPAQUE", json!({"index": 0}), &[[255, 0, 0, 255]; 2]);
    plain["materials"][0]["extensions"] = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    plain["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    assert_eq!(passes(&geometry(&plain), 0.4), [0.5, 0.0, 0.0]);
}
