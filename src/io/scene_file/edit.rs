//! Changes in the text of a scene file that leave the rest of it as it is: its order, its spacing, its numbers as they were written.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use serde_json::Value;
use serde_json::value::RawValue;

use super::channels::Channels;
use super::map::Extent;
use super::stroke::{Group, Stroke};
use super::view::View;
use super::write::text_of_value;
use crate::{Error, Result};

/// The parts of a scene that are edited, as they stand in its text.
#[derive(Deserialize)]
struct Parts<'t> {
    #[serde(borrow)]
    views: Vec<&'t RawValue>,
    #[serde(borrow, default)]
    light_map: Option<&'t RawValue>,
    #[serde(borrow, default)]
    groups: Option<&'t RawValue>,
    #[serde(borrow, default)]
    looks: Option<&'t RawValue>,
    #[serde(borrow, default)]
    light: Option<&'t RawValue>,
    #[serde(borrow, default)]
    medium: Option<&'t RawValue>,
}

#[derive(Deserialize)]
struct LightParts<'t> {
    #[serde(borrow, default)]
    direction: Option<&'t RawValue>,
    #[serde(borrow, default)]
    gltf: Option<&'t RawValue>,
    #[serde(borrow, default)]
    radiance: Option<&'t RawValue>,
}

#[derive(Deserialize)]
struct MediumParts<'t> {
    #[serde(borrow)]
    sigma_t: &'t RawValue,
}

#[derive(Deserialize)]
struct ViewParts<'t> {
    #[serde(borrow, default)]
    strokes: Option<&'t RawValue>,
}

#[derive(Deserialize)]
struct LightMapParts<'t> {
    #[serde(borrow, default)]
    extent: Option<&'t RawValue>,
}

/// A change of a text.
struct Splice {
    at: Range<usize>,
    by: String,
}

/// The strokes of each view of a scene, as its text has them.
///
/// Errors: [`Error::Machine`] for a text that is no scene with views; it has been read before.
pub fn strokes(text: &str) -> Result<Vec<Vec<Stroke>>> {
    let of_view = |view: &&RawValue| -> Result<Vec<Stroke>> {
        let view: ViewParts<'_> = parsed(view.get())?;
        view.strokes.map_or(Ok(Vec::new()), |strokes| parsed(strokes.get()))
    };
    parsed::<Parts<'_>>(text)?.views.iter().map(of_view).collect()
}

/// The text of a scene with other strokes, a list a view. Strokes that were there keep the text that they had.
///
/// Errors: as [`strokes`]; [`Error::Shape`] for another number of views.
pub fn with_strokes(text: &str, strokes: &[Vec<Stroke>]) -> Result<String> {
    let parts: Parts<'_> = parsed(text)?;
    if parts.views.len() != strokes.len() {
        return Err(Error::Shape { what: "the views", expected: parts.views.len(), got: strokes.len() });
    }
    let mut splices = Vec::new();
    for (view, strokes) in parts.views.iter().zip(strokes) {
        let known: ViewParts<'_> = parsed(view.get())?;
        let written: Vec<&RawValue> = known.strokes.map_or(Ok(Vec::new()), |list| parsed(list.get()))?;
        let before = written.iter().map(|stroke| parsed(stroke.get())).collect::<Result<Vec<Stroke>>>()?;
        if before == *strokes {
            continue;
        }
        let indent = indent_of_members(text, place(text, view.get()).start);
        let line = |stroke: &Stroke| {
            let kept = before.iter().position(|it| it == stroke).map(|index| written[index].get().to_owned());
            kept.map_or_else(|| on_one_line(&serde_json::to_value(stroke)), Ok)
        };
        let lines = strokes.iter().map(line).collect::<Result<Vec<_>>>()?;
        let list = listed(&lines, &indent);
        splices.push(match known.strokes {
            Some(strokes) => Splice { at: place(text, strokes.get()), by: list },
            None => member(text, view.get(), "strokes", &list),
        });
    }
    Ok(spliced(text, splices))
}

