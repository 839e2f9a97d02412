//! Files of one volume that lie at different places, in one scene and from frame to frame.

use std::path::Path;

use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::Result;
use crate::io::scene_file::{AnimatedVolume, load_animation, load_volume};
use crate::io::volume::{Format, write};
use crate::scene::{Samples, Volume, VolumeMedium, VoxelGrid};

/// A scene file among other files.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Writes a volume of one channel whose value at a voxel is given.
    fn put(&self, name: &str, grid: VoxelGrid, value: impl Fn([usize; 3]) -> f32) {
        let samples = (0..grid.len()).map(|index| value(grid.voxel(index))).collect();
        let volume = Volume::new(grid, 1, Samples::F32(samples)).unwrap();
        let path = self.0.path().join(name);
        let format = Format::of(Path::new(name)).unwrap();
        write(&path, "density", &volume, format).unwrap();
    }

    fn scene(&self, volume: &Value, animation: Option<Value>) -> std::path::PathBuf {
        let mut scene = json!({
            "version": 1, "volume": volume, "find": "emission",
            "views": [{
                "name": "v",
                "camera": { "to_world": { "translate": [0, 0, 9] }, "fov": 40, "size": [4, 4] },
                "strokes": [{ "points": [[2, 2]], "radius": 1, "color": "#ffffff" }]
            }]
        });
        if let Some(animation) = animation {
            scene["animation"] = animation;
        }
        let path = self.0.path().join("scene.json");
        std::fs::write(&path, scene.to_string()).unwrap();
        path
    }

    fn medium(&self, volume: Value, overrides: &[&str]) -> Result<VolumeMedium> {
        let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
        Ok(load_volume(&self.scene(&volume, None), &overrides)?.medium)
    }

    fn animated(&self, volume: &Value, frames: usize) -> Result<AnimatedVolume> {
        let keys = json!([{ "frame": 0 }, { "frame": frames - 1 }]);
        load_animation(&self.scene(volume, Some(json!({ "frames": frames, "keys": keys }))), &[])
    }
}

/// Voxels of half a metre.
fn lattice(size: [usize; 3], at: DVec3) -> VoxelGrid {
    VoxelGrid::new(size, DAffine3::from_translation(at) * DAffine3::from_scale(DVec3::splat(0.5))).unwrap()
}

/// A row of voxels along x.
fn row(count: usize, at: f64, length: f64) -> VoxelGrid {
    let place =
        DAffine3::from_translation(DVec3::X * at) * DAffine3::from_scale(DVec3::new(length, 1.0, 1.0));
    VoxelGrid::new([count, 1, 1], place).unwrap()
}

fn values(volume: &Volume) -> Vec<f32> {
    volume.samples().iter().collect()
}

fn is_at(a: &VoxelGrid, b: &VoxelGrid) -> bool {
    a.size() == b.size() && a.corners().iter().zip(b.corners()).all(|(a, b)| a.distance(b) < 1e-9)
}

#[test]
fn a_file_that_is_cut_to_its_active_voxels_lies_where_it_says() {
    let grid = lattice([6, 5, 4], DVec3::new(1.0, 2.0, 3.0));
    let flames = |[i, j, k]: [usize; 3]| {
        if (2..4).contains(&i) && (1..3).contains(&j) && k == 2 { (100 * i + 10 * j + k) as f32 } else { 0.0 }
    };
    let desk = Desk::new();
    desk.put("smoke.vdb", grid, |[i, j, k]| 1.0 + (i + j + k) as f32);
    desk.put("flames.vdb", grid, flames);
    let expected: Vec<f32> = (0..grid.len()).map(|index| 3.0 * flames(grid.voxel(index))).collect();
    let files = json!({
        "extinction": { "file": "smoke.vdb" }, "emission": { "file": "flames.vdb", "scale": 3 }
    });
    let medium = desk.medium(files.clone(), &[]).unwrap();
    assert!(is_at(medium.extinction.grid(), &grid));
    assert_eq!(medium.emission.grid(), medium.extinction.grid());
    assert_eq!(values(&medium.emission), expected);
    // What moves the one file moves the other.
    let mut moved = files;
    moved["to_world"] = json!({ "translate": [-1, -1, -1], "scale": 2 });
    let medium = desk.medium(moved, &[]).unwrap();
    let cube = DAffine3::from_translation(DVec3::NEG_ONE) * DAffine3::from_scale(DVec3::splat(2.0));
    assert!(is_at(medium.extinction.grid(), &VoxelGrid::over_cube([6, 5, 4], cube).unwrap()));
    assert_eq!(medium.emission.grid(), medium.extinction.grid());
    assert_eq!(values(&medium.emission), expected);
}

