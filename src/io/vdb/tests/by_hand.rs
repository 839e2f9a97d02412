//! Files put together byte by byte: old versions, and what no writer makes.

use super::*;
use crate::io::vdb::header::{HALF, MAGIC, text};
use crate::io::vdb::transform;

/// A file of one grid without metadata, under a scale of 2.
fn file(version: u32, kind: &str, flags: u32, tree: &[u8]) -> Vec<u8> {
    let mut file = [&MAGIC.to_le_bytes()[..], &version.to_le_bytes(), &[0; 8], &[1]].concat();
    if version < 222 {
        file.push(u8::from(flags == 1));
    }
    // OpenVDB skips files without one.
    file.extend(b"11111111-1111-1111-1111-111111111111");
    file.extend(0_u32.to_le_bytes());
    file.extend(1_u32.to_le_bytes());
    file.extend([text("a"), text(kind), text("")].concat());
    let start = file.len() as u64 + 24;
    let mut grid = Vec::new();
    if version >= 222 {
        grid.extend(flags.to_le_bytes());
    }
    grid.extend(0_u32.to_le_bytes());
    grid.extend(text("UniformScaleMap"));
    grid.extend([2.0_f64; 15].iter().flat_map(|number| number.to_le_bytes()));
    grid.extend(tree);
    file.extend([start, start, start + grid.len() as u64].map(u64::to_le_bytes).as_flattened());
    file.extend(grid);
    file
}

/// What a tree begins with, for tiles and children at these places.
fn root(background: f32, tiles: &[([i32; 3], f32, bool)], children: u32) -> Vec<u8> {
    let mut tree = [1_u32.to_le_bytes(), background.to_le_bytes()].concat();
    tree.extend([tiles.len() as u32, children].map(u32::to_le_bytes).as_flattened());
    for (origin, value, active) in tiles {
        tree.extend(origin.map(i32::to_le_bytes).as_flattened());
        tree.extend(value.to_le_bytes());
        tree.push((*active).into());
    }
    tree
}

/// The child of a root, down to one leaf in the first or the last slot, in versions before 222. Voxel n of the leaf is
/// n + `first`, tile n is n, and tile 1 is active.
fn old_child(origin: [i32; 3], last: bool, first: f32, leaves: &mut Vec<u8>) -> Vec<u8> {
    let mut tree = origin.map(i32::to_le_bytes).concat();
    for slots in [32_usize.pow(3), 16_usize.pow(3)] {
        let [mut child, mut active] = [(); 2].map(|()| vec![0; slots / 8]);
        if last {
            child[slots / 8 - 1] = 0x80
        } else {
            child[0] = 1
        };
        active[0] = 2;
        tree.extend([child, active].concat());
        let tiles = if last { 0..slots - 1 } else { 1..slots };
        tree.extend(tiles.flat_map(|slot| (slot as f32).to_le_bytes()));
    }
    tree.extend([0xff; 64]);
    leaves.extend([0xff; 64]);
    let corner = origin.map(|side| if last { side + 4088 } else { side });
    leaves.extend(corner.map(i32::to_le_bytes).as_flattened());
    leaves.push(1);
    leaves.extend((0..512).flat_map(|slot| (slot as f32 + first).to_le_bytes()));
    tree
}

/// Where `VDB_KEEP` names a folder, for a look with OpenVDB.
fn keep(name: &str, bytes: &[u8]) {
    if let Ok(folder) = std::env::var("VDB_KEEP") {
        std::fs::write(Path::new(&folder).join(format!("{name}.vdb")), bytes).unwrap();
    }
}

#[test]
fn old_versions_are_read() {
    for version in [220, 221] {
        let mut leaves = Vec::new();
        let mut tree = root(0.5, &[], 1);
        tree.extend(old_child([0, 0, 0], false, 100.0, &mut leaves));
        tree.extend(leaves);
        let bytes = file(version, "Tree_float_5_4_3", 0, &tree);
        keep(&format!("old_{version}"), &bytes);
        let volume = read_bytes(&bytes, None).unwrap();
        holds(&volume, [0; 3], [128, 128, 256], |[i, j, k], _| match [i, j, k] {
            [..8, ..8, ..8] => (100 + 64 * i + 8 * j + k) as f32,
            [_, _, k] if k >= 128 => 1.0,
            _ => (i / 8 * 256 + j / 8 * 16 + k / 8) as f32,
        });
        assert_eq!(volume.grid().centre([0; 3]), DVec3::ZERO);
        assert_eq!(volume.grid().centre([1, 2, 3]), DVec3::new(2.0, 4.0, 6.0));
    }
}

