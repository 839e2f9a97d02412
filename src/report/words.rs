//! Numbers and names as a person reads them.

use crate::problem::Nouns;

/// No line break between a number and its unit.
const GAP: char = '\u{a0}';

/// A count: `41,238`, from ten million on `11.6 M`.
pub(super) fn count(n: u64) -> String {
    let scaled = |divisor: f64, letter: char| format!("{}{GAP}{letter}", digits(n as f64 / divisor, 3));
    match n {
        10_000_000_000.. => scaled(1e9, 'G'),
        10_000_000.. => scaled(1e6, 'M'),
        _ => grouped(n),
    }
}

/// A count and its noun: `1 view`, `3 views`.
pub(super) fn counted(n: u64, noun: &str) -> String {
    let plural = if n == 1 { "" } else { "s" };
    format!("{}{GAP}{noun}{plural}", count(n))
}

fn grouped(n: u64) -> String {
    let plain = n.to_string();
    let mut text = String::with_capacity(plain.len() + plain.len() / 3);
    for (index, digit) in plain.chars().enumerate() {
        if index > 0 && (plain.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Memory in powers of 1000: `93 MB`.
pub(super) fn bytes(n: u64) -> String {
    let mut value = n as f64;
    let mut unit = "bytes";
    for next in ["kB", "MB", "GB", "TB", "PB"] {
        if value < 999.5 {
            break;
        }
        value /= 1000.0;
        unit = next;
    }
    format!("{}{GAP}{unit}", digits(value, if value < 10.0 && unit != "bytes" { 2 } else { 3 }))
}

/// A duration: `0.42 s`, `3.1 ms`, `2 min 5 s`.
pub(super) fn seconds(s: f64) -> String {
    if s >= 3600.0 {
        let minutes = (s / 60.0).round();
        return format!("{}{GAP}h {}{GAP}min", (minutes / 60.0).floor(), minutes % 60.0);
    }
    if s >= 99.5 {
        return format!("{}{GAP}min {}{GAP}s", (s.round() / 60.0).floor(), s.round() % 60.0);
    }
    match s {
        _ if s >= 0.1 || s <= 0.0 => format!("{}{GAP}s", digits(s, if s < 10.0 { 2 } else { 3 })),
        _ if s >= 1e-4 => format!("{}{GAP}ms", digits(s * 1e3, 2)),
        _ => format!("{}{GAP}µs", digits(s * 1e6, 2)),
    }
}

/// A part of one in percent: `8.1 %`.
pub(super) fn percent(part: f64) -> String {
    let hundredths = part * 100.0;
    let text = if hundredths > 0.0 && hundredths < 0.01 {
        "< 0.01".into()
    } else if hundredths > 99.95 && hundredths < 100.0 {
        // Rounding up to the whole would say that nothing is missing.
        "> 99.9".into()
    } else {
        digits(hundredths, if hundredths < 10.0 { 2 } else { 3 })
    };
    format!("{text}{GAP}%")
}

/// A part of a whole; 0 where the whole is nothing.
pub(super) fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

/// An angle: `7.3°`.
pub(super) fn degrees(angle: f64) -> String {
    format!("{}°", digits(angle, if angle < 10.0 { 2 } else { 3 }))
}

/// A number of any size: `0.0031`, `2.1 · 10⁻⁷`.
pub(super) fn number(x: f64) -> String {
    let magnitude = x.abs();
    if magnitude == 0.0 || (1e-3..1e5).contains(&magnitude) {
        return digits(x, 3);
    }
    let text = format!("{x:.1e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let mantissa = mantissa.strip_suffix(".0").unwrap_or(mantissa);
            let power = format!("10{}", superscript(exponent));
            if mantissa == "1" { power } else { format!("{mantissa}{GAP}·{GAP}{power}") }
        }
        None => text,
    }
}

fn superscript(text: &str) -> String {
    let raised = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' | '4'..='9' => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).unwrap_or(c),
        other => other,
    };
    text.chars().map(raised).collect()
}

/// `x` with so many significant digits but no fewer than its whole part has.
fn digits(x: f64, significant: i32) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let magnitude = x.abs().log10().floor().clamp(-300.0, 300.0) as i32;
    let decimals = (significant - 1 - magnitude).max(0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A field name as a heading: `ray_walks` becomes `Ray walks`.
pub(super) fn label(name: &str) -> String {
    let spaced = name.replace(['_', '-'], " ");
    let mut letters = spaced.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

/// What a name of `Report::skipped` means, where elements are called so.
pub(super) fn skipped(name: &str, elements: &str) -> String {
    match name {
        "pixels" => "Pixels of which nothing is wanted: no ray is followed through them".into(),
        "unknowns" => format!("{} that no row reaches: they are no unknowns", label(elements)),
        "shadowed_cells" => "Stretches of rays in shadow: passed over in large steps".into(),
        "dark_rays" => "Rays whose far end is cut off, because next to no light arrives from there".into(),
        "channel_iterations" => "Iterations of colour channels that had already converged".into(),
        "empty_bricks" => "Bricks of 8 × 8 × 8 cells with nothing in them: passed in one step".into(),
        "outside_hull" => {
            format!("{} outside the visual hull of the masks: they are no unknowns", label(elements))
        }
        "beside" => "Wanted pixels whose rays meet nothing that is looked for: they are no rows".into(),
        "without_logarithm" => {
            "Pixels that no extinction explains: brighter or darker than background and medium".into()
        }
        "held_out" => "Pixels kept out of the fit, which tell what of the others is noise".into(),
        "walks" => "Ray walks that keeping the non-zeros in memory saved".into(),
        other => label(other),
    }
}

/// Why a solve stopped, to follow “It stopped”.
pub(super) fn stopped(reason: &str, Nouns { found, wanted, .. }: &Nouns) -> String {
    match reason {
        "tolerance" => format!("because the {found} could no longer be improved noticeably"),
        "discrepancy" => format!("because the {wanted} is met as closely as its noise allows"),
        "held-out" => {
            "because what still improved was noise: pixels that were kept out of the fit came no nearer"
                .into()
        }
        "stagnation" => "at rounding level: no further digit can be gained".into(),
        "iterations" => "at its iteration limit, so more iterations may still improve it".into(),
        "time" => "at its time limit, so more time may still improve it".into(),
        "interrupted" => "because it was interrupted".into(),
        other => format!("with the reason “{}”", label(other).to_lowercase()),
    }
}

/// Text that may stand in HTML and in SVG, between tags and inside quoted attributes. Control characters,
/// which XML does not know, are left out.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\u{fffe}' | '\u{ffff}' => {}
            c if c.is_control() && c != '\n' && c != '\t' => {}
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(text: String) -> String {
        text.replace(GAP, " ")
    }

    #[test]
    fn numbers_read_as_a_person_writes_them() {
        for (got, want) in [
            (count(0), "0"),
            (count(999), "999"),
            (count(41_238), "41,238"),
            (count(1_000_000), "1,000,000"),
            (count(11_640_000), "11.6 M"),
            (count(u64::MAX), "18446744074 G"),
            (counted(1, "view"), "1 view"),
            (counted(3, "view"), "3 views"),
            (bytes(0), "0 bytes"),
            (bytes(93_123_456), "93.1 MB"),
            (bytes(1_200), "1.2 kB"),
            (bytes(999_999), "1 MB"),
            (seconds(0.0), "0 s"),
            (seconds(0.42), "0.42 s"),
            (seconds(1.239), "1.2 s"),
            (seconds(0.0031), "3.1 ms"),
            (seconds(125.2), "2 min 5 s"),
            (seconds(119.7), "2 min 0 s"),
            (seconds(7250.0), "2 h 1 min"),
            (percent(0.0812), "8.1 %"),
            (percent(1.0), "100 %"),
            (percent(0.9999), "> 99.9 %"),
            (percent(1e-9), "< 0.01 %"),
            (degrees(7.31), "7.3°"),
            (number(0.0), "0"),
            (number(0.001953125), "0.00195"),
            (number(2.14e-7), "2.1 · 10⁻⁷"),
            (number(1e-16), "10⁻¹⁶"),
            (label("ray_walks"), "Ray walks"),
        ] {
            assert_eq!(plain(got), want);
        }
    }

    #[test]
    fn escaped_text_cannot_leave_its_place() {
        assert_eq!(escaped("<b a='\"'>&\u{0}\u{1b}é"), "&lt;b a=&#39;&quot;&#39;&gt;&amp;é");
    }
}
