//! `cargo run --bin seeds`: makes the corpus. What is named `read_…` must be read, what is named `refused_…` must be refused.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use unscatter::io::vdb::{self, Compression, WriteOptions};
use unscatter::io::volume::{self, Format};
use unscatter::io::{Checkpoint, image};
use unscatter::scene::{Image, Samples, Volume, VoxelGrid};
use unscatter_fuzz::formats::{FINGERPRINT, root};

/// A file of the corpus, whose folder is made.
fn seed(format: &str, name: &str) -> PathBuf {
    file("corpus", format, name)
}

/// A file that others of the format name.
fn beside(format: &str, name: &str) -> PathBuf {
    file("beside", format, name)
}

fn file(folder: &str, format: &str, name: &str) -> PathBuf {
    let folder = root().join(folder).join(format);
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

fn put(path: &Path, bytes: impl AsRef<[u8]>) {
    std::fs::write(path, bytes).unwrap();
}

fn put_json(path: &Path, value: &Value) {
    put(path, value.to_string());
}

fn main() {
    pictures();
    meshes();
    volumes();
    scenes();
    let blocks = [vec![1.0, -2.5, f64::from(f32::MIN_POSITIVE)], vec![], vec![0.1; 9]];
    let lengths = blocks.each_ref().map(Vec::len);
    Checkpoint::write(&seed("checkpoint", "read_three_blocks"), FINGERPRINT, &lengths, |put| {
        blocks.iter().try_for_each(|block| put(block))
    })
    .unwrap();
    put(
        &seed("checkpoint", "refused_old"),
        "unscatter checkpoint 2\n{\"fingerprint\":\"0\",\"lengths\":[]}\n",
    );
}

/// Red and green rise with x and y; the last byte of a pixel is alpha where there are four.
fn ramp(size: [usize; 2], channels: usize) -> Vec<u8> {
    let pixels = (0..size[0] * size[1]).map(|pixel| [pixel % size[0], pixel / size[0]]);
    pixels
        .flat_map(|[x, y]| {
            [40 * x, 30 * y, 90, 255 - 60 * (x % 3)].map(|byte| byte as u8).into_iter().take(channels)
        })
        .collect()
}

fn pictures() {
    use png::{BitDepth, ColorType};
    let kinds = [
        ("grey", ColorType::Grayscale, BitDepth::Eight, ramp([6, 5], 1)),
        ("grey_1_bit", ColorType::Grayscale, BitDepth::One, vec![0b1010_1000; 5]),
        ("grey_16_bit", ColorType::Grayscale, BitDepth::Sixteen, ramp([6, 5], 2)),
        ("rgb", ColorType::Rgb, BitDepth::Eight, ramp([6, 5], 3)),
        ("rgba", ColorType::Rgba, BitDepth::Eight, ramp([6, 5], 4)),
        ("grey_with_alpha", ColorType::GrayscaleAlpha, BitDepth::Eight, ramp([6, 5], 2)),
        ("palette", ColorType::Indexed, BitDepth::Two, vec![0b0001_1000, 0b0100_0000].repeat(5)),
    ];
    for (name, color, depth, data) in kinds {
        let file = std::fs::File::create(seed("png", &format!("read_{name}"))).unwrap();
        let mut encoder = png::Encoder::new(file, 6, 5);
        encoder.set_color(color);
        encoder.set_depth(depth);
        match name {
            "palette" => {
                encoder.set_palette(vec![0, 0, 0, 255, 128, 0, 9, 9, 9]);
                encoder.set_trns(vec![0, 200]);
            }
            "grey_16_bit" => encoder.set_source_gamma(png::ScaledFloat::new(1.0)),
            _ => (),
        }
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
    }
    put(&seed("png", "refused_palette_of_4_bytes"), damaged_palette());

    for (name, color, channels) in
        [("rgb", ::image::ExtendedColorType::Rgb8, 3), ("grey", ::image::ExtendedColorType::L8, 1)]
    {
        let mut file = std::fs::File::create(seed("jpeg", &format!("read_{name}"))).unwrap();
        let mut encoder = ::image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 70);
        encoder.encode(&ramp([20, 9], channels), 20, 9, color).unwrap();
    }

    exr_pictures();

    let picture = Image::new([6, 2], (0..12).map(|n| [n as f32 / 7.0, 0.5, 3.0]).collect()).unwrap();
    image::write_hdr(&seed("hdr", "read_flat"), &picture).unwrap();
    let words = b"#?RADIANCE\r\nFORMAT=32-bit_rle_rgbe\r\nEXPOSURE=2\r\nCOLORCORR=1 0.5 2\r\n\r\n";
    let runs = |value: u8| [&[2, 2, 0, 8][..], &[136, value].repeat(4)].concat();
    put(&seed("hdr", "read_runs"), [&words[..], b"-Y 2 +X 8\n", &runs(130), &runs(7)].concat());
    put(&seed("hdr", "read_turned"), [&words[..], b"+X 2 -Y 1\n", &[9, 9, 9, 128, 1, 2, 3, 129]].concat());
    put(&seed("hdr", "refused_xyze"), b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n\x01\x02\x03\x80");
}

/// A picture of one pixel whose palette is no number of colours.
fn damaged_palette() -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [0, 0, 0, 1, 0, 0, 0, 1, 8, 3, 0, 0, 0];
    // An empty deflate stream around two bytes: the filter and the pixel.
    let data = [0x78, 0x01, 0x01, 2, 0, 0xfd, 0xff, 0, 0, 0, 2, 0, 1];
    for (kind, bytes) in [(b"IHDR", &header[..]), (b"PLTE", &[1, 2, 3, 4]), (b"IDAT", &data), (b"IEND", &[])]
    {
        let chunk = [kind, bytes].concat();
        png.extend((bytes.len() as u32).to_be_bytes());
        png.extend(&chunk);
        png.extend(crc32fast::hash(&chunk).to_be_bytes());
    }
    png
}

