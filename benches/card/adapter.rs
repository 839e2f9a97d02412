//! The adapter that is measured: hardware, and software only in a dry run.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::Value;

use super::bundle::{Bundle, in_words};
use super::child::End;
use super::loader;

/// Looking for adapters loads every driver, and lets each compute.
const PATIENCE: Duration = Duration::from_secs(60);

/// An adapter that computes what it should, and the machine that it is in, as `unscatter doctor --json` tells them.
#[derive(Debug)]
pub struct Found {
    pub device: Value,
    pub host: Value,
}

/// The first adapter of the kind that is asked for, or that of a name.
///
/// Errors: what was found instead, in words.
pub fn find(bundle: &Bundle, is_dry: bool, name: Option<&str>) -> Result<Found, String> {
    let told = bundle.run_within(&mut bundle.unscatter(&["doctor", "--json"]), PATIENCE);
    if told.end != End::Exit(Some(0)) {
        return Err(format!("unscatter doctor: {}; logs/00-adapters.txt has more", in_words(&told.end)));
    }
    let host: Value = serde_json::from_str(&told.out)
        .map_err(|error| format!("unscatter doctor has written no JSON: {error}"))?;
    let adapters = host["adapters"].as_array().map(Vec::as_slice).unwrap_or_default();
    match choose(adapters, is_dry, name) {
        Some(device) => Ok(Found { device: device.clone(), host: host.clone() }),
        None => Err(instead(
            adapters,
            loader::has_vulkan(&bundle.libraries()),
            &loader::manifests(),
            is_dry,
            name,
        )),
    }
}

pub fn choose<'a>(adapters: &'a [Value], is_dry: bool, name: Option<&str>) -> Option<&'a Value> {
    let text = |adapter: &Value, key: &str| adapter[key].as_str().unwrap_or_default().to_lowercase();
    let is_meant = |adapter: &&Value| {
        let is_of_kind = (text(adapter, "kind") == "software") == is_dry;
        let is_named = name.is_none_or(|name| text(adapter, "name").contains(&name.to_lowercase()));
        is_of_kind && is_named && adapter["verdict"].get("Ok").is_some()
    };
    adapters.iter().find(is_meant)
}

/// What there is instead of such an adapter.
pub fn instead(
    adapters: &[Value],
    has_loader: bool,
    manifests: &[PathBuf],
    is_dry: bool,
    name: Option<&str>,
) -> String {
    let kind = if is_dry { "software adapter" } else { "graphics card" };
    let mut text = match name {
        Some(name) => format!("there is no {kind} called `{name}` that computes what it should"),
        None => format!("there is no {kind} that computes what it should"),
    };
    text += match (has_loader, manifests.is_empty()) {
        (false, _) => "\nfound: no Vulkan loader (libvulkan.so.1; Debian: libvulkan1)",
        (true, true) => {
            "\nfound: a Vulkan loader, and no driver's manifest (a .json in /usr/share/vulkan/icd.d)"
        }
        (true, false) => "\nfound: a Vulkan loader and manifests of drivers:",
    };
    manifests.iter().for_each(|manifest| text += &format!("\n    {}", manifest.display()));
    if adapters.is_empty() {
        text += "\nfound: no adapter";
    }
    for adapter in adapters {
        let word = |key: &str| adapter[key].as_str().unwrap_or("?");
        let verdict = adapter["verdict"]["Err"].as_str().unwrap_or("right");
        text +=
            &format!("\nfound: {} ({}, {}); answers: {verdict}", word("name"), word("kind"), word("driver"));
    }
    if !is_dry {
        text += "\nto see that everything runs without a card, on a software adapter (Debian: mesa-vulkan-drivers): card.sh run --dry OUT";
    }
    text
}