#[test]
fn a_file_between_the_voxels_is_interpolated_as_the_medium_is() {
    let desk = Desk::new();
    desk.put("smoke.npz", row(4, 0.0, 1.0), |_| 1.0);
    // Centres at 1 and 2, where those of the smoke lie at 0.5, 1.5, 2.5 and 3.5.
    desk.put("flames.npz", row(2, 0.5, 1.0), |[i, ..]| [10.0, 20.0][i]);
    let emission = |interpolation: &str| {
        let volume = json!({
            "extinction": { "file": "smoke.npz" }, "emission": { "file": "flames.npz" },
            "interpolation": interpolation
        });
        let medium = desk.medium(volume, &[]).unwrap();
        assert_eq!(medium.emission.grid(), medium.extinction.grid());
        values(&medium.emission)
    };
    assert_eq!(emission("nearest"), [10.0, 20.0, 0.0, 0.0]);
    assert_eq!(emission("trilinear"), [5.0, 15.0, 10.0, 0.0]);
}

#[test]
fn a_file_whose_own_voxels_fill_the_box_keeps_them() {
    let desk = Desk::new();
    desk.put("smoke.npz", row(2, 0.0, 1.0), |_| 1.0);
    desk.put("fine.npz", row(2, 0.5, 0.5), |[i, ..]| [1.0, 2.0][i]);
    desk.put("coarse.npz", row(1, 0.0, 2.0), |_| 0.5);
    let volume = json!({
        "extinction": { "file": "smoke.npz" }, "emission": { "file": "fine.npz" },
        "albedo": { "file": "coarse.npz" }, "interpolation": "trilinear"
    });
    let medium = desk.medium(volume, &[]).unwrap();
    assert!(is_at(medium.emission.grid(), &row(4, 0.0, 0.5)));
    assert_eq!(values(&medium.emission), [0.0, 1.0, 2.0, 0.0]);
    assert!(is_at(medium.albedo.grid(), &row(1, 0.0, 2.0)));
    assert_eq!(values(&medium.albedo), [0.5]);
}

#[test]
fn what_does_not_say_where_it_lies_fills_the_box() {
    let desk = Desk::new();
    desk.put("smoke.npz", row(4, 7.0, 1.0), |_| 1.0);
    desk.put("flames.npy", row(2, 0.0, 1.0), |[i, ..]| [1.0, 2.0][i]);
    let files = json!({ "extinction": { "file": "smoke.npz" }, "emission": { "file": "flames.npy" } });
    let medium = desk.medium(files, &[]).unwrap();
    assert!(is_at(medium.emission.grid(), &row(2, 7.0, 2.0)));
    assert_eq!(values(&medium.emission), [1.0, 2.0]);
    // Where extinction comes from no file, another says where the box is.
    let files = json!({ "extinction": 2, "size": 3, "emission": { "file": "smoke.npz" } });
    let medium = desk.medium(files, &[]).unwrap();
    assert_eq!(medium.extinction.grid().size(), [3; 3]);
    assert!(is_at(medium.emission.grid(), &row(4, 7.0, 1.0)));
}

#[test]
fn outside_of_its_file_an_index_of_refraction_is_1() {
    let desk = Desk::new();
    desk.put("smoke.npz", row(4, 0.0, 1.0), |_| 1.0);
    desk.put("glass.npz", row(2, 1.0, 1.0), |_| 1.25);
    let files = json!({
        "extinction": { "file": "smoke.npz" }, "refraction": { "index": { "file": "glass.npz" } }
    });
    let medium = desk.medium(files, &[]).unwrap();
    assert_eq!(values(&medium.refraction.unwrap().0), [1.0, 1.25, 1.25, 1.0]);
}