fn exr_pictures() {
    use exr::prelude::*;
    let compressions = [
        ("none", Compression::Uncompressed),
        ("rle", Compression::RLE),
        ("zip", Compression::ZIP16),
        ("piz", Compression::PIZ),
        ("b44", Compression::B44),
    ];
    let value = |at: Vec2<usize>| (at.x() as f32 / 4.0, at.y() as f32, 0.5_f32, 1.0_f32);
    for (name, compression) in compressions {
        let encoding = Encoding { compression, ..Encoding::FAST_LOSSLESS };
        let half = |at| {
            let (red, green, blue, alpha) = value(at);
            (f16::from_f32(red), f16::from_f32(green), f16::from_f32(blue), f16::from_f32(alpha))
        };
        let mut image =
            exr::prelude::Image::from_encoded_channels((7, 5), encoding, SpecificChannels::rgba(half));
        if name == "zip" {
            let size = IntegerBounds::new((-2, -1), (12, 9));
            image.attributes.display_window = size;
        }
        image.write().to_file(seed("exr", &format!("read_{name}_half"))).unwrap();
    }
    let tiles = Encoding { blocks: Blocks::Tiles(Vec2(4, 4)), ..Encoding::SMALL_LOSSLESS };
    let image = exr::prelude::Image::from_encoded_channels((9, 6), tiles, SpecificChannels::rgba(value));
    image.write().to_file(seed("exr", "read_tiles")).unwrap();
}