/// The groups of a scene.
///
/// Errors: as [`strokes`].
pub fn groups(text: &str) -> Result<Vec<Group>> {
    parsed::<Parts<'_>>(text)?.groups.map_or(Ok(Vec::new()), |groups| parsed(groups.get()))
}

/// The text of a scene with other groups.
///
/// Errors: as [`strokes`].
pub fn with_groups(text: &str, groups: &[Group]) -> Result<String> {
    if self::groups(text)? == groups {
        return Ok(text.to_owned());
    }
    let indent = indent_of_members(text, place(text, text.trim()).start);
    let lines = groups.iter().map(|group| on_one_line(&serde_json::to_value(group)));
    let list = listed(&lines.collect::<Result<Vec<_>>>()?, &indent);
    let splice = match parsed::<Parts<'_>>(text)?.groups {
        Some(written) => Splice { at: place(text, written.get()), by: list },
        None => member(text, text.trim(), "groups", &list),
    };
    Ok(spliced(text, vec![splice]))
}

/// The looks of a scene as its text has them, without defaults; an empty object where it has none.
///
/// Errors: as [`strokes`].
pub fn looks(text: &str) -> Result<Value> {
    parsed::<Parts<'_>>(text)?.looks.map_or(Ok(Value::Object(Default::default())), |it| parsed(it.get()))
}

/// The text of a scene with other looks. Members of them that are as they were keep the text that they had. Whether they can be built is
/// said when the scene is read.
///
/// Errors: as [`strokes`].
pub fn with_looks(text: &str, looks: &Value) -> Result<String> {
    if is_same(&self::looks(text)?, looks) {
        return Ok(text.to_owned());
    }
    let Some(written) = parsed::<Parts<'_>>(text)?.looks else {
        let indent = indent_of_members(text, place(text, text.trim()).start);
        return Ok(spliced(text, vec![member(text, text.trim(), "looks", &on_lines(looks, &indent))]));
    };
    let indent = indent_at(text, place(text, written.get()).start);
    let whole = Splice { at: place(text, written.get()), by: on_lines(looks, &indent) };
    let (Some(members), Ok(before)) =
        (looks.as_object(), parsed::<BTreeMap<String, &RawValue>>(written.get()))
    else {
        return Ok(spliced(text, vec![whole]));
    };
    let mut splices = Vec::new();
    for (name, value) in members {
        match before.get(name) {
            Some(kept) if is_same(&parsed(kept.get())?, value) => {}
            Some(other) => {
                let at = place(text, other.get());
                splices.push(Splice { by: on_lines(value, &indent_at(text, at.start)), at });
            }
            None => {
                let indent = indent_of_members(text, place(text, written.get()).start);
                splices.push(member(text, written.get(), name, &on_lines(value, &indent)));
            }
        }
    }
    // Where a member goes, its comma goes along; and the first of some has none.
    let is_anew = before.is_empty() || before.keys().any(|name| !members.contains_key(name));
    Ok(spliced(text, if is_anew { vec![whole] } else { splices }))
}

/// The text of a scene with more views behind its own.
///
/// Errors: as [`strokes`].
pub fn with_views(text: &str, more: &[View]) -> Result<String> {
    let Some(last) = parsed::<Parts<'_>>(text)?.views.last().map(|view| place(text, view.get())) else {
        return Err(Error::Machine("the scene cannot be edited: it has no view".to_owned()));
    };
    // As the last one begins: on a line of its own, or behind it.
    let before = &text[..last.start];
    let blank = before.len() - before.trim_end().len();
    let space = &before[before.len() - blank..];
    let lines = more.iter().map(|view| on_one_line(&serde_json::to_value(view)));
    let lines = lines.collect::<Result<Vec<_>>>()?;
    let space = if space.contains('\n') { space } else { " " };
    let by = lines.iter().map(|line| format!(",{space}{line}")).collect();
    Ok(spliced(text, vec![Splice { at: last.end..last.end, by }]))
}