#[test]
fn a_file_that_lies_outside_of_the_box_is_refused() {
    let desk = Desk::new();
    desk.put("smoke.npz", row(4, 0.0, 1.0), |_| 1.0);
    desk.put("flames.npz", row(2, 4.25, 1.0), |_| 1.0);
    let files = json!({ "extinction": { "file": "smoke.npz" }, "emission": { "file": "flames.npz" } });
    let told = desk.medium(files, &[]).unwrap_err().to_string();
    assert!(told.contains("volume.emission") && told.contains("outside of the box"), "{told}");
    assert!(told.contains("from [4.250, 0.000, 0.000] to [6.250, 1.000, 1.000]"), "{told}");
}

#[test]
fn a_wrong_value_is_named_by_the_index_of_the_file() {
    let desk = Desk::new();
    let value = |voxel: [usize; 3]| match voxel {
        [..11, ..] => 0.0,
        [13, 1, 2] => -0.25,
        _ => 1.0,
    };
    desk.put("smoke.vdb", lattice([16, 3, 4], DVec3::ZERO), value);
    let told = desk.medium(json!({ "extinction": { "file": "smoke.vdb" } }), &[]).unwrap_err().to_string();
    assert!(told.contains("-0.25 in voxel (13, 1, 2)"), "{told}");
}

#[test]
fn volumes_beyond_the_memory_are_refused_before_they_are_read() {
    let desk = Desk::new();
    // One value in all voxels takes hardly any bytes of a file.
    desk.put("smoke.vdb", lattice([128; 3], DVec3::ZERO), |_| 1.0);
    assert!(std::fs::metadata(desk.0.path().join("smoke.vdb")).unwrap().len() < 20_000);
    let file = || json!({ "extinction": { "file": "smoke.vdb" } });
    let told = desk.medium(file(), &["solve.memory=7MiB"]).unwrap_err().to_string();
    assert!(told.contains("smoke.vdb would need 8 MiB and 7 MiB are allowed; raise solve.memory"), "{told}");
    assert_eq!(desk.medium(file(), &["solve.memory=8MiB"]).unwrap().extinction.grid().size(), [128; 3]);
    for extinction in [
        json!(1),
        json!({ "made": { "shapes": [{ "sphere": { "center": [0, 0, 0], "radius": 1 } }], "inside": 1, "edge": 1 } }),
    ] {
        let volume = json!({ "extinction": extinction, "size": 1000 });
        let told = desk.medium(volume, &["solve.memory=100MiB"]).unwrap_err().to_string();
        assert!(told.contains("volume.extinction") && told.contains("100 MiB are allowed"), "{told}");
    }
    desk.put("flames.npz", lattice([1, 1, 1], DVec3::ZERO), |_| 1.0);
    let volume = json!({ "extinction": { "file": "flames.npz" }, "emission": { "file": "smoke.vdb" } });
    let told = desk.medium(volume, &["solve.memory=7MiB"]).unwrap_err().to_string();
    assert!(told.contains("volume.emission.file"), "{told}");
}

#[test]
fn frames_whose_active_voxels_move_and_grow_share_one_grid() {
    let grid = lattice([20, 4, 3], DVec3::new(1.0, 2.0, 3.0));
    let smoke = |frame: usize, [i, j, k]: [usize; 3]| {
        let is_inside = i >= 2 + 3 * frame && i < 4 + 5 * frame && j <= frame && k == 1;
        if is_inside { (1 + 100 * frame + i) as f32 } else { 0.0 }
    };
    let desk = Desk::new();
    for frame in 0..3 {
        desk.put(&format!("smoke_{frame:02}.vdb"), grid, |voxel| smoke(frame, voxel));
    }
    let files = json!({ "extinction": { "file": "smoke_##.vdb" } });
    let check = |animated: &AnimatedVolume, world_from_files: DAffine3| {
        let [first, last] = [0, 1].map(|key| animated.animation.keys[key].scene.medium.extinction.clone());
        let between = animated.extinction(1).unwrap().unwrap();
        for (frame, volume) in [(0, &*first), (1, &between), (2, &*last)] {
            // From x = 2 of the first frame to x = 13 of the last, and y from 0 to 2.
            assert_eq!(volume.grid().size(), [12, 3, 1]);
            assert_eq!(volume.grid(), first.grid());
            for index in 0..volume.grid().len() {
                let [i, j, k] = volume.grid().voxel(index);
                let voxel = [i + 2, j, k + 1];
                assert_eq!(volume.color(index)[0], smoke(frame, voxel), "frame {frame} at {voxel:?}");
                let centre = world_from_files.transform_point3(grid.centre(voxel));
                assert!(volume.grid().centre([i, j, k]).distance(centre) < 1e-9);
            }
        }
    };
    check(&desk.animated(&files, 3).unwrap(), DAffine3::IDENTITY);
    // The box of all frames fills the cube.
    let to_world = DAffine3::from_scale(DVec3::splat(4.0));
    let mut moved = files;
    moved["to_world"] = json!({ "scale": 4 });
    let all = lattice([12, 3, 1], grid.centre([2, 0, 1]) - 0.25).world_from_cube();
    check(&desk.animated(&moved, 3).unwrap(), to_world * all.inverse());
}