fn meshes() {
    put(
        &seed("obj", "read_wall_with_window"),
        "v 0 0 0\r\nv 4 0 0\nv 4 3 0\nv 0 3 0\nv 1 1 0\nv 3 1 0\nv 3 2 0\nv 1 2 0\n\
        f 1 2 3 4 1 5 8 7 6 5 # a hole\n",
    );
    put(
        &seed("obj", "read_all"),
        "\u{feff}mtllib a.mtl\no card\ng side a\nv 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1e0 -0\n\
        vt 0 0\nvt 1 0 0\nvt 1 1\nvn 0 0 1\ns off\nusemtl leaf\nf 1/1/1 2/2/1 \\\n3/3/1\nf -4//-1 -2//1 -1//1\nl 1 2 3\np 1\n",
    );
    put(&seed("obj", "refused_line"), "v 0 0 0\nv 1 0 0\nl 1 2 7\n");
    put(&beside("obj", "a.mtl"), "newmtl leaf\nKd 0.2 0.8 0.1\n");
    put(
        &seed("mtl", "read_all"),
        "# leaves\nnewmtl leaf\nKd 0.2 0.8 0.1\nKa 1 1 1\nd 0.5\nTf 1 1 1\nnewmtl other\nTr 0.25\n\
        map_d -clamp on -s 1 2 1 a.png\nmap_Kd \"a.png\"\n",
    );
    put(&seed("mtl", "number"), "newmtl leaf\nd zero\n");
    put(
        &beside("mtl", "a.obj"),
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl leaf\nf 1/1 2/2 3/3\n\
        usemtl other\nf 1/1 2/2 3/3\n",
    );
    let alpha = seed("png", "read_grey");
    std::fs::copy(alpha, beside("mtl", "a.png")).unwrap();

    let positions: Vec<u8> = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        .concat()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let coordinates: Vec<u8> =
        [0.0_f32, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let indices = [0_u8, 1, 2, 0, 2, 3, 0, 0];
    let picture = std::fs::read(seed("png", "read_rgba")).unwrap();
    let mut data = [&positions[..], &coordinates, &indices].concat();
    let views = json!([
        { "buffer": 0, "byteLength": 48 }, { "buffer": 0, "byteOffset": 48, "byteLength": 32 },
        { "buffer": 0, "byteOffset": 80, "byteLength": 6 }, { "buffer": 0, "byteOffset": 88, "byteLength": picture.len() }
    ]);
    data.extend(&picture);
    let mut gltf = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 2] }],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_texture_transform", "EXT_mesh_gpu_instancing"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "directional", "intensity": 2, "color": [1, 0.5, 0.2] }] } },
        "nodes": [
            { "name": "Leaf", "mesh": 0, "translation": [1, 2, 3], "rotation": [0, 0, 0.6, 0.8], "children": [3],
              "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 0 } } } },
            { "name": "Camera", "camera": 0 }, { "name": "Sun", "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "Twig", "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1] }
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1, "aspectRatio": 1.5 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] }],
        "materials": [{ "alphaMode": "MASK", "alphaCutoff": 0.6, "pbrMetallicRoughness": { "baseColorFactor": [1, 0.5, 0.2, 1],
            "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 1], "rotation": 0.3 } } } } }],
        "textures": [{ "source": 0, "sampler": 0 }], "samplers": [{ "wrapS": 33071, "wrapT": 33648 }],
        "images": [{ "bufferView": 3, "mimeType": "image/png" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1] },
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5121, "count": 6, "type": "SCALAR" }
        ],
        "bufferViews": views, "buffers": [{ "byteLength": data.len() }]
    });
    let container = |json: &Value| {
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut binary = data.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let words = [2, 28 + text.len() + binary.len(), text.len()].map(|word| (word as u32).to_le_bytes());
        [
            b"glTF",
            &words.concat()[..],
            b"JSON",
            &text,
            &(binary.len() as u32).to_le_bytes(),
            b"BIN\0",
            &binary,
        ]
        .concat()
    };
    put(&seed("glb", "read_leaf"), container(&gltf));
    // What it says of its data is in a file beside it, or in itself.
    put(&beside("gltf", "a.bin"), &data);
    gltf["buffers"][0]["uri"] = json!("a.bin");
    put_json(&seed("gltf", "read_leaf"), &gltf);
    let zeros = json!({ "bufferView": 2, "componentType": 5121, "count": 3, "type": "SCALAR" });
    let sparse = json!({ "componentType": 5126, "count": 4, "type": "VEC3", "sparse": { "count": 1,
        "indices": { "bufferView": 2, "byteOffset": 1, "componentType": 5121 }, "values": { "bufferView": 0, "byteOffset": 12 } } });
    gltf["accessors"] = json!([sparse, gltf["accessors"][1], zeros]);
    gltf["buffers"][0]["uri"] = json!("data:application/octet-stream;base64,AAEC");
    gltf["buffers"][0]["byteLength"] = json!(3);
    put_json(&seed("gltf", "refused_short"), &gltf);
    put_json(
        &seed("gltf", "refused_draco"),
        &json!({ "asset": { "version": "2.0" }, "extensionsRequired": ["KHR_draco_mesh_compression"] }),
    );
}

fn ball(channels: usize) -> Volume {
    let place = glam_scale();
    let grid = VoxelGrid::new([5, 4, 3], place).unwrap();
    let samples = (0..grid.len() * channels).map(|n| if n % 7 < 3 { 0.0 } else { n as f32 / 16.0 }).collect();
    Volume::new(grid, channels, Samples::F32(samples)).unwrap()
}

