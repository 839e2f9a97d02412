//! NumPy arrays: `.npy` in and out, and SciPy's sparse matrices out.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use num_traits::ToBytes;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::input;
use super::numbers::{self, Encoding, NumberType};
use super::whole::{write_whole, write_whole_seekable};
use crate::scene::Samples;
use crate::{Error, Result};

/// Writes an array of 32-bit floats in C order (the last axis is the fastest).
///
/// Errors: [`Error::Shape`] when there are not as many values as `shape` says, [`Error::NonFinite`] for a NaN or an
/// infinity, [`Error::File`].
pub fn write_f32(path: &Path, shape: &[usize], values: &[f32]) -> Result<()> {
    let expected = product(shape).unwrap_or(usize::MAX);
    if values.len() != expected {
        return Err(Error::Shape { what: "an array", expected, got: values.len() });
    }
    check_finite(path, values)?;
    write_whole(path, |file| {
        write_array(file, shape, values.iter().copied()).map_err(file_error("write", path))
    })
}

/// Writes a sparse matrix in compressed rows, as `scipy.sparse.load_npz` reads it.
///
/// Row `i` has the columns `indices[indptr[i]..indptr[i + 1]]` and there the values `data`. Columns are stored in
/// 32 bits where they fit, and nothing is compressed: floats hardly shrink, and a gigabyte is written as fast as the
/// disk takes it, without a second copy in memory.
///
/// Errors: [`Error::Shape`] when the arrays do not belong together, [`Error::Value`] when `indptr` falls or a column is
/// outside the matrix, [`Error::NonFinite`], [`Error::File`].
pub fn write_csr<I>(
    path: &Path,
    shape: (usize, usize),
    indptr: &[i64],
    indices: &[I],
    data: &[f32],
) -> Result<()>
where
    I: Copy + TryInto<usize>,
{
    check_rows(shape.0, indptr, data.len())?;
    check_columns(shape.1, indices, data.len())?;
    check_finite(path, data)?;
    write_whole_seekable(path, |file| {
        write_archive(file, |archive| write_members(archive, shape, indptr, indices, data))
            .map_err(file_error("write", path))
    })
}

/// Reads an array of floats (16, 32 or 64 bits), whole numbers (8 to 64 bits, with or without a sign) or truth values,
/// of either byte order and in C or Fortran order: its shape, and its values in C order. Whole numbers are taken as
/// their values, true as 1.
///
/// Errors: [`Error::File`] when it cannot be read; [`Error::Format`] when it is no such array, is shorter than its
/// header says, or holds a value that is not finite as a 32-bit float.
pub fn read_f32(path: &Path) -> Result<(Vec<usize>, Vec<f32>)> {
    let (file, bytes) = input::open(path)?;
    read_array(&mut BufReader::new(file), bytes).map_err(|fault| match fault {
        ArrayFault::Read(source) if source.kind() == io::ErrorKind::UnexpectedEof => {
            format_error(path, "it ends too early".to_owned())
        }
        ArrayFault::Read(source) => file_error("read", path)(source),
        ArrayFault::Content(reason) => format_error(path, reason),
    })
}

/// Writes an array of 32- or 16-bit floats, as [`write_f32`] does. There must be as many as `shape` says.
pub(super) fn write_samples(
    writer: &mut (impl Write + ?Sized),
    shape: &[usize],
    samples: &Samples,
) -> io::Result<()> {
    let dtype = match samples {
        Samples::F32(_) => "<f4",
        Samples::F16(_) => "<f2",
    };
    write_header(writer, dtype, shape)?;
    numbers::write_samples(writer, samples)
}

/// A number that arrays can hold.
pub(super) trait Element: ToBytes {
    /// What NumPy calls it.
    const DTYPE: &'static str;
}

macro_rules! elements {
    ($($number:ty: $dtype:literal),*) => {
        $(impl Element for $number {
            const DTYPE: &'static str = $dtype;
        })*
    };
}

elements!(f32: "<f4", f64: "<f8", i32: "<i4", i64: "<i8");