#[test]
fn versions_with_the_same_layout_are_read_alike() {
    let mut bytes = std::fs::read(fixture("codes")).unwrap();
    let volume = read_bytes(&bytes, None).unwrap();
    for version in 222..=225 {
        bytes[8] = version;
        assert_eq!(read_bytes(&bytes, None).unwrap(), volume);
    }
}

/// OpenVDB sorts the entries of a root before it reads the leaves below them.
#[test]
fn leaves_come_in_the_order_of_places() {
    let mut leaves = [Vec::new(), Vec::new()];
    let mut tree = root(0.5, &[], 2);
    tree.extend(old_child([0; 3], false, 1000.0, &mut leaves[1]));
    let below = old_child([-4096; 3], true, 0.0, &mut leaves[0]);
    // Without active tiles, so that the box is that of the leaves and of what is above.
    tree.extend(below.iter().enumerate().map(|(at, &byte)| {
        let active = at == 12 + 4096 || at == 12 + 8192 + 4 * 32767 + 512;
        if active { 0 } else { byte }
    }));
    tree.extend(leaves.concat());
    let bytes = file(221, "Tree_float_5_4_3", 0, &tree);
    keep("unsorted", &bytes);
    let volume = read_bytes(&bytes, None).unwrap();
    assert_eq!(volume.grid().size(), [136, 136, 264]);
    let value = |at| volume.color(volume.grid().index(at))[0];
    assert_eq!((value([0; 3]), value([7; 3])), (0.0, 511.0));
    assert_eq!((value([8; 3]), value([15; 3])), (1000.0, 1511.0));
    // Between them lies the background.
    assert_eq!(value([0, 0, 8]), 0.5);
}

#[test]
fn a_tile_of_the_root_fills_what_lies_in_the_box() {
    let tiles = [([0, 0, 0], 7.0, true), ([4096, 0, 0], 3.0, false)];
    let bytes = file(224, "Tree_float_5_4_3", 0, &root(0.0, &tiles, 0));
    let refused = read_bytes(&bytes, None);
    assert!(matches!(refused, Err(Error::TooLarge { needed, .. }) if needed == "4096 × 4096 × 4096 voxels"));
}

#[test]
fn trees_that_make_no_sense_are_refused_in_words() {
    let float = |tree: &[u8]| reason(read_bytes(&file(224, "Tree_float_5_4_3", 2, tree), None));
    assert!(float(&root(0.0, &[], 0)).contains("no active voxel"));
    assert!(float(&root(0.0, &[([0; 3], 1.0, false)], 0)).contains("no active voxel"));
    assert!(float(&root(0.0, &[([0; 3], 1.0, true); 2], 0)).contains("no place for a node at [0, 0, 0]"));
    assert!(float(&root(0.0, &[([8, 0, 0], 1.0, true)], 0)).contains("no place for a node at [8, 0, 0]"));
    assert!(float(&root(0.0, &[], u32::MAX)).contains("cut short"));
    assert!(float(&2_u32.to_le_bytes()).contains("2 values a voxel"));
    let mut coded = root(0.0, &[], 1);
    coded.extend([&[0; 12 + 8192][..], &[7]].concat());
    assert!(float(&coded).contains("unknown code, 7"));
    let version = |version| reason(read_bytes(&file(version, "Tree_float_5_4_3", 0, &[]), None));
    assert!(version(219).contains("its version is 219, where 220 to 225 are read"));
    assert!(version(226).contains("its version is 226"));
    let kind = |kind| reason(read_bytes(&file(224, kind, 0, &[]), None));
    assert!(kind("Tree_double_5_4_3").contains("double precision"));
    assert!(kind("Tree_ptdataidx32_ptdataidx32_5_4_3").contains("holds points"));
    assert!(kind("Tree_float_4_3").contains("an unusual tree (`Tree_float_4_3`)"));
    let packed = reason(read_bytes(&file(224, "Tree_float_5_4_3", 8, &[]), None));
    assert!(packed.contains("unknown way (0x8)"));
    assert!(reason(read_bytes(b"not a VDB file", None)).contains("does not begin like one"));
    assert!(reason(read_bytes(b"", None)).contains("cut short"));
}