/// The text of a scene whose sun shines in another direction. One that comes from a model is no longer taken from there, and so has the
/// `radiance` that it had.
///
/// Errors: as [`strokes`].
pub fn with_sun(text: &str, direction: [f64; 3], radiance: [f32; 3]) -> Result<String> {
    let Some(light) = parsed::<Parts<'_>>(text)?.light else {
        return Err(Error::Machine("the scene cannot be edited: it has no light".to_owned()));
    };
    let parts: LightParts<'_> = parsed(light.get())?;
    let direction = on_one_line(&serde_json::to_value(direction))?;
    let mut splices = Vec::new();
    match (parts.direction, parts.gltf) {
        (Some(written), _) => splices.push(Splice { at: place(text, written.get()), by: direction }),
        (None, None) => splices.push(member(text, light.get(), "direction", &direction)),
        (None, Some(gltf)) => {
            let value = place(text, gltf.get());
            let name = text[..value.start].rfind("\"gltf\"").unwrap_or(value.start);
            let mut by = format!("\"direction\": {direction}");
            if parts.radiance.is_none() {
                by += &format!(", \"radiance\": {}", on_one_line(&serde_json::to_value(radiance))?);
            }
            splices.push(Splice { at: name..value.end, by });
        }
    }
    Ok(spliced(text, splices))
}

/// The text of a scene with denser or thinner air: of that mean extinction in 1/metre, in its proportions.
///
/// Errors: as [`strokes`].
pub fn with_extinction(text: &str, mean: f64) -> Result<String> {
    let Some(medium) = parsed::<Parts<'_>>(text)?.medium else {
        return Err(Error::Machine("the scene cannot be edited: it has no medium".to_owned()));
    };
    let written = parsed::<MediumParts<'_>>(medium.get())?.sigma_t;
    let value = match parsed::<Channels>(written.get())? {
        Channels::Grey(_) => serde_json::to_value(mean),
        Channels::Rgb(colors) => {
            let before: f64 = colors.iter().sum::<f64>() / 3.0;
            serde_json::to_value(colors.map(|color| color * mean / before))
        }
    };
    Ok(spliced(text, vec![Splice { at: place(text, written.get()), by: on_one_line(&value)? }]))
}

/// Where a scene says that its light map lies.
///
/// Errors: as [`strokes`].
pub fn light_map_extent(text: &str) -> Result<Option<Extent>> {
    let Some(map) = parsed::<Parts<'_>>(text)?.light_map else { return Ok(None) };
    parsed::<LightMapParts<'_>>(map.get())?.extent.map(|extent| parsed(extent.get())).transpose()
}

/// The text of a scene whose light map lies somewhere.
///
/// Errors: as [`strokes`].
pub fn with_light_map_at(text: &str, extent: &Extent) -> Result<String> {
    if light_map_extent(text)?.as_ref() == Some(extent) {
        return Ok(text.to_owned());
    }
    let parts: Parts<'_> = parsed(text)?;
    let written = on_one_line(&serde_json::to_value(extent))?;
    let splice = match parts.light_map {
        None => member(text, text.trim(), "light_map", &format!("{{ \"extent\": {written} }}")),
        Some(map) => match parsed::<LightMapParts<'_>>(map.get())?.extent {
            None => member(text, map.get(), "extent", &written),
            Some(extent) => Splice { at: place(text, extent.get()), by: written },
        },
    };
    Ok(spliced(text, vec![splice]))
}

/// A list of a line each.
fn listed(lines: &[String], indent: &str) -> String {
    match lines {
        [] => "[]".to_owned(),
        lines => format!("[\n{indent}  {}\n{indent}]", lines.join(&format!(",\n{indent}  "))),
    }
}

/// Whether two values say the same, however their numbers are written.
fn is_same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one.as_f64() == other.as_f64(),
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| is_same(one, other))
        }
        (Value::Object(one), Value::Object(other)) => {
            let has = |(name, value): (&String, &Value)| other.get(name).is_some_and(|it| is_same(value, it));
            one.len() == other.len() && one.iter().all(has)
        }
        _ => one == other,
    }
}

/// JSON on as many lines as it needs, behind the name of a member that is indented so; what no document has is left to be complained about.
fn on_lines(value: &Value, indent: &str) -> String {
    match text_of_value(value) {
        Ok(text) if *value != Value::Object(Default::default()) => {
            text.trim_end().replace('\n', &format!("\n{indent}"))
        }
        _ => value.to_string(),
    }
}

