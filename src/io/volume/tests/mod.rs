//! Every format there and back.

mod foreign;
mod lies;

use std::fs::File;
use std::io::{Cursor, Write};
use std::path::PathBuf;
use std::time::Instant;

use glam::{DAffine3, DMat3, DVec3};
use half::f16;
use proptest::prelude::*;
use proptest::sample::Index;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::scene::{Samples, VoxelGrid};

/// The formats that are read and written here.
const OURS: [Format; 4] = [Format::Npy, Format::Npz, Format::Vol, Format::Raw];

fn folder_for(format: Format) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("volume").with_extension(format.extension());
    (folder, path)
}

fn read_bytes(format: Format, bytes: &[u8]) -> Result<Stored> {
    let (_folder, path) = folder_for(format);
    std::fs::write(&path, bytes).unwrap();
    read(&path, None)
}

fn reason(result: Result<Stored>) -> String {
    match result {
        Err(Error::Format { reason, .. }) => reason,
        other => unreachable!("{other:?}"),
    }
}

fn grid(size: [usize; 3]) -> VoxelGrid {
    VoxelGrid::over_cube(size, DAffine3::IDENTITY).unwrap()
}

/// Values 0, 1, 2 … in the order of the file.
fn counting(size: [usize; 3], channels: usize) -> Volume {
    let count = size.iter().product::<usize>() * channels;
    Volume::new(grid(size), channels, Samples::F32((0..count).map(|value| value as f32).collect())).unwrap()
}

fn any_volume() -> impl Strategy<Value = Volume> {
    let number = prop_oneof![-1e3_f32..1e3, Just(0.0), Just(-0.0), Just(1e-40), Just(6e4)];
    let place = prop::array::uniform12(-2.0_f64..2.0).prop_map(|n| {
        let skew = 0.1 * DMat3::from_cols_slice(&n[..9]);
        DAffine3 { matrix3: DMat3::IDENTITY + skew, translation: DVec3::from_slice(&n[9..]) }
    });
    let shape =
        (prop::array::uniform3(1_usize..5), prop_oneof![Just(1_usize), Just(3)], any::<bool>(), place);
    shape.prop_flat_map(move |(size, channels, is_half, place)| {
        let count = size.iter().product::<usize>() * channels;
        prop::collection::vec(number.clone(), count).prop_map(move |values| {
            let samples = match is_half {
                true => Samples::F16(values.into_iter().map(f16::from_f32).collect()),
                false => Samples::F32(values),
            };
            Volume::new(VoxelGrid::new(size, place).unwrap(), channels, samples).unwrap()
        })
    })
}

fn with_changed_value(volume: &Volume, at: usize) -> Volume {
    let mut values: Vec<f32> = volume.samples().iter().collect();
    values[at] += 1.0;
    Volume::new(*volume.grid(), volume.channels(), Samples::F32(values)).unwrap()
}

fn is_same(a: &Volume, b: &Volume) -> bool {
    let bits = |volume: &Volume| volume.samples().iter().map(f32::to_bits).collect::<Vec<_>>();
    a.channels() == b.channels() && a.grid().size() == b.grid().size() && bits(a) == bits(b)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn volumes_come_back(volume in any_volume(), at in any::<Index>()) {
        for format in OURS {
            let (folder, path) = folder_for(format);
            write(&path, "density", &volume, format).unwrap();
            let Stored { volume: found, placed, .. } = read(&path, None).unwrap();
            prop_assert!(is_same(&found, &volume), "{:?}", format);
            let changed = with_changed_value(&volume, at.index(volume.samples().len()));
            prop_assert!(!is_same(&found, &changed), "a changed value goes unseen in {:?}", format);
            prop_assert_eq!(placed, format != Format::Npy);
            match format {
                // Nothing is lost, so there is nothing to tolerate.
                Format::Npz | Format::Raw => prop_assert_eq!(&found, &volume),
                // The places here are skewed.
                _ => prop_assert_eq!(found.grid(), &grid(volume.grid().size())),
            }
            if format == Format::Npy {
                prop_assert_eq!(found.samples(), volume.samples());
            }
            let files = std::fs::read_dir(folder.path()).unwrap().count();
            prop_assert_eq!(files, if format == Format::Raw { 2 } else { 1 });
        }
    }

    #[test]
    fn a_box_along_the_axes_survives_a_vol(
        least in prop::array::uniform3(-100.0_f64..100.0),
        extent in prop::array::uniform3(0.1_f64..50.0),
    ) {
        let cube = DAffine3::from_scale_rotation_translation(extent.into(), glam::DQuat::IDENTITY, least.into());
        let size = [2, 3, 4];
        let volume = Volume::constant(VoxelGrid::over_cube(size, cube).unwrap(), [0.5; 3]).unwrap();
        let (_folder, path) = folder_for(Format::Vol);
        write(&path, "", &volume, Format::Vol).unwrap();
        let found = *read(&path, None).unwrap().volume.grid();
        // Two roundings to single precision of numbers below 150.
        let distance = |a: &VoxelGrid| {
            found.corners().iter().zip(a.corners()).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max)
        };
        prop_assert!(distance(volume.grid()) < 3e-5);
        let moved = DAffine3::from_translation(DVec3::Y * 1e-4) * cube;
        prop_assert!(distance(&VoxelGrid::over_cube(size, moved).unwrap()) > 3e-5);
    }

    #[test]
    fn damaged_files_never_panic(
        volume in any_volume(),
        damage in prop::collection::vec((any::<Index>(), any::<u8>()), 0..5),
        (cut, insert) in (any::<Index>(), prop::collection::vec(any::<u8>(), 0..4)),
        kind in 0..4,
    ) {
        for format in OURS {
            let (_folder, path) = folder_for(format);
            write(&path, "", &volume, format).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            for (index, value) in &damage {
                let at = if kind == 3 { index.index(bytes.len().min(64)) } else { index.index(bytes.len()) };
                bytes[at] = *value;
            }
            match kind {
                0 => bytes.truncate(cut.index(bytes.len())),
                1 => {
                    let at = cut.index(bytes.len());
                    bytes.splice(at..at, insert.iter().copied());
                }
                _ => {}
            }
            std::fs::write(&path, &bytes).unwrap();
            if let Err(error) = read(&path, None) {
                let is_told = matches!(error, Error::Format { .. } | Error::File { .. });
                prop_assert!(is_told && !error.to_string().is_empty(), "{}", error);
            }
        }
    }
}