/// Writes an array in C order. There must be as many values as `shape` says.
pub(super) fn write_array<T: Element>(
    writer: impl Write,
    shape: &[usize],
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    // The array is written value by value, and not every writer below is buffered.
    let mut writer = BufWriter::with_capacity(1 << 16, writer);
    write_header(&mut writer, T::DTYPE, shape)?;
    for value in values {
        writer.write_all(value.to_le_bytes().as_ref())?;
    }
    writer.flush()
}

fn write_header(writer: &mut (impl Write + ?Sized), dtype: &str, shape: &[usize]) -> io::Result<()> {
    let shape: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({shape}), }}");
    // The values begin at a multiple of 64 bytes, where a mapped file wants them.
    let width = (text.len() + 11).next_multiple_of(64) - 11;
    let length = u16::try_from(width + 1).map_err(io::Error::other)?;
    writer.write_all(b"\x93NUMPY\x01\x00")?;
    writer.write_all(&length.to_le_bytes())?;
    writeln!(writer, "{text:width$}")
}

/// An archive on its way into a file.
pub(super) type Archive<'f, 'g> = ZipWriter<Enduring<'f, 'g>>;

/// Writes an archive with the members that `write` puts into it.
pub(super) fn write_archive<'f, 'g>(
    file: &'f mut BufWriter<&'g File>,
    write: impl FnOnce(&mut Archive<'f, 'g>) -> io::Result<()>,
) -> io::Result<()> {
    let mut archive = ZipWriter::new(Enduring { file, failure: None, at: 0, end: 0 });
    write(&mut archive)?;
    archive.finish()?.failure.map_or(Ok(()), Err)
}

/// A file that takes everything, and says at the end what has failed: an archive does not bear it in between.
pub(super) struct Enduring<'f, 'g> {
    file: &'f mut BufWriter<&'g File>,
    failure: Option<io::Error>,
    at: u64,
    end: u64,
}

impl Enduring<'_, '_> {
    fn attempt(&mut self, act: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) {
        if self.failure.is_none() {
            self.failure = act(self.file).err();
        }
    }
}

impl Write for Enduring<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.attempt(|file| file.write_all(bytes));
        self.at += bytes.len() as u64;
        self.end = self.end.max(self.at);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.attempt(|file| file.flush());
        Ok(())
    }
}

impl Seek for Enduring<'_, '_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.end.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        let at = at.ok_or(io::ErrorKind::InvalidInput)?;
        if at != self.at {
            self.at = at;
            self.attempt(|file| file.seek(SeekFrom::Start(at)).map(drop));
        }
        Ok(at)
    }
}

fn write_members<I: Copy + TryInto<usize>>(
    mut archive: &mut Archive,
    (rows, columns): (usize, usize),
    indptr: &[i64],
    indices: &[I],
    data: &[f32],
) -> io::Result<()> {
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    let columns_of_values = || indices.iter().map(|&index| column(index));
    archive.start_file("indices.npy", options)?;
    if i32::try_from(columns).is_ok() {
        write_array(&mut archive, &[indices.len()], columns_of_values().map(|column| column as i32))?;
    } else {
        write_array(&mut archive, &[indices.len()], columns_of_values().map(|column| column as i64))?;
    }
    archive.start_file("indptr.npy", options)?;
    write_array(&mut archive, &[indptr.len()], indptr.iter().copied())?;
    archive.start_file("format.npy", options)?;
    write_format_name(archive)?;
    archive.start_file("shape.npy", options)?;
    write_array(&mut archive, &[2], [rows as i64, columns as i64].into_iter())?;
    archive.start_file("data.npy", options)?;
    write_array(&mut archive, &[data.len()], data.iter().copied())
}

/// `b'csr'` as an array of no axes, which is how `scipy.sparse.save_npz` says what the other members mean.
fn write_format_name(writer: &mut impl Write) -> io::Result<()> {
    write_header(writer, "|S3", &[])?;
    writer.write_all(b"csr")
}

/// Out of any matrix when it does not fit.
fn column<I: TryInto<usize>>(index: I) -> usize {
    index.try_into().unwrap_or(usize::MAX)
}

