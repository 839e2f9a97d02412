//! Files of OpenVDB (`tests/fixtures/vdb`, made by `make.py` there) and our own, whole and damaged. `tests/suite/vdb_peer.rs`
//! compares many more with OpenVDB itself.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3};
use half::f16;
use proptest::prelude::*;

use super::byte_reader::ByteReader;
use super::byte_writer::ByteWriter;
use super::dense::MAX_DENSE;
use super::header::entry;
use super::read::{Limits, read_from};
use super::write::write_to;
use super::{Compression, WriteOptions, names, read};
use crate::scene::{Samples, Volume, VoxelGrid};
use crate::{Error, Result};

mod by_hand;
mod damage;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/fixtures/vdb/{name}.vdb"))
}

fn read_bytes(bytes: &[u8], grid: Option<&str>) -> Result<Volume> {
    read_few(bytes, grid, MAX_DENSE)
}

/// At most so many voxels.
fn read_few(bytes: &[u8], grid: Option<&str>, voxels: usize) -> Result<Volume> {
    let source = ByteReader::new(Cursor::new(bytes), Path::new("memory.vdb"))?;
    Ok(read_from(source, grid, Limits { voxels, allow: &|_| Ok(()) })?.volume)
}

fn written(grids: &[(&str, &Volume)], options: WriteOptions) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    write_to(ByteWriter::new(&mut file, Path::new("memory.vdb")), grids, options).unwrap();
    file.into_inner()
}

fn reason(read: Result<Volume>) -> String {
    read.unwrap_err().to_string()
}

/// Every number of a volume is what a rule says for its index, counted from `first`, and its channel.
fn holds(volume: &Volume, first: [i64; 3], size: [usize; 3], rule: impl Fn([i64; 3], usize) -> f32) {
    assert_eq!(volume.grid().size(), size);
    for (index, value) in volume.samples().iter().enumerate() {
        let voxel = volume.grid().voxel(index / volume.channels());
        let at = std::array::from_fn(|axis| first[axis] + voxel[axis] as i64);
        assert_eq!(value, rule(at, index % volume.channels()), "at {at:?}");
    }
}

fn ramp([i, j, k]: [i64; 3], _channel: usize) -> f32 {
    ((i + 2 * j + 3 * k) as f64 / 100.0) as f32
}

fn colors(at: [i64; 3], channel: usize) -> f32 {
    [ramp(at, 0), at[0] as f32, -at[2] as f32][channel]
}

fn halved(value: f32) -> f32 {
    f16::from_f32(value).to_f32()
}

#[test]
fn grids_of_openvdb_are_read_in_every_packing() {
    let density = |name| read(&fixture(name), Some("density")).unwrap();
    holds(&density("float_zip"), [0; 3], [5, 4, 3], ramp);
    holds(&density("float_none"), [0; 3], [5, 4, 3], ramp);
    holds(&density("vec3s_blosc"), [0; 3], [8; 3], colors);
    holds(&density("half_blosc"), [0; 3], [8; 3], |at, channel| halved(ramp(at, channel)));
    holds(&density("vec3s_half_zip"), [0; 3], [5, 4, 3], |at, channel| halved(colors(at, channel)));
}

#[test]
fn inactive_values_are_restored_however_they_are_stored() {
    let inactive: [&[f32]; 7] =
        [&[3.0], &[-3.0], &[5.0], &[-3.0, 3.0], &[5.0, 3.0], &[5.0, 6.0], &[5.0, 6.0, 7.0]];
    holds(&read(&fixture("codes"), None).unwrap(), [0; 3], [56, 8, 8], |[i, j, k], _| {
        let slot = (i % 8 * 64 + j * 8 + k) as usize;
        let values = inactive[(i / 8) as usize];
        if slot.is_multiple_of(9) { slot as f32 } else { values[slot % values.len()] }
    });
}

#[test]
fn tiles_and_background_fill_the_box() {
    holds(&read(&fixture("tiles"), None).unwrap(), [0; 3], [31, 16, 16], |at, _| match at {
        [30, 1, 2] => 3.0,
        [..16, _, _] => 2.0,
        [16..24, ..8, ..8] => -1.0,
        _ => 0.5,
    });
}

#[test]
fn an_index_of_openvdb_is_the_centre_of_a_voxel() {
    let volume = read(&fixture("affine"), None).unwrap();
    holds(&volume, [2, 7, 1], [5, 4, 3], |[i, j, k], _| ramp([i - 2, j - 7, k - 1], 0));
    let axes = [DVec3::new(0.5, 0.25, 0.0), DVec3::new(0.0, -0.5, 0.0), DVec3::new(0.125, 0.0, 2.0)];
    let centre = DVec3::new(1.0, 2.0, 3.0) + 2.0 * axes[0] + 7.0 * axes[1] + axes[2];
    assert!((volume.grid().centre([0; 3]) - centre).length() < 1e-12);
    let next = centre + axes[2];
    assert!((volume.grid().centre([0, 0, 1]) - next).length() < 1e-12);
}

