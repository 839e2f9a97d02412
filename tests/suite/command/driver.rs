//! A driver that fails: the system's Vulkan loader with a fault in it, and an adapter that is otherwise in order.
//!
//! Needs a C compiler, or UNSCATTER_FAULTY_VULKAN: the folder of the built `libvulkan.so.1`.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::gpu::adapter;
use super::{Desk, Ran};

/// The faulty loader, and the real one that it stands before.
struct Driver {
    folder: PathBuf,
    loader: PathBuf,
    _built: TempDir,
}

impl Driver {
    fn new() -> Self {
        let built = tempfile::tempdir().unwrap();
        let folder = std::env::var_os("UNSCATTER_FAULTY_VULKAN").map_or_else(
            || {
                let source = crate::root().join("tests/faulty_vulkan.c");
                let library = built.path().join("libvulkan.so.1");
                let mut compiler = Command::new("cc");
                compiler.args(["-shared", "-fPIC", "-o"]).arg(library).arg(source).arg("-ldl");
                assert!(compiler.status().unwrap().success());
                built.path().to_owned()
            },
            PathBuf::from,
        );
        Self { folder, loader: real_loader(), _built: built }
    }

    fn command(&self, desk: &Desk, out: &str, backend: &str, fault: &str) -> Command {
        let mut command = Command::new(crate::program());
        let before = std::env::var("LD_LIBRARY_PATH").unwrap_or_default();
        command
            .current_dir(desk.path("."))
            .args(["light-map", "scene.json", "-o", out, "--backend", backend, "--adapter", &adapter().name])
            .env("LD_LIBRARY_PATH", format!("{}:{before}", self.folder.display()))
            .env("VULKAN_LOADER", &self.loader)
            .env("VULKAN_FAULT", fault)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn run(&self, desk: &Desk, backend: &str, fault: &str) -> Ran {
        Ran::of(&[backend, fault], &self.command(desk, "out", backend, fault).output().unwrap())
    }
}

fn real_loader() -> PathBuf {
    let searched = std::env::var("LD_LIBRARY_PATH").unwrap_or_default();
    let usual = "/usr/lib/x86_64-linux-gnu:/usr/lib/aarch64-linux-gnu:/usr/lib64:/usr/lib:/usr/local/lib";
    let all = format!("{searched}:{usual}");
    let paths = all.split(':').map(|folder| Path::new(folder).join("libvulkan.so.1"));
    paths.into_iter().find(|path| path.is_file()).expect("no Vulkan loader")
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_driver_that_loses_the_device_ends_as_every_lost_device_does() {
    let (driver, desk) = (Driver::new(), Desk::new());
    // Where nothing is wrong the loader changes nothing.
    driver.run(&desk, "gpu", "").exits_with(0);
    let iterations = |desk: &Desk| desk.json("out/report.json")["stop"]["iteration"].clone();
    let whole = iterations(&desk);
    for wait in [1, 9, 16] {
        let fault = format!("lost:{wait}");
        driver.run(&desk, "gpu", &fault).exits_with(3).tells("was lost in the middle of the work");
        driver.run(&desk, "auto", &fault).exits_with(0).tells("computing on the processor");
        assert_eq!(desk.json("out/report.json")["backend"], "cpu");
        assert_eq!(iterations(&desk), whole);
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn a_driver_without_memory_is_told_from_one_that_is_lost() {
    let (driver, desk) = (Driver::new(), Desk::new());
    for mebibytes in [1, 9] {
        let fault = format!("memory:{mebibytes}");
        driver.run(&desk, "gpu", &fault).exits_with(3).tells("memory");
        driver.run(&desk, "auto", &fault).exits_with(0);
        assert_eq!(desk.json("out/report.json")["backend"], "cpu");
    }
}

#[test]
#[ignore = "needs a graphics adapter; ./test.sh brings one"]
fn ctrl_c_is_heard_while_a_device_hangs() {
    let (driver, desk) = (Driver::new(), Desk::new());
    for (backend, code) in [("gpu", 3), ("auto", 130)] {
        let begun = Instant::now();
        let child = driver.command(&desk, backend, backend, "hang:12").spawn().unwrap();
        sleep(Duration::from_secs(3));
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let ran = Ran::of(&[backend], &child.wait_with_output().unwrap()).exits_with(code);
        ran.tells("has not answered for");
        assert!(begun.elapsed() < Duration::from_secs(40), "{:?}", begun.elapsed());
    }
    // The processor has gone on from what there was, and stopped at once.
    assert_eq!(desk.json("auto/report.json")["stop"]["reason"], "interrupted");
}
