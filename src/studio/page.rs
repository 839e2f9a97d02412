//! The files of the page, which are part of the program.

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        const FILES: &[(&str, &str)] = &[$(($name, include_str!(concat!("page/", $name)))),*];
    };
}

files!(
    "actions.js",
    "air.js",
    "brush.js",
    "camera.js",
    "canvas.js",
    "colour.js",
    "controls.js",
    "dom.js",
    "edits.js",
    "free.js",
    "groups.js",
    "index.html",
    "keys.js",
    "light.js",
    "looks.js",
    "overlay.js",
    "palette.js",
    "picker.js",
    "plane.js",
    "pointer.js",
    "points.js",
    "select.js",
    "sender.js",
    "socket.js",
    "state.js",
    "status.js",
    "strokes.js",
    "studio.css",
    "studio.js",
    "surfaces.js",
    "table.js",
    "toasts.js",
    "tools.js",
    "transfer.js",
    "views.js",
);

/// The kind of a file of the page, and its text.
pub(super) fn file(name: &str) -> Option<(&'static str, &'static str)> {
    let (name, text) = FILES.iter().find(|(known, _)| *known == name)?;
    let kind = match name.rsplit('.').next() {
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        _ => "text/html; charset=utf-8",
    };
    Some((kind, text))
}
