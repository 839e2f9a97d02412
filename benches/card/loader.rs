//! What lets programs find a Vulkan driver on a machine that has no more than the driver.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

/// The Vulkan loader.
pub const VULKAN: &str = "libvulkan.so.1";
/// Where drivers of some machines lie beside the usual folders.
const DRIVER_FOLDERS: [&str; 2] = ["/usr/local/nvidia/lib64", "/usr/local/nvidia/lib"];
/// Where loaders look for the manifests of drivers.
const MANIFESTS: [&str; 3] =
    ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];
/// Where manifests lie on machines whose loader does not look there.
const OTHER_MANIFESTS: [&str; 5] = [
    "/usr/local/nvidia/share/vulkan/icd.d",
    "/usr/local/nvidia/vulkan/icd.d",
    "/usr/share/nvidia/vulkan/icd.d",
    "/opt/amdgpu/share/vulkan/icd.d",
    "/run/opengl-driver/share/vulkan/icd.d",
];
/// Variables that name manifests.
const NAMED: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Makes `folder` of links to those bundled libraries that the system lacks, so that none of its own is shadowed; gives the variables
/// that programs need.
///
/// Errors: when the folder cannot be made.
pub fn environment(bundled: &Path, folder: &Path) -> io::Result<Vec<(&'static str, OsString)>> {
    std::fs::create_dir_all(folder)?;
    let mut folders = library_folders();
    let drivers = DRIVER_FOLDERS.map(PathBuf::from).into_iter().filter(|folder| folder.is_dir());
    folders.extend(drivers.clone());
    for library in files(bundled) {
        let Some(name) = library.file_name() else { continue };
        let link = folder.join(name);
        let _ = std::fs::remove_file(&link);
        if !folders.iter().any(|folder| folder.join(name).exists()) {
            std::os::unix::fs::symlink(&library, &link)?;
        }
    }
    let before = std::env::var_os("LD_LIBRARY_PATH");
    let before = before.iter().flat_map(std::env::split_paths).filter(|path| !path.as_os_str().is_empty());
    let path = std::env::join_paths(before.chain([folder.to_owned()]).chain(drivers));
    let mut variables = vec![("LD_LIBRARY_PATH", path.map_err(io::Error::other)?)];
    if let Some(manifest) = other_manifest(&folders, folder)? {
        variables.push((NAMED[0], manifest));
    }
    Ok(variables)
}

/// The manifests of drivers where the loader finds none by itself.
fn other_manifest(libraries: &[PathBuf], folder: &Path) -> io::Result<Option<OsString>> {
    if !manifests().is_empty() || NAMED.iter().any(|name| std::env::var_os(name).is_some()) {
        return Ok(None);
    }
    let others: Vec<PathBuf> =
        OTHER_MANIFESTS.iter().flat_map(|folder| json_files(folder.as_ref())).collect();
    if !others.is_empty() {
        return std::env::join_paths(others).map(Some).map_err(io::Error::other);
    }
    // NVIDIA's driver in a container comes without its manifest.
    let driver = ["libGLX_nvidia.so.0", "libEGL_nvidia.so.0"]
        .into_iter()
        .find(|name| libraries.iter().any(|folder| folder.join(name).exists()));
    let Some(driver) = driver else { return Ok(None) };
    let manifest = folder.join("nvidia_icd.json");
    let text = format!(
        "{{\"file_format_version\": \"1.0.0\", \"ICD\": {{\"library_path\": \"{driver}\", \"api_version\": \"1.3.0\"}}}}\n"
    );
    std::fs::write(&manifest, text)?;
    Ok(Some(manifest.into()))
}

/// Manifests that the loader finds: those that a variable names, else those in its folders.
pub fn manifests() -> Vec<PathBuf> {
    if let Some(named) = NAMED.iter().find_map(std::env::var_os) {
        return std::env::split_paths(&named).filter(|path| path.exists()).collect();
    }
    let own = std::env::home_dir().map(|home| home.join(".local/share/vulkan/icd.d"));
    let usual = MANIFESTS.iter().map(PathBuf::from).chain(own);
    usual.flat_map(|folder| json_files(&folder)).collect()
}

/// Whether there is a loader: of the system, or in a folder of bundled libraries.
pub fn has_vulkan(bundled: &Path) -> bool {
    library_folders().iter().any(|folder| folder.join(VULKAN).exists()) || bundled.join(VULKAN).exists()
}

/// Where the system looks for libraries.
fn library_folders() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> =
        ["/lib", "/usr/lib", "/lib64", "/usr/lib64", "/usr/local/lib"].map(PathBuf::from).into();
    let triple = format!("{}-linux-gnu", std::env::consts::ARCH);
    folders.extend(["/lib", "/usr/lib", "/usr/local/lib"].map(|folder| Path::new(folder).join(&triple)));
    folders.extend(std::env::var_os("LD_LIBRARY_PATH").iter().flat_map(std::env::split_paths));
    for file in files("/etc/ld.so.conf.d".as_ref()) {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        folders.extend(text.lines().map(str::trim).filter(|line| line.starts_with('/')).map(PathBuf::from));
    }
    folders
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

fn json_files(folder: &Path) -> Vec<PathBuf> {
    let is_json = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "json");
    files(folder).into_iter().filter(is_json).collect()
}
