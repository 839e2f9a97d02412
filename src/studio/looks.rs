//! What pages hear of looks: as the scene's text has them, what they may name, and the table of a transfer function.

use serde_json::Value;

use super::live::{Live, Rows, Subject};
use super::messages::{Told, ViewRecord};
use super::screen::Screen;
use crate::Error;
use crate::scene::Image;

/// Tells all pages of looks, of which the previews are that `rows` are kept for. A volume has none.
pub(super) fn tell(looks: &Value, rows: &Rows, screen: &mut Screen) {
    let Subject::LightMap(scene) = &rows.subject else { return };
    let transfer = rows.live.transfer().and_then(|function| function.tables().first());
    let air = rows.live.air().and_then(|air| air.fields().first()).map(|(_, field)| field);
    screen.tell(&Told::Looks {
        looks,
        names: &rows.names,
        texels: scene.shadow_map.size.into_iter().max().unwrap_or(1),
        metres_per_unit: rows.subject.metres_per_unit(),
        far: transfer.map(|table| table.far),
        places: transfer.map_or(&[], |table| &table.places),
        air_size: air.map(|field| field.noise_size()),
        air_voxel: air.map(|field| field.grid().voxel()),
    });
    if let Some(Ok(table)) = transfer.map(|table| Image::new(table.size, table.texels.clone())) {
        screen.show_transfer(&table);
    }
}

/// Tells a page what it sees at a pixel of the full picture of a view: names that looks may use.
pub(super) fn tell_what(page: u64, (view, [x, y]): (usize, [f64; 2]), rows: &Rows, screen: &Screen) {
    let (Live::LightMap(live), Subject::LightMap(scene)) = (&rows.live, &rows.subject) else { return };
    let Some(ViewRecord { name, size, .. }) = rows.records.get(view) else { return };
    let at = [x / size[0] as f64, y / size[1] as f64].map(|part| part.clamp(0.0, 1.0));
    let triangle = live.triangle_at(name, at).ok().flatten();
    let object = triangle.map(|triangle| scene.mesh.object(triangle));
    let material = triangle.map(|triangle| scene.mesh.material(triangle));
    let told = Told::Seen {
        view,
        x,
        y,
        object: object.and_then(|object| object.name.as_deref()),
        material: material.and_then(|material| material.name.as_deref()),
        occluder: object.map(|object| object.occluder),
    };
    screen.answer(page, &told);
}

/// What is wrong, in a sentence for somebody who has not written the scene's text: without its lines.
pub(super) fn sentence(error: &Error) -> String {
    match error {
        Error::Scene { path, problem, suggestion, .. } => {
            let hint =
                suggestion.as_ref().map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
            format!("{path}: {problem}{hint}")
        }
        other => other.to_string(),
    }
}
