//! Radiance HDR: a header of text, then scan lines of three mantissas and one exponent.

use std::io::{BufRead, ErrorKind, Read};
use std::path::Path;

use super::{PictureFormat, check_size, file_error, format_error, room};
use crate::Result;

/// The values of Radiance's header that say how to read the pixels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RadianceHeader {
    pub(super) size: [usize; 2],
    /// Whether a scan line is a column.
    is_upright: bool,
    /// Whether columns go left, and rows up.
    is_reversed: [bool; 2],
    /// What the stored colours were multiplied by.
    exposure: [f64; 3],
}

/// Bytes of a line of the header at most, and lines.
const LINE: u64 = 1 << 16;
const LINES: usize = 1 << 12;

impl RadianceHeader {
    /// Reads up to the first scan line.
    pub(super) fn read(path: &Path, file: &mut impl BufRead) -> Result<Self> {
        let wrong = |reason: String| format_error(path, PictureFormat::Hdr.name(), reason);
        let mut exposure = [1.0; 3];
        let mut lines = 0;
        loop {
            let line = header_line(path, file)?;
            lines += 1;
            if line.is_empty() {
                break;
            }
            if lines > LINES {
                return Err(wrong("its header does not end".to_owned()));
            }
            // A line that is set in says what was done to a picture that this one was made of.
            let Some((key, value)) = line.split_once('=') else { continue };
            match key {
                "FORMAT" if value.trim() == "32-bit_rle_xyze" => {
                    let reason =
                        "its colours are XYZ; make RGB of it with Radiance's `ra_xyze -r`, or save it as EXR";
                    return Err(wrong(reason.to_owned()));
                }
                "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                    return Err(wrong(format!("its FORMAT is `{}`, not 32-bit_rle_rgbe", shown(value))));
                }
                "EXPOSURE" | "COLORCORR" => {
                    let factors = factors(value, if key == "EXPOSURE" { 1 } else { 3 });
                    let factors = factors
                        .ok_or_else(|| wrong(format!("its {key} is `{}`, not above 0", shown(value))))?;
                    exposure.iter_mut().zip(factors).for_each(|(product, factor)| *product *= factor);
                }
                _ => {}
            }
        }
        let resolution = header_line(path, file)?;
        let (size, is_upright, is_reversed) = orientation(&resolution).ok_or_else(|| {
            wrong(format!("its size is `{}` instead of one such as `-Y 480 +X 640`", shown(&resolution)))
        })?;
        Ok(Self { size, is_upright, is_reversed, exposure })
    }

    /// The pixel that lies at a place of a scan line.
    fn pixel(&self, scan_line: usize, place: usize) -> usize {
        let [mut x, mut y] = if self.is_upright { [scan_line, place] } else { [place, scan_line] };
        if self.is_reversed[0] {
            x = self.size[0] - 1 - x;
        }
        if self.is_reversed[1] {
            y = self.size[1] - 1 - y;
        }
        y * self.size[0] + x
    }
}

/// Size of the picture.
pub(super) fn size_of(path: &Path, file: &mut impl BufRead, stored_bytes: u64) -> Result<[usize; 2]> {
    sound_header(path, file, stored_bytes).map(|header| header.size)
}

/// The header of a picture whose size is usual.
fn sound_header(path: &Path, file: &mut impl BufRead, stored_bytes: u64) -> Result<RadianceHeader> {
    let header = RadianceHeader::read(path, file)?;
    let bytes = header.size.iter().map(|&side| side as u128).product::<u128>().saturating_mul(12);
    check_size(path, PictureFormat::Hdr, header.size, bytes, stored_bytes)?;
    Ok(header)
}