fn volumes() {
    for format in Format::ALL {
        let name = if format == Format::Raw { "raw" } else { format.extension() };
        for (channels, what) in [(1, "read_grey"), (3, "read_rgb")] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(format!("a.{}", format.extension()));
            volume::write(&path, "density", &ball(channels), format).unwrap();
            std::fs::copy(&path, seed(name, what)).unwrap();
            if format == Format::Raw {
                // Both are read in one folder.
                let data = format!("{what}.raw");
                let header = std::fs::read_to_string(&path).unwrap().replace("a.raw", &data);
                put(&seed(name, what), header);
                std::fs::copy(path.with_extension("raw"), beside("raw", &data)).unwrap();
            }
        }
    }
    for (compression, half) in
        [(Compression::None, true), (Compression::Blosc, false), (Compression::Zip, true)]
    {
        let (grey, rgb) = (ball(1), ball(3));
        let path = seed("vdb", &format!("read_{compression:?}_{half}").to_lowercase());
        vdb::write(&path, &[("density", &grey), ("color", &rgb)], WriteOptions { compression, half })
            .unwrap();
    }
    let array = |header: &str, data: &[u8]| {
        let mut text = header.as_bytes().to_vec();
        text.resize((text.len() + 11).next_multiple_of(64) - 11, b' ');
        text.push(b'\n');
        [b"\x93NUMPY\x01\0", &(text.len() as u16).to_le_bytes()[..], &text, data].concat()
    };
    let shape = |kind: &str, fortran: &str| {
        format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': (2, 3, 4), }}")
    };
    put(&seed("npy", "read_fortran"), array(&shape("<f8", "True"), &[0; 192]));
    put(&seed("npy", "read_int16"), array(&shape(">i2", "False"), &[1; 48]));
    put(&seed("npy", "read_bool"), array(&shape("|b1", "False"), &[1; 24]));
    put(&seed("npy", "refused_objects"), array(&shape("|O", "False"), &[1; 24]));
}

fn glam_scale() -> glam::DAffine3 {
    glam::DAffine3::from_scale_rotation_translation(
        glam::DVec3::splat(0.25),
        glam::DQuat::IDENTITY,
        glam::DVec3::new(-0.5, 0.0, 1.0),
    )
}

fn look_at(origin: [f64; 3]) -> Value {
    json!({ "look_at": { "origin": origin, "target": [0, 1, 0] } })
}

