//! What sections of the page of a benchmark are made of.

use super::scatter::{Group, Mark, Scatter, scatter};
use crate::Result;

pub(super) fn figure(chart: &Scatter) -> Result<String> {
    if chart.groups.is_empty() {
        return Ok(String::new());
    }
    Ok(format!("<figure class=\"chart wide\">{}</figure>\n", without_namespace(&scatter(chart)?)))
}

/// Inside HTML the namespace is understood, and a page without any address is plainly offline.
pub(super) fn without_namespace(svg: &str) -> String {
    svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
}

/// Puts a mark into the group of a name, or makes that group.
pub(super) fn put(groups: &mut Vec<Group>, label: String, joined: bool, mark: Mark) {
    match groups.iter_mut().find(|group| group.label == label) {
        Some(group) => group.marks.push(mark),
        None => groups.push(Group { label, joined, marks: vec![mark] }),
    }
}

/// An exponent in words.
pub(super) fn power(exponent: Option<f64>) -> String {
    exponent.map_or("–".to_owned(), |exponent| format!("{exponent:.2}").replace('-', "−"))
}