/// Size and pixels; with alpha 1 for N = 4.
pub(super) fn read<const N: usize>(
    path: &Path,
    mut file: impl BufRead,
    stored_bytes: u64,
) -> Result<([usize; 2], Vec<[f32; N]>)> {
    let header = sound_header(path, &mut file, stored_bytes)?;
    let size = header.size;
    let mut pixels = room(path, size)?;
    pixels.resize(size[0] * size[1], [1.0; N]);
    let units: Vec<f64> = (0..256).map(|exponent| f64::from(exponent - 136).exp2()).collect();
    let [length, count] = if header.is_upright { [size[1], size[0]] } else { size };
    let mut codes = vec![[0; 4]; length];
    for scan_line in 0..count {
        read_scan_line(&mut file, &mut codes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => {
                format_error(path, PictureFormat::Hdr.name(), "it is cut short in its pixels")
            }
            ErrorKind::InvalidData => {
                format_error(path, PictureFormat::Hdr.name(), format!("scan line {scan_line}: {error}"))
            }
            _ => file_error("read", path, error),
        })?;
        for (place, &[codes @ .., exponent]) in codes.iter().enumerate() {
            // Without an exponent it is black.
            let unit = if exponent == 0 { 0.0 } else { units[usize::from(exponent)] };
            let pixel = &mut pixels[header.pixel(scan_line, place)];
            for (channel, code) in codes.into_iter().enumerate() {
                pixel[channel] = (f64::from(code) * unit / header.exposure[channel]) as f32;
            }
        }
    }
    Ok((size, pixels))
}

fn header_line(path: &Path, file: &mut impl BufRead) -> Result<String> {
    let mut line = Vec::new();
    file.take(LINE).read_until(b'\n', &mut line).map_err(|error| file_error("read", path, error))?;
    if line.pop() != Some(b'\n') {
        return Err(format_error(path, PictureFormat::Hdr.name(), "its header does not end"));
    }
    if line.last() == Some(&b'\r') {
        line.pop();
    }
    Ok(String::from_utf8_lossy(&line).into_owned())
}

/// One factor for all channels, or one each.
fn factors(text: &str, count: usize) -> Option<[f64; 3]> {
    let factors: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let factors = factors.filter(|factors| factors.len() == count)?;
    let factors = [0, 1, 2].map(|channel: usize| factors[channel.min(count - 1)]);
    factors.iter().all(|factor| factor.is_normal() && *factor > 0.0).then_some(factors)
}

/// Size, whether scan lines are columns, and which sides are reversed, of a line such as `-Y 480 +X 640`: the first side
/// counts the scan lines. `-Y` goes down.
fn orientation(line: &str) -> Option<([usize; 2], bool, [bool; 2])> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [first, count, second, length] = words[..] else { return None };
    let is_upright = first.ends_with('X');
    let [x, width, y, height] =
        if is_upright { [first, count, second, length] } else { [second, length, first, count] };
    let is_reversed = |axis: &str, ahead: &str, back: &str| match axis {
        _ if axis == ahead => Some(false),
        _ if axis == back => Some(true),
        _ => None,
    };
    let is_reversed = [is_reversed(x, "+X", "-X")?, is_reversed(y, "-Y", "+Y")?];
    let size = [width.parse().ok()?, height.parse().ok()?];
    Some((size, is_upright, is_reversed))
}

/// Fills a scan line, of which each channel is packed by itself, or pixels are.
fn read_scan_line(file: &mut impl Read, line: &mut [[u8; 4]]) -> std::io::Result<()> {
    let start = pixel(file)?;
    let is_by_channels = (8..0x8000).contains(&line.len()) && start[..2] == [2, 2] && start[2] < 0x80;
    if !is_by_channels {
        return read_pixels(file, start, line);
    }
    let length = usize::from(u16::from_be_bytes([start[2], start[3]]));
    if length != line.len() {
        return Err(damaged(format!("it has {length} pixels instead of {}", line.len())));
    }
    (0..4).try_for_each(|channel| read_channel(file, channel, line))
}