#[test]
fn frames_on_other_voxels_come_to_those_of_the_first() {
    let desk = Desk::new();
    desk.put("smoke_0.vdb", row(2, 0.0, 1.0), |[i, ..]| [1.0, 2.0][i]);
    desk.put("smoke_1.vdb", row(2, 1.5, 2.0), |[i, ..]| [4.0, 8.0][i]);
    let volume = json!({ "extinction": { "file": "smoke_#.vdb" }, "interpolation": "nearest" });
    let animated = desk.animated(&volume, 2).unwrap();
    let frames = [0, 1].map(|key| animated.animation.keys[key].scene.medium.extinction.clone());
    assert!(frames.iter().all(|volume| is_at(volume.grid(), &row(6, 0.0, 1.0))));
    assert_eq!(values(&frames[0]), [1.0, 2.0, 0.0, 0.0, 0.0, 0.0]);
    // Centres at 0.5, 1.5, … in voxels from 1.5 to 3.5 and from 3.5 to 5.5.
    assert_eq!(values(&frames[1]), [0.0, 4.0, 4.0, 8.0, 8.0, 0.0]);
}

#[test]
fn keys_with_files_of_their_own_share_one_grid() {
    let desk = Desk::new();
    desk.put("a.npz", row(2, 0.0, 1.0), |_| 1.0);
    desk.put("b.npz", row(2, 1.0, 1.0), |_| 2.0);
    let keys = json!([{ "frame": 0 }, { "frame": 2, "extinction": { "file": "b.npz" } }]);
    let scene =
        desk.scene(&json!({ "extinction": { "file": "a.npz" } }), Some(json!({ "frames": 3, "keys": keys })));
    let keys = load_animation(&scene, &[]).unwrap().animation.keys;
    assert_eq!(values(&keys[0].scene.medium.extinction), [1.0, 1.0, 0.0]);
    assert_eq!(values(&keys[1].scene.medium.extinction), [0.0, 2.0, 2.0]);
}

#[test]
fn frames_that_lie_too_far_apart_are_refused() {
    let desk = Desk::new();
    desk.put("smoke_0.vdb", row(2, 0.0, 1.0), |_| 1.0);
    desk.put("smoke_1.vdb", row(2, 5000.0, 1.0), |_| 1.0);
    let told = desk.animated(&json!({ "extinction": { "file": "smoke_#.vdb" } }), 2).unwrap_err().to_string();
    assert!(told.contains("5002 × 1 × 1 voxels and 4096 a side"), "{told}");
}

#[test]
fn frames_that_do_not_say_where_they_lie_must_have_the_same_voxels() {
    let desk = Desk::new();
    desk.put("smoke_0.npy", row(2, 0.0, 1.0), |_| 1.0);
    desk.put("smoke_1.npy", row(2, 0.0, 1.0), |_| 2.0);
    let files = json!({ "extinction": { "file": "smoke_#.npy" }, "to_world": { "scale": 2 } });
    let keys = desk.animated(&files, 2).unwrap().animation.keys;
    assert_eq!(values(&keys[1].scene.medium.extinction), [2.0, 2.0]);
    desk.put("smoke_1.npy", row(3, 0.0, 1.0), |_| 2.0);
    let told = desk.animated(&files, 2).unwrap_err().to_string();
    assert!(told.contains("all frames must have the same"), "{told}");
}