fn check_rows(rows: usize, indptr: &[i64], values: usize) -> Result<()> {
    if indptr.len() != rows.saturating_add(1) {
        return Err(Error::Shape { what: "indptr", expected: rows.saturating_add(1), got: indptr.len() });
    }
    if indptr[0] != 0 || indptr[rows] != values as i64 {
        let got = format!("from {} to {}, with {values} values", indptr[0], indptr[rows]);
        return Err(Error::value("indptr", got, "from 0 to the number of values"));
    }
    match indptr.windows(2).position(|pair| pair[0] > pair[1]) {
        None => Ok(()),
        Some(row) => {
            Err(Error::value(format!("indptr[{}]", row + 1), indptr[row + 1], "no less than before"))
        }
    }
}

fn check_columns<I: Copy + TryInto<usize>>(columns: usize, indices: &[I], values: usize) -> Result<()> {
    if indices.len() != values {
        return Err(Error::Shape { what: "indices", expected: values, got: indices.len() });
    }
    match indices.iter().position(|&index| column(index) >= columns) {
        None => Ok(()),
        Some(at) => Err(Error::value(
            format!("indices[{at}]"),
            "a column outside the matrix",
            "less than its number of columns",
        )),
    }
}

fn check_finite(path: &Path, values: &[f32]) -> Result<()> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => Err(Error::NonFinite {
            what: path.display().to_string(),
            place: format!("value {index} of {}", values.len()),
        }),
    }
}

/// Why an array cannot be read.
#[derive(Debug)]
pub(super) enum ArrayFault {
    Read(io::Error),
    Content(String),
}

impl From<io::Error> for ArrayFault {
    fn from(source: io::Error) -> Self {
        Self::Read(source)
    }
}

fn read_array(file: &mut impl Read, bytes: u64) -> Result<(Vec<usize>, Vec<f32>), ArrayFault> {
    let array = Array::read(file, bytes)?;
    let values = match array.read_samples(file)? {
        Samples::F32(values) => values,
        Samples::F16(values) => values.into_iter().map(f32::from).collect(),
    };
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok((array.shape, values)),
        Some(index) => Err(ArrayFault::Content(format!("value {index} is not a finite 32-bit float"))),
    }
}

/// What is known of an array before its values are read.
#[derive(Debug)]
pub(super) struct Array {
    /// The last axis is the fastest.
    pub(super) shape: Vec<usize>,
    /// The product of the shape.
    count: usize,
    encoding: Encoding,
    /// Whether the first axis is the fastest in the file.
    is_turned: bool,
}

impl Array {
    /// Reads up to the first value. `bytes` is how long the file can be at most: it is enough for `count` values.
    pub(super) fn read(file: &mut impl Read, bytes: u64) -> Result<Self, ArrayFault> {
        let (text, header_bytes) = read_header(file)?;
        let header = Header::parse(&text).ok_or_else(|| {
            ArrayFault::Content(format!("its header cannot be understood: {}", text.trim_end()))
        })?;
        let encoding = encoding_of(header.dtype)?;
        let is_turned = header.fortran_order && header.shape.len() > 1;
        let available = bytes.saturating_sub(header_bytes);
        let fits = |&count: &usize| {
            count.checked_mul(encoding.width()).is_some_and(|needed| needed as u64 <= available)
        };
        match product(&header.shape).filter(fits) {
            Some(count) => Ok(Self { shape: header.shape, count, encoding, is_turned }),
            None => Err(ArrayFault::Content(format!(
                "it holds {available} bytes, which are too few for the shape {:?}",
                header.shape
            ))),
        }
    }

    /// Bytes that reading its values takes.
    pub(super) fn bytes(&self) -> u64 {
        self.encoding.bytes(self.count) * if self.is_turned { 2 } else { 1 }
    }

    /// The values, the last axis the fastest.
    pub(super) fn read_samples(&self, file: &mut impl Read) -> io::Result<Samples> {
        Ok(match self.encoding.read_samples(file, self.count)? {
            Samples::F32(values) => Samples::F32(self.in_order(values)?),
            Samples::F16(values) => Samples::F16(self.in_order(values)?),
        })
    }