#[test]
fn the_extension_decides_and_the_content_must_agree() {
    assert_eq!(Format::of(Path::new("a/b.NPZ")).unwrap(), Format::Npz);
    for format in Format::ALL {
        assert_eq!(Format::of(&Path::new("cloud").with_extension(format.extension())).unwrap(), format);
    }
    for name in ["cloud", "cloud.tif", ".npy", ""] {
        let told = Format::of(Path::new(name)).unwrap_err().to_string();
        assert!(Format::ALL.iter().all(|format| told.contains(format.extension())), "{told}");
    }
    let volume = counting([2, 2, 2], 1);
    for format in OURS {
        let (_folder, path) = folder_for(format);
        write(&path, "", &volume, format).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for other in OURS.into_iter().filter(|&other| other != format) {
            assert!(!reason(read_bytes(other, &bytes)).is_empty(), "{format:?} as {other:?}");
        }
        let other = if format == Format::Npy { Format::Npz } else { Format::Npy };
        assert!(matches!(write(&path, "", &volume, other), Err(Error::Format { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        if format != Format::Npz {
            assert!(reason(read(&path, Some("density"))).contains("`density`"));
        }
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(read(&path, None), Err(Error::File { .. })));
        std::fs::create_dir(&path).unwrap();
        assert!(read(&path, None).unwrap_err().to_string().contains("it is a folder"));
    }
}

fn npy(dtype: &str, order: &str, shape: &str, values: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{dtype}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes(), values].concat()
}

fn archive(members: &[(&str, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        writer.start_file(*name, SimpleFileOptions::default().compression_method(method)).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn of_value(value: f32) -> Vec<u8> {
    npy("<f4", "False", "(1, 1, 1)", &value.to_le_bytes())
}

fn vol(encoding: i32, size: [i32; 3], channels: i32, values: &[u8]) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    bytes.extend([encoding, size[0], size[1], size[2], channels].map(i32::to_le_bytes).concat());
    bytes.extend([-1.0_f32, 0.0, 2.0, 1.0, 1.0, 6.0].map(f32::to_le_bytes).concat());
    bytes.extend(values);
    bytes
}

#[test]
fn places_that_a_vol_cannot_hold_become_the_unit_cube() {
    let of = |cube: DAffine3| {
        let volume = Volume::constant(VoxelGrid::over_cube([2, 3, 4], cube).unwrap(), [1.0; 3]).unwrap();
        let (_folder, path) = folder_for(Format::Vol);
        write(&path, "", &volume, Format::Vol).unwrap();
        *read(&path, None).unwrap().volume.grid()
    };
    for cube in [
        DAffine3::from_rotation_z(1e-3),
        DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0)),
        DAffine3::from_translation(DVec3::X * 1e9),
        DAffine3::from_scale(DVec3::splat(1e60)),
    ] {
        assert_eq!(of(cube), grid([2, 3, 4]), "{cube}");
    }
    assert_ne!(of(DAffine3::from_scale(DVec3::splat(2.0))), grid([2, 3, 4]));
}

#[test]
fn x_runs_fastest_and_channels_lie_side_by_side_in_every_format() {
    let volume = counting([4, 3, 2], 3);
    let values: Vec<u8> = (0..72).flat_map(|value| (value as f32).to_le_bytes()).collect();
    for format in [Format::Npy, Format::Vol, Format::Raw] {
        let (folder, path) = folder_for(format);
        write(&path, "", &volume, format).unwrap();
        let data = if format == Format::Raw { folder.path().join("volume.raw") } else { path };
        assert!(std::fs::read(data).unwrap().ends_with(&values), "{format:?}");
    }
}