fn parsed<'t, T: Deserialize<'t>>(text: &'t str) -> Result<T> {
    serde_json::from_str(text).map_err(|error| Error::Machine(format!("the scene cannot be edited: {error}")))
}

/// Where a part of a text lies in it.
fn place(text: &str, part: &str) -> Range<usize> {
    let start = part.as_ptr() as usize - text.as_ptr() as usize;
    start..start + part.len()
}

/// A member more at the end of an object.
fn member(text: &str, object: &str, name: &str, value: &str) -> Splice {
    let Range { start, end } = place(text, object);
    let inside = &object[1..object.len() - 1];
    let is_empty = inside.trim().is_empty();
    let at = end - 1 - (inside.len() - inside.trim_end().len());
    let comma = if is_empty { "" } else { "," };
    // On a line of its own where the others are.
    let space = match inside.contains('\n') {
        true => format!("\n{}", indent_of_members(text, start)),
        false => " ".to_owned(),
    };
    Splice { at: at..at, by: format!("{comma}{space}\"{name}\": {value}{}", if is_empty { " " } else { "" }) }
}

/// How far the members of an object are indented that begins at `start`: as the first of them is, else a little more than its line.
fn indent_of_members(text: &str, start: usize) -> String {
    let behind = &text[start + 1..];
    let to_first = behind.len() - behind.trim_start().len();
    match behind[..to_first].rfind('\n') {
        Some(at) => behind[at + 1..to_first].to_owned(),
        None => format!("{}  ", indent_at(text, start)),
    }
}

/// How far the line is indented on which a place lies.
fn indent_at(text: &str, at: usize) -> String {
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    text[line..].chars().take_while(|c| *c == ' ' || *c == '\t').collect()
}

fn spliced(text: &str, mut splices: Vec<Splice>) -> String {
    splices.sort_by_key(|splice| splice.at.start);
    let mut edited = String::with_capacity(text.len());
    let mut from = 0;
    for Splice { at, by } in splices {
        edited += &text[from..at.start];
        edited += &by;
        from = at.end;
    }
    edited + &text[from..]
}