#[test]
fn grids_are_found_by_name() {
    let path = fixture("several");
    assert_eq!(names(&path).unwrap(), ["density", "mask"]);
    assert_eq!(read(&path, None).unwrap(), read(&path, Some("density")).unwrap());
    assert!(reason(read(&path, Some("heat"))).contains("no grid `heat`, but `density`, `mask`"));
    assert!(reason(read(&path, Some("mask"))).contains("truth values"));
    let volume = read(&fixture("affine"), None).unwrap();
    let file = written(&[("a", &volume), ("b", &volume)], WriteOptions::default());
    assert!(reason(read_bytes(&file, None)).contains("several grids, name one of `a`, `b`"));
    assert!(matches!(read(Path::new("/nowhere.vdb"), None), Err(Error::File { action: "read", .. })));
}

/// Two grids of one name, with a number each as OpenVDB writes them, or without.
fn namesakes(numbered: bool) -> Vec<u8> {
    let volume = read(&fixture("affine"), None).unwrap();
    let doubled = volume.map(|value| 2.0 * value).unwrap();
    let options = WriteOptions { compression: Compression::None, half: false };
    let mut file = written(&[("a+0", &volume), ("a+1", &doubled)], options);
    for at in 0..file.len() - 3 {
        match &file[at..at + 3] {
            b"a+0" | b"a+1" if numbered => file[at + 1] = 0x1e,
            b"a+1" => file[at + 2] = b'0',
            _ => {}
        }
    }
    file
}

#[test]
fn grids_that_share_a_name_are_chosen_by_their_number() {
    fn first(file: &[u8], grid: Option<&str>) -> Result<f32> {
        read_bytes(file, grid).map(|volume| volume.color(1)[0])
    }
    for (numbered, name) in [(true, "a"), (false, "a+0")] {
        let file = namesakes(numbered);
        let value = first(&file, Some(&format!("{name}[0]"))).unwrap();
        assert_eq!(first(&file, Some(&format!("{name}[1]"))).unwrap(), 2.0 * value);
        let told = first(&file, Some(name)).unwrap_err().to_string();
        assert!(
            told.contains(&format!("several grids `{name}`, name one of `{name}[0]`, `{name}[1]`")),
            "{told}"
        );
        let told = first(&file, Some("b")).unwrap_err().to_string();
        assert!(told.contains(&format!("no grid `b`, but `{name}[0]`")), "{told}");
    }
    let volume = read(&fixture("affine"), None).unwrap();
    let mut file = written(&[("density+0", &volume), ("density+1", &volume)], WriteOptions::default());
    while let Some(at) = file.windows(8).position(|window| window == b"density+") {
        file[at + 7] = 0x1e;
    }
    assert!(reason(read_bytes(&file, None)).contains("name one of `density[0]`, `density[1]`"));
}

#[test]
fn a_level_set_is_refused_with_what_to_do() {
    let volume = read(&fixture("affine"), None).unwrap();
    let mut file = written(&[("a", &volume)], WriteOptions::default());
    let [fog, class] = ["fog volume", "level set"].map(|class| entry("class", "string", class.as_bytes()));
    let at = file.windows(fog.len()).position(|window| window == fog).unwrap();
    // One byte shorter; another entry takes it.
    let [fog, class] = [
        [fog, entry("creator", "string", b"unscatter")].concat(),
        [class, entry("creator", "string", b"unscatter.")].concat(),
    ];
    file[at..at + fog.len()].copy_from_slice(&class);
    let told = reason(read_bytes(&file, None));
    assert!(told.contains("`a` is a level set") && told.contains("sdfToFogVolume"), "{told}");
}