    /// The values, the last axis the fastest, in double precision.
    pub(super) fn read_doubles(&self, file: &mut impl Read) -> io::Result<Vec<f64>> {
        self.in_order(self.encoding.read_doubles(file, self.count)?)
    }

    /// Values of the file, so that the last axis is the fastest.
    fn in_order<T: Copy>(&self, values: Vec<T>) -> io::Result<Vec<T>> {
        if !self.is_turned {
            return Ok(values);
        }
        let mut ordered = Vec::new();
        ordered.try_reserve_exact(self.count).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        let mut index = vec![0; self.shape.len()];
        let mut from = 0;
        for _ in 0..self.count {
            ordered.push(values[from]);
            // On to the next place in our order; `from` follows it in the order of the file.
            let mut place = self.count;
            for (axis, &length) in self.shape.iter().enumerate().rev() {
                place /= length;
                from += place;
                index[axis] += 1;
                if index[axis] < length {
                    break;
                }
                from -= place * length;
                index[axis] = 0;
            }
        }
        Ok(ordered)
    }
}

/// The text that describes the array, and how many bytes come before the values.
fn read_header(file: &mut impl Read) -> Result<(String, u64), ArrayFault> {
    /// Headers of plain arrays have 118 bytes; only structured ones are long.
    const LONGEST: usize = 1 << 14;
    let mut start = [0; 8];
    file.read_exact(&mut start)?;
    if &start[..6] != b"\x93NUMPY" {
        return Err(ArrayFault::Content("its first bytes are not those of a NumPy array".to_owned()));
    }
    let mut length = [0; 4];
    let length_bytes = if start[6] == 1 { 2 } else { 4 };
    file.read_exact(&mut length[..length_bytes])?;
    let length = u32::from_le_bytes(length) as usize;
    if !(1..=3).contains(&start[6]) || length > LONGEST {
        return Err(ArrayFault::Content(format!(
            "its header is of version {} and {length} bytes long",
            start[6]
        )));
    }
    let mut text = vec![0; length];
    file.read_exact(&mut text)?;
    Ok((String::from_utf8_lossy(&text).into_owned(), (8 + length_bytes + length) as u64))
}

/// Of the Python dictionary in a header, what there is to know of a plain array.
///
/// Read by hand: the crate `npyz` multiplies a shape out unchecked, and its parser recurses as deep as the file wants.
#[derive(Debug, PartialEq)]
struct Header<'t> {
    dtype: &'t str,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl<'t> Header<'t> {
    fn parse(text: &'t str) -> Option<Self> {
        let dtype = value_of(text, "descr")?.strip_prefix(['\'', '"']).unwrap_or("a structure");
        let order = value_of(text, "fortran_order")?;
        let fortran_order = order.starts_with("True");
        if !fortran_order && !order.starts_with("False") {
            return None;
        }
        let shape = value_of(text, "shape")?.strip_prefix('(')?.split_once(')')?.0;
        let lengths = shape.split(',').map(|length| length.trim().trim_end_matches('L'));
        Some(Self {
            dtype: dtype.split(['\'', '"']).next()?,
            fortran_order,
            shape: lengths
                .filter(|length| !length.is_empty())
                .map(|l| l.parse().ok())
                .collect::<Option<_>>()?,
        })
    }
}

fn value_of<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    let after = text.split_once(&format!("'{key}'")).or_else(|| text.split_once(&format!("\"{key}\"")))?.1;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

fn encoding_of(dtype: &str) -> Result<Encoding, ArrayFault> {
    let kind = match dtype.get(1..) {
        Some("b1") => NumberType::Bool,
        Some("i1") => NumberType::I8,
        Some("i2") => NumberType::I16,
        Some("i4") => NumberType::I32,
        Some("i8") => NumberType::I64,
        Some("u1") => NumberType::U8,
        Some("u2") => NumberType::U16,
        Some("u4") => NumberType::U32,
        Some("u8") => NumberType::U64,
        Some("f2") => NumberType::F16,
        Some("f4") => NumberType::F32,
        Some("f8") => NumberType::F64,
        _ => return Err(unknown_values(dtype)),
    };
    let encoding = Encoding { kind, big_endian: dtype.starts_with('>') };
    match dtype.as_bytes()[0] {
        b'<' | b'>' => Ok(encoding),
        b'|' if encoding.width() == 1 => Ok(encoding),
        _ => Err(unknown_values(dtype)),
    }
}