fn scenes() {
    put_json(
        &seed("scene", "read_hall"),
        &json!({
            "version": 1, "name": "hall", "light": { "direction": [0.2, -1, 0.1], "radiance": [3, 2, 1] },
            "medium": { "sigma_t": [0.1, 0.2, 0.3], "albedo": 0.9, "g": 0.3 }, "ambient": 0.01,
            "occluders": [
                { "box": { "center": [0, 3, 0], "size": [2, 0.1, 2], "albedo": 0.2 } },
                { "sphere": { "center": [0, 1, 0], "radius": 0.5, "to_world": { "translate": [0, 1, 0] } } },
                { "plane": { "center": [0, 0, 0], "sides": [[9, 0, 0], [0, 0, 9]] } },
                { "cylinder": { "from": [2, 0, 0], "to": [2, 3, 0], "radius": 0.2 } },
                { "obj": { "file": "a.obj", "to_world": { "rotate": { "axis": [0, 1, 0], "angle": 20 } } } }
            ],
            "views": [
                { "name": "front", "camera": { "to_world": look_at([0.0, 2.0, 9.0]), "fov": 40, "fov_axis": "x", "size": [16, 12] },
                  "strokes": [{ "points": [[2, 2], [8, 10.5]], "radius": 1.5, "color": "#ff8000" },
                              { "points": [[14, 4]], "radius": 2, "hardness": 1, "opacity": 0.5, "color": [0, 0.25, 4] }] },
                { "name": "side", "camera": { "to_world": { "translate": [0, 1, 5] }, "size": [6, 5],
                  "lens": { "focal_length": [9, 8], "k1": 0.01, "k2": 0.001 } }, "layers": ["a.png"] }
            ],
            "light_map": { "size": [12, 8], "extent": { "min": [-2, -3], "max": [2, 3] }, "basis": "bilinear" },
            "shadow_map": { "size": 64 }, "target": "tint", "exposure": 1.5,
            "solve": { "iterations": 5, "tolerance": 0, "tikhonov": 0.01, "quadrature": { "march": { "steps": 16 } },
                       "strategy": "auto", "memory": "1GiB", "transmittance_bound": 1e-6 }
        }),
    );
    std::fs::copy(seed("png", "read_rgba"), beside("scene", "a.png")).unwrap();
    put(&beside("scene", "a.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    put(&seed("scene", "refused_number"), "{\"version\": 1,\r\n \"exposure\": 1e999}");

    let camera = json!({ "to_world": look_at([0.0, 0.0, 4.0]), "fov": 35, "size": [6, 5] });
    let volume = json!({
        "version": 1, "find": "joint", "environment": { "radiance": 1 }, "lights": [{ "direction": [-1, -1, -0.5], "radiance": 3 }],
        "volume": { "size": 6, "to_world": { "translate": [-1, -1, -1], "scale": 2 }, "albedo": 0.8,
            "extinction": { "made": { "shapes": [{ "sphere": { "center": [0, 0, 0], "radius": 0.7 } }], "inside": 8, "edge": 0.2,
                                      "noise": { "scale": 0.5 } } } },
        "background": 0.02,
        "views": [{ "name": "front", "camera": camera, "strokes": [{ "points": [[3, 4], [5, 4]], "radius": 2, "color": "#ff3020" }] }],
        "solve": { "iterations": 3 }
    });
    put_json(&seed("volume", "read_made"), &volume);
    let mut of_files = volume.clone();
    of_files["volume"] = json!({ "extinction": { "file": "a.vdb", "member": "density", "scale": 3 }, "albedo": { "file": "a.npy", "scale": 0.2 } });
    of_files["views"][0] = json!({ "name": "front", "camera": camera, "picture": "a.png" });
    put_json(&seed("volume", "read_files"), &of_files);
    std::fs::copy(seed("vdb", "read_blosc_false"), beside("volume", "a.vdb")).unwrap();
    std::fs::copy(seed("npy", "read_grey"), beside("volume", "a.npy")).unwrap();
    std::fs::copy(seed("png", "read_rgb"), beside("volume", "a.png")).unwrap();

    let mut animation = volume;
    animation["views"][0]["strokes"] = json!([]);
    animation["volume"] = json!({ "extinction": { "file": "s_####.vdb", "member": "density", "scale": 3 } });
    let painted = |color: &str| json!([{ "name": "front", "strokes": [{ "points": [[3, 3]], "radius": 2, "color": color }] }]);
    animation["animation"] = json!({ "frames": 2, "keys": [{ "frame": 0, "views": painted("#ff0000") },
                                                           { "frame": 1, "views": painted("#00f") }] });
    put_json(&seed("animation", "read_sequence"), &animation);
    for (frame, source) in [("s_0000.vdb", "read_grey"), ("s_0001.vdb", "read_zip_true")] {
        std::fs::copy(seed("vdb", source), beside("animation", frame)).unwrap();
    }

    let pose = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]);
    let frame = |keys: Value| {
        let mut frame = json!({ "file_path": "./a", "transform_matrix": pose, "sharpness": 31.5 });
        frame.as_object_mut().unwrap().extend(keys.as_object().unwrap().clone());
        frame
    };
    put_json(
        &seed("transforms", "read_angles"),
        &json!({ "camera_angle_x": 0.7, "camera_angle_y": 0.6, "frames": [frame(json!({}))] }),
    );
    put_json(
        &seed("transforms", "read_calibrated"),
        &json!({
            "camera_model": "OPENCV", "fl_x": 9.5, "fl_y": 9.25, "cx": 3.25, "cy": 2.5, "w": 6, "h": 5.0, "k1": -0.1, "k2": 0.02, "p1": 1e-3,
            "p2": -2e-3, "aabb_scale": 16, "frames": [frame(json!({ "mask_path": "m%20a.png" })), frame(json!({ "k1": 0, "depth_file_path": "d" }))]
        }),
    );
    put_json(
        &seed("transforms", "read_fisheye"),
        &json!({ "fl_x": 3, "w": 6, "h": 5, "is_fisheye": true, "k3": 0.01, "frames": [frame(json!({}))] }),
    );
    put_json(
        &seed("transforms", "refused_orthographic"),
        &json!({ "camera_model": "ORTHOGRAPHIC", "fl_x": 3, "w": 6, "frames": [frame(json!({}))] }),
    );
    std::fs::copy(seed("png", "read_rgb"), beside("transforms", "a.png")).unwrap();
}