#[test]
fn a_value_that_is_not_finite_is_named_by_the_index_of_the_file() {
    let grid = VoxelGrid::new([20, 3, 9], DAffine3::IDENTITY).unwrap();
    let active = |index: usize| grid.voxel(index)[0] >= 11 && grid.voxel(index)[2] >= 2;
    let samples = (0..grid.len()).map(|index| if active(index) { 1.5 + index as f32 } else { 0.0 }).collect();
    let volume = Volume::new(grid, 1, Samples::F32(samples)).unwrap();
    let options = WriteOptions { compression: Compression::None, half: false };
    let mut file = written(&[("a", &volume)], options);
    let number = (1.5 + grid.index([13, 1, 7]) as f32).to_le_bytes();
    let at = file.windows(4).position(|bytes| bytes == number).unwrap();
    file[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    let Err(Error::NonFinite { what, place }) = read_bytes(&file, None) else { unreachable!() };
    assert_eq!((what.as_str(), place.as_str()), ("the grid `a` of memory.vdb", "index (13, 1, 7)"));
}

#[test]
fn memory_is_asked_for_before_the_box_is_made() {
    let volume = read(&fixture("vec3s_blosc"), None).unwrap();
    let file = written(&[("a", &volume)], WriteOptions::default());
    let source = ByteReader::new(Cursor::new(&file), Path::new("memory.vdb")).unwrap();
    let asked = std::cell::Cell::new(0);
    let allow = |bytes| {
        asked.set(bytes);
        Err(Error::Interrupted)
    };
    let refused = read_from(source, None, Limits { voxels: MAX_DENSE, allow: &allow });
    assert!(matches!(refused.map(|boxed| boxed.volume), Err(Error::Interrupted)));
    assert_eq!(asked.get(), 12 * volume.grid().len() as u64);
}

#[test]
fn names_that_tell_nothing_apart_are_refused() {
    let volume = read(&fixture("affine"), None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vdb");
    for names in [&["a", "a"][..], &[""], &["a\u{1e}0"], &[]] {
        let grids: Vec<_> = names.iter().map(|&name| (name, &volume)).collect();
        let refused = super::write(&path, &grids, WriteOptions::default());
        assert!(matches!(refused, Err(Error::Value { .. })), "{names:?}");
    }
    assert!(!path.exists());
}

#[test]
fn numbers_beyond_half_precision_are_refused_with_their_place() {
    let grid = VoxelGrid::new([2, 1, 1], DAffine3::IDENTITY).unwrap();
    let volume = Volume::new(grid, 1, Samples::F32(vec![1.0, 1e5])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let options = WriteOptions { half: true, ..WriteOptions::default() };
    let refused = super::write(&folder.path().join("a.vdb"), &[("a", &volume)], options);
    assert!(matches!(refused, Err(Error::NonFinite { place, .. }) if place == "voxel (1, 0, 0)"));
}

#[test]
fn one_changed_number_in_the_file_changes_one_voxel() {
    let volume = read(&fixture("vec3s_blosc"), None).unwrap();
    let options = WriteOptions { compression: Compression::None, half: false };
    let mut file = written(&[("a", &volume)], options);
    // The last number of the last leaf, whose voxels are all active.
    *file.last_mut().unwrap() ^= 0x80;
    let changed = read_bytes(&file, None).unwrap();
    let pairs = volume.samples().iter().zip(changed.samples().iter());
    assert_eq!(pairs.filter(|(before, after)| before != after).count(), 1);
}

/// Numbers, with holes or in blocks of eight that are alike.
fn volumes() -> impl Strategy<Value = Volume> {
    let size = [1_usize..20, 1_usize..20, 1_usize..20];
    (size, prop::bool::ANY, 0..4, any::<u32>(), -1.0..1.0).prop_map(|(size, grey, fill, seed, angle)| {
        let mut world_from_grid = DAffine3::from_scale_rotation_translation(
            DVec3::new(0.5, 1.0, if fill == 1 { 1.0 } else { -2.0 }),
            DQuat::from_rotation_x(if fill > 1 { angle } else { 0.0 }),
            DVec3::new(angle, 0.0, -3.0),
        );
        world_from_grid.matrix3.y_axis.x += if fill == 3 { 0.25 } else { 0.0 };
        let grid = VoxelGrid::new(size, world_from_grid).unwrap();
        let noise = |n: usize| {
            let bits = (n as u32 ^ seed).wrapping_mul(0x9e37_79b9);
            ((bits ^ bits >> 15).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / 65536.0 - 128.0
        };
        let channels = if grey { 1 } else { 3 };
        let value = |n: usize| match fill {
            0 => noise(n),
            1 if noise(n / channels) > -64.0 => 0.0,
            1 => noise(n),
            _ => noise(grid.voxel(n / channels).map(|side| side / 8).iter().sum::<usize>() + n % channels)
                .max(0.0),
        };
        let mut samples: Vec<f32> = (0..grid.len() * channels).map(value).collect();
        // Something is active.
        samples[0] = 1.0;
        Volume::new(grid, channels, Samples::F32(samples)).unwrap()
    })
}

fn options() -> impl Strategy<Value = WriteOptions> {
    let compression = prop::sample::select(vec![Compression::None, Compression::Zip, Compression::Blosc]);
    (compression, prop::bool::ANY).prop_map(|(compression, half)| WriteOptions { compression, half })
}

proptest! {
    #[test]
    fn what_is_written_is_read_at_the_same_place_in_the_world(volume in volumes(), options in options()) {
        let file = written(&[("first", &volume.map(|_| 1.0).unwrap()), ("second", &volume)], options);
        prop_assert_eq!(&file, &written(&[("first", &volume.map(|_| 1.0).unwrap()), ("second", &volume)], options));
        let back = read_bytes(&file, Some("second")).unwrap();
        prop_assert_eq!(back.channels(), volume.channels());
        let mut found = 0;
        for index in 0..volume.grid().len() {
            let at = back.grid().grid_from_world().transform_point3(volume.grid().centre(volume.grid().voxel(index)));
            let voxel = at.floor().as_i64vec3();
            prop_assert!((at - voxel.as_dvec3() - 0.5).length() < 1e-9);
            let inside = voxel.cmpge(glam::I64Vec3::ZERO).all()
                && voxel.to_array().iter().zip(back.grid().size()).all(|(&at, side)| at < side as i64);
            found += usize::from(inside);
            let value = if inside {
                back.color(back.grid().index(voxel.to_array().map(|side| side as usize)))
            } else {
                [0.0; 3]
            };
            let expected = volume.color(index).map(|value| if options.half { halved(value) } else { value });
            prop_assert_eq!(value, expected);
        }
        prop_assert_eq!(found, back.grid().len());
    }
}