/// Where metadata contradict the type of a grid, they count, as they do for OpenVDB.
#[test]
fn halves_are_told_by_metadata_then_by_type() {
    let volume = read(&fixture("float_zip"), None).unwrap();
    let options = WriteOptions { half: true, compression: Compression::Zip };
    let file = written(&[("a", &volume)], options);
    let saved = entry("is_saved_as_half_float", "bool", &[1]);
    let at = file.windows(saved.len()).position(|window| window == saved).unwrap();
    let mut contradicted = file.clone();
    contradicted[at + saved.len() - 1] = 0;
    assert!(read_bytes(&contradicted, None).is_err());
    let mut silent = file.clone();
    silent[at + 4] ^= 1;
    assert_eq!(read_bytes(&silent, None).unwrap(), read_bytes(&file, None).unwrap());
    assert!(file.windows(HALF.len()).any(|window| window == HALF.as_bytes()));
}

/// A scale is followed by four vectors that follow from it; matrices are for row vectors.
#[test]
fn every_linear_map_is_read() {
    let map = |kind: &str, numbers: &[f64]| {
        let bytes = [text(kind), numbers.iter().flat_map(|number| number.to_le_bytes()).collect()].concat();
        let mut source = ByteReader::new(Cursor::new(&bytes), Path::new("memory.vdb"))?;
        transform::read(&mut source).inspect(|_| assert_eq!(source.at(), bytes.len() as u64))
    };
    let scale = DAffine3::from_scale(DVec3::new(1.0, 2.0, -3.0));
    let moved = DAffine3 { translation: DVec3::new(4.0, 5.0, 6.0), ..scale };
    let numbers = |first: &[f64]| [first, &[9.0; 12]].concat();
    for prefix in ["", "Uniform"] {
        let read = map(&format!("{prefix}ScaleMap"), &numbers(&[1.0, 2.0, -3.0]));
        assert_eq!(read.unwrap(), scale);
        let read = map(&format!("{prefix}ScaleTranslateMap"), &numbers(&[4.0, 5.0, 6.0, 1.0, 2.0, -3.0]));
        assert_eq!(read.unwrap(), moved);
    }
    assert_eq!(
        map("TranslationMap", &[4.0, 5.0, 6.0]).unwrap(),
        DAffine3::from_translation(moved.translation)
    );
    let mut matrix = [0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.5, 0.0, 0.0, 0.0, 3.0, 0.0, 4.0, 5.0, 6.0, 1.0];
    for kind in ["AffineMap", "UnitaryMap"] {
        let read = map(kind, &matrix).unwrap();
        assert_eq!(read.transform_point3(DVec3::X), DVec3::new(4.0, 6.0, 6.0));
        assert_eq!(read.transform_point3(DVec3::Y), DVec3::new(6.0, 5.0, 6.5));
    }
    matrix[3] = 0.1;
    assert!(map("AffineMap", &matrix).unwrap_err().to_string().contains("perspective"));
    assert!(map("NonlinearFrustumMap", &[]).unwrap_err().to_string().contains("frustum of a camera"));
    assert!(map("Map", &[]).unwrap_err().to_string().contains("unknown kind, `Map`"));
}

#[test]
fn instances_and_streams_are_refused_in_words() {
    let volume = read(&fixture("float_zip"), None).unwrap();
    let whole = written(&[("ab", &volume)], WriteOptions::default());
    let at = whole.windows(4).position(|bytes| bytes == b"5_4_").unwrap() + 5;
    let mut instance = whole.clone();
    // The empty third text becomes one of eight bytes; the place of the grid takes what is left.
    instance[at] = 8;
    instance[at + 4..at + 12].copy_from_slice(b"original");
    instance.splice(at + 12..at + 12, whole[at + 4..at + 12].iter().copied());
    instance[at + 12..at + 20].copy_from_slice(&(at as u64 + 36).to_le_bytes());
    let end = instance.len() as u64;
    instance[at + 28..at + 36].copy_from_slice(&end.to_le_bytes());
    assert!(reason(read_bytes(&instance, None)).contains("its grid `ab` shares the voxels of `original`"));
    let mut stream = whole;
    stream[20] = 0;
    assert!(reason(read_bytes(&stream, None)).contains("written as a stream"));
}