fn unknown_values(dtype: &str) -> ArrayFault {
    ArrayFault::Content(format!("its values are {dtype}; save them with .astype('float32')"))
}

/// None when there are more than can be counted.
fn product(shape: &[usize]) -> Option<usize> {
    // An axis of length zero empties the array however long the others are.
    if shape.contains(&0) {
        return Some(0);
    }
    shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length))
}

fn file_error(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Error {
    let path = path.to_owned();
    move |source| Error::File { action, path: path.clone(), source }
}

fn format_error(path: &Path, reason: String) -> Error {
    Error::Format { path: path.to_owned(), format: "NumPy", reason }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn read(bytes: &[u8]) -> Result<(Vec<usize>, Vec<f32>)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        std::fs::write(&path, bytes).unwrap();
        read_f32(&path)
    }

    fn reason(bytes: &[u8]) -> String {
        match read(bytes) {
            Err(Error::Format { reason, .. }) => reason,
            other => panic!("a format error was expected, not {other:?}"),
        }
    }

    #[test]
    fn an_array_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let values: Vec<f32> = (0..20_000).map(|i| i as f32 / 7.0).collect();
        for shape in [vec![20_000], vec![100, 200], vec![10, 20, 50, 2]] {
            write_f32(&path, &shape, &values).unwrap();
            assert_eq!(read_f32(&path).unwrap(), (shape, values.clone()));
        }
        write_f32(&path, &[], &[3.5]).unwrap();
        assert_eq!(read_f32(&path).unwrap(), (vec![], vec![3.5]));
        write_f32(&path, &[0, 3], &[]).unwrap();
        assert_eq!(read_f32(&path).unwrap(), (vec![0, 3], vec![]));
        assert!(matches!(
            write_f32(&path, &[3, 3], &[1.0; 8]),
            Err(Error::Shape { expected: 9, got: 8, .. })
        ));
        assert!(matches!(write_f32(&path, &[2], &[1.0, f32::NAN]), Err(Error::NonFinite { .. })));
    }

    #[test]
    fn every_float_and_byte_order_is_read() {
        let header =
            |dtype: &str| format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': (2,), }}\n");
        let numbers = [0.5_f64, -3.25];
        let files = [
            ("<f4", numbers.map(|v| (v as f32).to_le_bytes().to_vec())),
            (">f4", numbers.map(|v| (v as f32).to_be_bytes().to_vec())),
            ("<f8", numbers.map(|v| v.to_le_bytes().to_vec())),
            (">f8", numbers.map(|v| v.to_be_bytes().to_vec())),
        ];
        for (dtype, data) in files {
            assert_eq!(read(&npy(&header(dtype), &data.concat())).unwrap(), (vec![2], vec![0.5, -3.25]));
        }
        assert!(reason(&npy(&header("<c8"), &[0; 16])).contains("astype('float32')"));
        assert!(reason(&npy(&header("|i8"), &[0; 16])).contains("astype('float32')"));
        assert!(reason(&npy(&header("<f8"), &1e300_f64.to_le_bytes().repeat(2))).contains("value 0"));
        assert!(reason(&npy(&header("<f4"), &f32::NAN.to_le_bytes().repeat(2))).contains("value 0"));
    }

    #[test]
    fn whole_numbers_of_every_width_and_byte_order_are_their_values() {
        let header =
            |dtype: &str| format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': (2,), }}\n");
        let files = [
            ("|b1", vec![0, 1], [0.0, 1.0]),
            ("|i1", vec![0xf9, 3], [-7.0, 3.0]),
            ("|u1", vec![0xf9, 3], [249.0, 3.0]),
            ("<i2", vec![0xf9, 0xff, 1, 2], [-7.0, 513.0]),
            (">i2", vec![0xff, 0xf9, 2, 1], [-7.0, 513.0]),
            ("<u2", vec![0xf9, 0xff, 1, 2], [65529.0, 513.0]),
            (">u2", vec![0xff, 0xf9, 2, 1], [65529.0, 513.0]),
            ("<i4", [-7_i32, 70_000].map(i32::to_le_bytes).concat(), [-7.0, 7e4]),
            (">i4", [-7_i32, 70_000].map(i32::to_be_bytes).concat(), [-7.0, 7e4]),
            ("<u4", [1 << 31, 70_000_u32].map(u32::to_le_bytes).concat(), [2147483648.0, 7e4]),
            (">u4", [1 << 31, 70_000_u32].map(u32::to_be_bytes).concat(), [2147483648.0, 7e4]),
            ("<i8", [-7_i64, 1 << 40].map(i64::to_le_bytes).concat(), [-7.0, 1099511627776.0]),
            (">i8", [-7_i64, 1 << 40].map(i64::to_be_bytes).concat(), [-7.0, 1099511627776.0]),
            ("<u8", [7_u64, 1 << 63].map(u64::to_le_bytes).concat(), [7.0, 9.223372e18]),
            (">u8", [7_u64, 1 << 63].map(u64::to_be_bytes).concat(), [7.0, 9.223372e18]),
        ];
        for (dtype, data, numbers) in files {
            let found = read(&npy(&header(dtype), &data)).unwrap();
            assert_eq!(found, (vec![2], numbers.to_vec()), "{dtype}");
        }
    }

    #[test]
    fn arrays_in_fortran_order_are_those_in_c_order() {
        let of = |order: &str, shape: &str, numbers: &[i16]| {
            let header = format!("{{'descr': '>i2', 'fortran_order': {order}, 'shape': {shape}, }}\n");
            read(&npy(&header, &numbers.iter().flat_map(|n| n.to_be_bytes()).collect::<Vec<_>>())).unwrap()
        };
        assert_eq!(of("True", "(2, 3)", &[1, 4, 2, 5, 3, 6]), of("False", "(2, 3)", &[1, 2, 3, 4, 5, 6]));
        // The value at (i, j, k, c) is ijkc.
        let shape = [2_usize, 3, 4, 3];
        let number = |[i, j, k, c]: [usize; 4]| (1000 * i + 100 * j + 10 * k + c) as i16;
        let mut fortran = Vec::new();
        let mut c_order = Vec::new();
        for n in 0..72 {
            fortran.push(number([n % 2, n / 2 % 3, n / 6 % 4, n / 24]));
            c_order.push(number([n / 36, n / 12 % 3, n / 3 % 4, n % 3]));
        }
        assert_ne!(fortran, c_order);
        let text = format!("{shape:?}").replace('[', "(").replace(']', ")");
        assert_eq!(of("True", &text, &fortran), of("False", &text, &c_order));
        assert_eq!(of("True", "(0, 3)", &[]), (vec![0, 3], vec![]));
    }

    #[test]
    fn headers_that_promise_too_much_are_refused() {
        let with = |order: &str, shape: &str| {
            let header = format!("{{'descr': '<f4', 'fortran_order': {order}, 'shape': {shape}, }}\n");
            npy(&header, &[0; 24])
        };
        assert_eq!(read(&with("False", "(2, 3)")).unwrap().0, [2, 3]);
        assert_eq!(read(&with("True", "(6,)")).unwrap().0, [6]);
        assert_eq!(read(&with("True", "(2, 3)")).unwrap().0, [2, 3]);
        let huge = ["(2, 4)", "(4294967296, 4294967296, 4)", "(99999999999999999999999,)", "(-1, 6)", "6"];
        for shape in huge {
            assert!(!reason(&with("False", shape)).is_empty(), "{shape}");
        }
        assert!(reason(&with("maybe", "(2, 3)")).contains("understood"));
        assert!(reason(&npy(&"(".repeat(16_000), &[])).contains("understood"));
        assert!(reason(b"PK\x03\x04 something else").contains("first bytes"));
        assert!(reason(b"").contains("ends too early"));
        let long = [b"\x93NUMPY\x02\x00".as_slice(), &u32::MAX.to_le_bytes()].concat();
        assert!(reason(&long).contains("bytes long"));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

        #[test]
        fn damaged_arrays_never_panic(
            damage in prop::collection::vec((0_usize..140, any::<u8>()), 0..6),
            length in 0_usize..160,
        ) {
            let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n";
            let mut bytes = npy(header, &[0; 48]);
            for (index, value) in damage {
                let index = index % bytes.len();
                bytes[index] = value;
            }
            bytes.truncate(length);
            if let Err(error) = read(&bytes) {
                let is_about_the_content = matches!(error, Error::Format { .. });
                prop_assert!(is_about_the_content, "{}", error);
            }
        }
    }

    const INDPTR: [i64; 4] = [0, 2, 2, 3];
    const DATA: [f32; 3] = [1.5, 2.5, -4.0];

    /// The members of an archive: name and the bytes after the header of the array in it.
    fn members(path: &Path) -> Vec<(String, String, Vec<u8>)> {
        let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
        (0..archive.len())
            .map(|index| {
                let mut member = archive.by_index(index).unwrap();
                let (text, _) = read_header(&mut member).map_err(|_| ()).unwrap();
                let mut data = Vec::new();
                member.read_to_end(&mut data).unwrap();
                (member.name().unwrap().into_owned(), text, data)
            })
            .collect()
    }

    #[test]
    fn a_sparse_matrix_has_the_members_that_scipy_reads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("T.npz");
        write_csr(&path, (3, 4), &INDPTR, &[0_u32, 3, 1], &DATA).unwrap();
        let bytes = |values: &[i64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
        let expected = [
            ("indices.npy", "'<i4'", "(3,)", [0_i32, 3, 1].map(i32::to_le_bytes).concat()),
            ("indptr.npy", "'<i8'", "(4,)", bytes(&INDPTR)),
            ("format.npy", "'|S3'", "()", b"csr".to_vec()),
            ("shape.npy", "'<i8'", "(2,)", bytes(&[3, 4])),
            ("data.npy", "'<f4'", "(3,)", DATA.map(f32::to_le_bytes).concat()),
        ];
        let members = members(&path);
        assert_eq!(members.len(), expected.len());
        for ((name, text, data), (expected, dtype, shape, bytes)) in members.iter().zip(expected) {
            assert_eq!((name.as_str(), data), (expected, &bytes));
            let shape = format!("'shape':{shape},");
            assert!(text.contains(dtype) && text.replace(' ', "").contains(&shape), "{text}");
        }
    }

    #[test]
    fn columns_beyond_32_bits_are_written_in_64() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("T.npz");
        write_csr(&path, (1, 1 << 33), &[0, 1], &[1_u64 << 32], &[1.0]).unwrap();
        let (_, text, data) = &members(&path)[0];
        assert!(text.contains("'<i8'"));
        assert_eq!(data, &(1_i64 << 32).to_le_bytes());
    }

    #[test]
    fn matrices_that_are_none_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("T.npz");
        let write = |indptr: &[i64], indices: &[i32], data: &[f32]| {
            write_csr(&path, (3, 4), indptr, indices, data).unwrap_err().to_string()
        };
        assert!(write(&INDPTR[..3], &[0, 3, 1], &DATA).contains("indptr"));
        assert!(write(&[0, 2, 1, 3], &[0, 3, 1], &DATA).contains("indptr[2]"));
        assert!(write(&[0, 2, 2, 2], &[0, 3, 1], &DATA).contains("from 0 to 2"));
        assert!(write(&INDPTR, &[0, 3], &DATA).contains("indices"));
        assert!(write(&INDPTR, &[0, 4, 1], &DATA).contains("indices[1]"));
        assert!(write(&INDPTR, &[0, -1, 1], &DATA).contains("indices[1]"));
        assert!(write(&INDPTR, &[0, 3, 1], &[1.0, f32::INFINITY, 1.0]).contains("value 1 of 3"));
        assert!(!path.exists());
    }
}