/// JSON with a space behind each comma and colon and inside braces.
fn on_one_line(value: &serde_json::Result<Value>) -> Result<String> {
    fn shown(value: &Value) -> String {
        match value {
            Value::Array(items) => {
                format!("[{}]", items.iter().map(shown).collect::<Vec<_>>().join(", "))
            }
            Value::Object(members) => {
                let members = members
                    .iter()
                    .map(|(name, value)| format!("{}: {}", Value::from(name.as_str()), shown(value)));
                format!("{{ {} }}", members.collect::<Vec<_>>().join(", "))
            }
            // Whole numbers as people write them.
            Value::Number(number) => match number.as_f64() {
                Some(whole) if whole.fract() == 0.0 && whole.abs() < 1e15 => format!("{whole}"),
                _ => number.to_string(),
            },
            other => other.to_string(),
        }
    }
    match value {
        Ok(value) => Ok(shown(value)),
        Err(error) => Err(Error::Machine(format!("the scene cannot be edited: {error}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::scene_file::{Camera, Paint, Transform};

    const TEXT: &str = r##"{
    "version": 1,   "views": [
      { "name": "a", "camera":{ "size":[64,48] }, "keep": 0.50 },
      {
        "name": "b",
        "strokes": [ { "points": [[1, 2.0], [3e0, 4]],  "radius": 5, "color": "#f80" } ]
      }
    ],
    "ambient": [0.10, 0.2, 0.30]
}
"##;

    fn dab(x: f64) -> Stroke {
        Stroke::new(vec![[x, 2.5]], 3.0, Paint::Hex([255, 136, 0]))
    }

    #[test]
    fn what_is_not_edited_stays_byte_by_byte() {
        let before = strokes(TEXT).unwrap();
        assert_eq!([before[0].len(), before[1].len()], [0, 1]);
        assert_eq!(with_strokes(TEXT, &before).unwrap(), TEXT);
        let more = vec![vec![], vec![before[1][0].clone(), dab(9.0)]];
        let edited = with_strokes(TEXT, &more).unwrap();
        assert_eq!(strokes(&edited).unwrap(), more);
        // The old stroke as it was written, and everything around the list.
        assert!(edited.contains(r##"{ "points": [[1, 2.0], [3e0, 4]],  "radius": 5, "color": "#f80" }"##));
        assert!(edited.contains(
            "\n          { \"points\": [[9, 2.5]], \"radius\": 3, \"color\": \"#ff8800\" }\n        ]\n      }\n"
        ));
        let (head, tail) = (TEXT.find("[ { \"points").unwrap(), TEXT.rfind("      }\n").unwrap());
        assert_eq!(edited[..head], TEXT[..head]);
        assert!(edited.ends_with(&TEXT[tail..]));
        // And back.
        let none = with_strokes(&edited, &[vec![], vec![]]).unwrap();
        assert!(none.contains("\"strokes\": []") && strokes(&none).unwrap()[1].is_empty());
    }

    #[test]
    fn a_view_without_strokes_gets_some_at_its_end() {
        let before = strokes(TEXT).unwrap();
        let edited = with_strokes(TEXT, &[vec![dab(1.0)], before[1].clone()]).unwrap();
        assert_eq!(strokes(&edited).unwrap()[0], [dab(1.0)]);
        assert!(edited.contains(r#""keep": 0.50, "strokes": ["#), "{edited}");
        let empty = r#"{"views":[{}]}"#;
        assert_eq!(strokes(&with_strokes(empty, &[vec![dab(1.0)]]).unwrap()).unwrap()[0], [dab(1.0)]);
    }

    #[test]
    fn the_place_of_the_light_map_is_put_in_and_put_elsewhere() {
        let extent = Extent { min: [-1.5, 0.1], max: [2.0, 3.0] };
        let edited = with_light_map_at(TEXT, &extent).unwrap();
        let said = "\n    \"light_map\": { \"extent\": { \"min\": [-1.5, 0.1], \"max\": [2, 3] } }\n}\n";
        assert!(edited.ends_with(&format!("\"ambient\": [0.10, 0.2, 0.30],{said}")), "{edited}");
        assert_eq!(with_light_map_at(&edited, &extent).unwrap(), edited);
        assert_eq!(
            [light_map_extent(TEXT).unwrap(), light_map_extent(&edited).unwrap()],
            [None, Some(extent.clone())]
        );
        let elsewhere = Extent { min: [0.0, 0.1], ..extent.clone() };
        let moved = with_light_map_at(&edited, &elsewhere).unwrap();
        assert_eq!(moved, edited.replace("\"min\": [-1.5, 0.1]", "\"min\": [0, 0.1]"));
        let with_size = TEXT.replace("\"ambient\"", "\"light_map\": { \"size\": 64 },\n    \"ambient\"");
        let edited = with_light_map_at(&with_size, &extent).unwrap();
        assert!(edited.contains("{ \"size\": 64, \"extent\": { \"min\": [-1.5, 0.1]"), "{edited}");
    }

    #[test]
    fn groups_views_sun_and_fog_are_put_where_they_belong() {
        let group = Group { name: "warm".to_owned(), hidden: true, weight: 1.0 };
        let edited = with_groups(TEXT, std::slice::from_ref(&group)).unwrap();
        assert!(edited.ends_with(
            "[0.10, 0.2, 0.30],\n    \"groups\": [\n      { \"name\": \"warm\", \"hidden\": true }\n    ]\n}\n"
        ), "{edited}");
        assert_eq!(groups(&edited).unwrap(), [group]);
        assert_eq!(with_groups(&edited, &groups(&edited).unwrap()).unwrap(), edited);
        assert!(with_groups(&edited, &[]).unwrap().contains("\"groups\": []"));

        let camera = Camera::new(Transform::default(), 40.0, [8, 6]);
        let view = View { strokes: vec![dab(1.0)], ..View::new("c".to_owned(), camera) };
        let edited = with_views(TEXT, &[view.clone(), view]).unwrap();
        assert_eq!(strokes(&edited).unwrap().len(), 4);
        assert!(edited.contains("      },\n      {"), "{edited}");
        assert!(with_views("{\"views\":[{}]}", &[]).unwrap() == "{\"views\":[{}]}");

        let light =
            |text: &str| TEXT.replace("\"version\": 1,", &format!("\"version\": 1, \"light\": {text},"));
        let turned = |text: &str| with_sun(&light(text), [0.0, -1.0, 0.5], [1.0, 0.5, 0.25]).unwrap();
        assert_eq!(turned(r#"{"direction":[1,2,3]}"#), light(r#"{"direction":[0, -1, 0.5]}"#));
        assert_eq!(
            turned(r#"{ "gltf": { "file": "a.glb" } }"#),
            light(r#"{ "direction": [0, -1, 0.5], "radiance": [1, 0.5, 0.25] }"#)
        );
        assert_eq!(
            turned(r#"{ "radiance": 4, "gltf": { "file": "a.glb" } }"#),
            light(r#"{ "radiance": 4, "direction": [0, -1, 0.5] }"#)
        );

        let air =
            |text: &str| TEXT.replace("\"version\": 1,", &format!("\"version\": 1, \"medium\": {text},"));
        assert_eq!(
            with_extinction(&air(r#"{"sigma_t": 0.5 }"#), 0.25).unwrap(),
            air(r#"{"sigma_t": 0.25 }"#)
        );
        assert_eq!(
            with_extinction(&air(r#"{"sigma_t":[1,2,3]}"#), 4.0).unwrap(),
            air(r#"{"sigma_t":[2, 4, 6]}"#)
        );
    }

    #[test]
    fn looks_are_put_in_and_what_of_them_is_as_it_was_keeps_its_text() {
        let parsed = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        assert_eq!(looks(TEXT).unwrap(), parsed("{}"));
        assert_eq!(with_looks(TEXT, &parsed("{}")).unwrap(), TEXT);
        let fill = parsed(r#"{ "occluders": [{ "fill": { "texels": 6 } }] }"#);
        let edited = with_looks(TEXT, &fill).unwrap();
        let said = "    \"looks\": {\n      \"occluders\": [{ \"fill\": { \"texels\": 6 } }]\n    }\n}\n";
        assert!(edited.ends_with(said), "{edited}");
        assert_eq!(looks(&edited).unwrap(), fill);
        // Numbers and spaces of what has not changed.
        let by_hand = edited.replace("{ \"texels\": 6 }", "{\"texels\" :6e0}");
        assert_eq!(with_looks(&by_hand, &fill).unwrap(), by_hand);
        let mut more = fill;
        more["transfer"] = parsed(r##"{ "far": 60, "layers": [{ "solid": { "color": "#ff8020" } }] }"##);
        let both = with_looks(&by_hand, &more).unwrap();
        let said = r##"{"texels" :6e0} }],
      "transfer": {
        "far": 60,
        "layers": [{ "solid": { "color": "#ff8020" } }]
      }
    }
}
"##;
        assert!(both.ends_with(said), "{both}");
        more["transfer"]["far"] = 30.into();
        assert_eq!(with_looks(&both, &more).unwrap(), both.replace("60", "30"));
        // Without one of them, and without all.
        more.as_object_mut().unwrap().remove("occluders");
        let one = with_looks(&both, &more).unwrap();
        assert_eq!(looks(&one).unwrap(), more);
        assert!(one.starts_with(&both[..both.find("\"looks\"").unwrap()]), "{one}");
        let none = with_looks(&one, &parsed("{}")).unwrap();
        assert!(none.ends_with("\"looks\": {}\n}\n"), "{none}");
        let two = parsed(r#"{ "occluders": [], "transfer": { "far": 1 } }"#);
        assert_eq!(looks(&with_looks(&none, &two).unwrap()).unwrap(), two);
        // What cannot be a look is there to be complained about.
        assert!(with_looks(TEXT, &Value::Null).unwrap().ends_with("\"looks\": null\n}\n"));
    }

    #[test]
    fn another_number_of_views_is_refused() {
        assert!(matches!(with_strokes(TEXT, &[vec![]]), Err(Error::Shape { .. })));
    }
}
