//! The VDB reader and writer against OpenVDB itself, through its Python module: `cargo test --test suite --
//! --ignored vdb_peer`.
//!
//! `VDB_PYTHON` names the Python that has it, `VDB_RECOMPRESS` the program of `fixtures/vdb/recompress.cpp`, where it
//! is built: then files in every way of packing are compared too.

use std::path::Path;
use std::process::Command;

use glam::{DAffine3, DQuat, DVec3};
use half::f16;
use serde_json::{Value, json};
use unscatter::io::vdb::{Compression, WriteOptions, read, write};
use unscatter::scene::{Samples, Volume, VoxelGrid};

/// The exit code of the script: 0, or 3 where grids differ.
fn openvdb(task: &str, folder: &Path) -> Option<i32> {
    let python = std::env::var("VDB_PYTHON").unwrap_or("/usr/bin/python3".to_owned());
    let script = crate::root().join("tests/vdb_peer.py");
    let mut command = Command::new(python);
    command.arg(script).arg(task).arg(folder);
    if task == "make" {
        command.args(std::env::var("VDB_RECOMPRESS"));
    }
    command.status().unwrap().code()
}

fn records(folder: &Path) -> Vec<(std::path::PathBuf, Value)> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let records = paths.filter(|path| path.extension().is_some_and(|extension| extension == "json"));
    records
        .map(|path| (path.clone(), serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap()))
        .collect()
}

#[test]
#[ignore = "needs OpenVDB for Python; ./test.sh brings it"]
fn grids_that_openvdb_wrote_are_read_exactly() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(openvdb("make", folder.path()), Some(0));
    let records = records(folder.path());
    assert!(records.len() > 30, "{} grids", records.len());
    let (level_sets, records): (Vec<_>, Vec<_>) =
        records.iter().partition(|(_, record)| record["file"].as_str().unwrap().starts_with("level_set"));
    assert!(!level_sets.is_empty());
    for (path, record) in level_sets {
        let told = read(&folder.path().join(record["file"].as_str().unwrap()), None).unwrap_err().to_string();
        assert!(told.contains("`surface` is a level set"), "{path:?}: {told}");
    }
    for (path, record) in &records {
        let file = folder.path().join(record["file"].as_str().unwrap());
        let volume = read(&file, record["grid"].as_str()).unwrap();
        assert_eq!(json!(volume.grid().size()), record["size"], "{path:?}");
        assert_eq!(json!(volume.channels()), record["channels"], "{path:?}");
        let bytes: Vec<u8> = volume.samples().iter().flat_map(f32::to_le_bytes).collect();
        assert!(bytes == std::fs::read(path.with_extension("f32")).unwrap(), "values of {path:?}");
        let expected: Vec<f64> = serde_json::from_value(record["world_from_grid"].clone()).unwrap();
        let expected = DAffine3::from_cols_slice(&expected);
        assert!(volume.grid().world_from_grid().abs_diff_eq(expected, 1e-9), "placement of {path:?}");
    }
    eprintln!("{} grids of OpenVDB read", records.len());
}

fn grid(size: [usize; 3], case: usize) -> VoxelGrid {
    let world_from_grid = match case % 4 {
        0 => DAffine3::from_scale(DVec3::splat(0.1)),
        1 => DAffine3 {
            translation: DVec3::new(1.0, -2.0, 3.0),
            ..DAffine3::from_scale(DVec3::new(0.1, -0.2, 0.3))
        },
        2 => DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.7), DVec3::new(5.0, 0.0, 0.1)),
        _ => {
            let mut shear = DAffine3::from_scale(DVec3::new(2.0, 1.0, 0.5));
            shear.matrix3.y_axis.x = 0.3;
            shear
        }
    };
    VoxelGrid::new(size, world_from_grid).unwrap()
}

/// Noise with holes, boxes of one value, and nothing at all; no noise in large ones.
fn values(size: [usize; 3], channels: usize, case: usize) -> Vec<f32> {
    let kind = if size[0] * size[1] * size[2] > 100_000 { 2 + case % 2 } else { case % 5 };
    let noise = |n: usize| ((n as f64 * 78.233 + case as f64).sin() * 43758.5453).fract() as f32;
    let value = |index: usize, channel: usize| {
        let [x, y, z] = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
        match kind {
            0 => noise(channels * index + channel),
            1 if noise(index).abs() < 0.7 => 0.0,
            1 => noise(channels * index + channel),
            2 => 0.25 + channel as f32,
            3 if x < size[0] / 2 && y < size[1] / 2 => 3.0 - channel as f32,
            3 if z == 0 => noise(index),
            _ => 0.0,
        }
    };
    (0..size.iter().product::<usize>() * channels).map(|n| value(n / channels, n % channels)).collect()
}

#[test]
#[ignore = "needs OpenVDB for Python; ./test.sh brings it"]
fn grids_that_are_written_are_read_by_openvdb_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = [[1, 1, 1], [8, 8, 8], [21, 9, 17], [130, 129, 128], [300, 1, 2]];
    let mut case = 0;
    for compression in [Compression::None, Compression::Zip, Compression::Blosc] {
        for half in [false, true] {
            for (number, size) in sizes.into_iter().enumerate() {
                let mut volumes = Vec::new();
                for channels in [1, 3] {
                    case += 1;
                    let samples = Samples::F32(values(size, channels, case));
                    let volume = Volume::new(grid(size, case), channels, samples).unwrap();
                    volumes.push((format!("grid{channels}"), volume));
                }
                let file = format!("{compression:?}_{half}_{number}");
                let path = folder.path().join(format!("{file}.vdb"));
                let grids: Vec<_> = volumes.iter().map(|(name, volume)| (name.as_str(), volume)).collect();
                write(&path, &grids, WriteOptions { compression, half }).unwrap();
                for (name, volume) in &volumes {
                    record(folder.path(), &file, name, volume, half);
                }
            }
        }
    }
    assert_eq!(openvdb("verify", folder.path()), Some(0));

    // The comparison finds one wrong number and one wrong placement.
    let (path, mut wrong) = records(folder.path()).remove(0);
    let right = wrong.clone();
    wrong["world_from_grid"][9] = json!(1e-3);
    std::fs::write(&path, wrong.to_string()).unwrap();
    assert_eq!(openvdb("verify", folder.path()), Some(3), "a wrong placement is found");
    std::fs::write(&path, right.to_string()).unwrap();
    let path = path.with_extension("f32");
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[1] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(openvdb("verify", folder.path()), Some(3), "a wrong number is found");
}

fn record(folder: &Path, file: &str, name: &str, volume: &Volume, half: bool) {
    let record = json!({
        "file": format!("{file}.vdb"), "grid": name, "size": volume.grid().size(), "channels": volume.channels(),
        "half": half, "world_from_grid": volume.grid().world_from_grid().to_cols_array(),
    });
    let stored = |value| if half { f16::from_f32(value).to_f32() } else { value };
    let bytes: Vec<u8> = volume.samples().iter().flat_map(|value| stored(value).to_le_bytes()).collect();
    std::fs::write(folder.join(format!("{file}.{name}.json")), record.to_string()).unwrap();
    std::fs::write(folder.join(format!("{file}.{name}.f32")), bytes).unwrap();
}