/// A count above 128 repeats the byte behind it, any other says how many bytes follow.
fn read_channel(file: &mut impl Read, channel: usize, line: &mut [[u8; 4]]) -> std::io::Result<()> {
    let mut rest = line;
    while !rest.is_empty() {
        let [count] = bytes(file)?;
        let repeats = count > 128;
        let count = usize::from(if repeats { count - 128 } else { count });
        if count == 0 || count > rest.len() {
            return Err(damaged(format!("{count} values come where {} fit", rest.len())));
        }
        let (run, behind) = rest.split_at_mut(count);
        let mut values = [0; 128];
        let values = &mut values[..count];
        if repeats {
            let [value] = bytes(file)?;
            values.fill(value);
        } else {
            file.read_exact(values)?;
        }
        run.iter_mut().zip(values).for_each(|(pixel, value)| pixel[channel] = *value);
        rest = behind;
    }
    Ok(())
}

/// Pixels one by one; three mantissas of 1 repeat the one before, as often as the exponent says. Several such pixels are
/// the digits of one count, the lowest first.
fn read_pixels(file: &mut impl Read, start: [u8; 4], line: &mut [[u8; 4]]) -> std::io::Result<()> {
    let (mut next, mut digit, mut place) = (start, 0, 0_usize);
    loop {
        if next[..3] == [1; 3] {
            let count = usize::from(next[3]) << digit;
            digit += 8;
            let before = place.checked_sub(1).map(|before| line[before]);
            let before = before.ok_or_else(|| damaged("nothing comes before its first run".to_owned()))?;
            if count > line.len() - place || digit > 24 {
                return Err(damaged(format!("{count} pixels come where {} fit", line.len() - place)));
            }
            line[place..][..count].fill(before);
            place += count;
        } else {
            line[place] = next;
            (digit, place) = (0, place + 1);
        }
        if place == line.len() {
            return Ok(());
        }
        next = pixel(file)?;
    }
}

fn pixel(file: &mut impl Read) -> std::io::Result<[u8; 4]> {
    bytes(file)
}

fn bytes<const N: usize>(file: &mut impl Read) -> std::io::Result<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn damaged(reason: String) -> std::io::Error {
    std::io::Error::new(ErrorKind::InvalidData, reason)
}

fn shown(text: &str) -> String {
    text.trim().chars().take(40).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    /// Size and pixels of a file with these lines after the signature.
    fn picture(header: &str, scan_lines: &[u8]) -> Result<([usize; 2], Vec<[f32; 3]>)> {
        let mut bytes = format!("#?RADIANCE\n{header}\n").into_bytes();
        bytes.extend(scan_lines);
        read("a.hdr".as_ref(), &bytes[..], bytes.len() as u64)
    }

    fn reason(header: &str, scan_lines: &[u8]) -> String {
        match picture(header, scan_lines) {
            Err(Error::Format { reason, .. }) => reason,
            other => panic!("a format error was expected, not {other:?}"),
        }
    }

    #[test]
    fn exposures_and_color_corrections_are_divided_out() {
        let header = "FORMAT=32-bit_rle_rgbe\nEXPOSURE=4\n\tEXPOSURE=1000\nEXPOSURE= 5e-1\nCOLORCORR=1 2 4\n\n-Y 1 +X 2";
        let (size, pixels) = picture(header, &[128, 128, 128, 129, 255, 0, 3, 0]).unwrap();
        assert_eq!((size, &pixels[..]), ([2, 1], &[[0.5, 0.25, 0.125], [0.0; 3]][..]));
        for wrong in
            ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=nan", "EXPOSURE=bright", "COLORCORR=1 2", "EXPOSURE=1 2"]
        {
            assert!(
                reason(&format!("{wrong}\n\n-Y 1 +X 1"), &[1; 4]).contains(wrong.split('=').next().unwrap())
            );
        }
    }

    #[test]
    fn a_header_may_end_its_lines_as_windows_does_and_come_from_any_program() {
        let bytes = b"#?RGBE\r\nSOFTWARE=x\r\nEXPOSURE=2\r\n\r\n-Y 1 +X 1\r\n\x80\x80\x80\x81";
        let (size, pixels) = read::<4>("a.hdr".as_ref(), &bytes[..], bytes.len() as u64).unwrap();
        assert_eq!((size, &pixels[..]), ([1, 1], &[[0.5, 0.5, 0.5, 1.0]][..]));
    }

    #[test]
    fn a_picture_stands_upright_however_it_was_scanned() {
        let stored: Vec<u8> = (1..=6).flat_map(|value| [value, 0, 0, 136]).collect();
        for (line, expected) in [
            ("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]),
            ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
            ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
            ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
            ("+X 3 -Y 2", [1, 3, 5, 2, 4, 6]),
            ("-X 3 -Y 2", [5, 3, 1, 6, 4, 2]),
            ("+X 3 +Y 2", [2, 4, 6, 1, 3, 5]),
            ("-X 3 +Y 2", [6, 4, 2, 5, 3, 1]),
        ] {
            let (size, pixels) = picture(&format!("\n{line}"), &stored).unwrap();
            let values: Vec<i32> = pixels.iter().map(|pixel| pixel[0] as i32).collect();
            assert_eq!((size, &values[..]), ([3, 2], &expected[..]), "{line}");
        }
        for wrong in
            ["-Y 2 -Y 3", "Y 2 X 3", "-Y 2", "-Y 2 +X 3 +Z 4", "-Y two +X 3", "-Y -2 +X 3", "+Z 2 +X 3", ""]
        {
            assert!(reason(&format!("\n{wrong}"), &stored).contains("-Y 480 +X 640"), "{wrong}");
        }
    }

    #[test]
    fn the_three_packings_of_a_scan_line_say_the_same() {
        let colors: Vec<[u8; 4]> = (0..300_u16).map(|i| [i.min(5) as u8, 9, 7, 130]).collect();
        let plain: Vec<u8> = colors.iter().flatten().copied().collect();
        let mut runs = plain[..24].to_vec();
        runs.extend([1, 1, 1, 38, 1, 1, 1, 1]);
        let mut by_channels = vec![2, 2, 1, 44];
        by_channels.extend([5, 0, 1, 2, 3, 4, 128 + 127, 5, 128 + 127, 5, 128 + 41, 5]);
        for value in [9, 7, 130] {
            by_channels.extend([128 + 127, value, 128 + 127, value, 128 + 46, value]);
        }
        let expected = picture("\n-Y 1 +X 300", &plain).unwrap();
        assert_eq!(expected.1[299], [5.0 / 64.0, 9.0 / 64.0, 7.0 / 64.0]);
        assert_eq!(picture("\n-Y 1 +X 300", &runs).unwrap(), expected);
        assert_eq!(picture("\n-Y 1 +X 300", &by_channels).unwrap(), expected);
        let damaged: [(&str, &str, &[u8]); 7] = [
            ("cut short", "-Y 1 +X 300", &by_channels[..by_channels.len() - 1]),
            ("cut short", "-Y 1 +X 300", &plain[..1190]),
            ("300 pixels instead of 299", "-Y 1 +X 299", &by_channels),
            ("255 pixels come where 2 fit", "-Y 1 +X 3", &[9, 9, 9, 9, 1, 1, 1, 255]),
            ("before its first run", "-Y 1 +X 3", &[1; 12]),
            ("9 values come where 8 fit", "-Y 1 +X 8", &[2, 2, 0, 8, 9, 0]),
            ("0 values come", "-Y 1 +X 8", &[2, 2, 0, 8, 0, 0]),
        ];
        for (expected, size, bytes) in damaged {
            let reason = reason(&format!("\n{size}"), bytes);
            assert!(reason.contains(expected), "{reason}");
        }
    }

    #[test]
    fn what_cannot_be_read_says_what_to_do() {
        assert!(reason("FORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1", &[1; 4]).contains("ra_xyze -r"));
        assert!(reason("FORMAT=ascii\n\n-Y 1 +X 1", &[1; 4]).contains("`ascii`"));
        assert!(reason("FORMAT=32-bit_rle_rgbe", &[]).contains("does not end"));
        assert!(reason(&"a\n".repeat(5000), &[]).contains("does not end"));
        assert!(reason(&"a".repeat(70_000), &[]).contains("does not end"));
        assert!(reason("\n-Y 16000 +X 16000", &[]).contains("too few"));
        assert!(reason("\n-Y 1 +X 0", &[]).contains("from 1 to 16384"));
    }
}
