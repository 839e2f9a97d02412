//! Numbers as files hold them, and a matrix as rows of numbers.

use std::io::{self, Read, Write};

use glam::{DAffine3, DMat3, DVec3};
use half::f16;

use crate::scene::Samples;

/// Numbers that pass through a buffer at once.
const AT_ONCE: usize = 1 << 13;

/// What a number in a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberType {
    /// A byte that is 0 for false, which counts as 0; all others count as 1.
    Bool,
    /// Whole numbers of 8 to 64 bits, with a sign.
    I8,
    I16,
    I32,
    I64,
    /// Whole numbers of 8 to 64 bits, without a sign.
    U8,
    U16,
    U32,
    U64,
    /// Half precision.
    F16,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// How numbers lie in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Encoding {
    pub(super) kind: NumberType,
    pub(super) big_endian: bool,
}

impl Encoding {
    /// Bytes a number.
    pub(super) fn width(self) -> usize {
        use NumberType::{Bool, F16, F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        match self.kind {
            Bool | I8 | U8 => 1,
            I16 | U16 | F16 => 2,
            I32 | U32 | F32 => 4,
            I64 | U64 | F64 => 8,
        }
    }

    /// Bytes that `count` numbers take in memory: those of [`Samples`].
    pub(super) fn bytes(self, count: usize) -> u64 {
        let width = if self.kind == NumberType::F16 { size_of::<f16>() } else { size_of::<f32>() };
        count as u64 * width as u64
    }

    /// Reads `count` numbers. Half precision stays what it is; everything else becomes single.
    ///
    /// The memory for all of them is asked for first: `count` must have been held against the length of the file.
    pub(super) fn read_samples(self, file: &mut impl Read, count: usize) -> io::Result<Samples> {
        Ok(match self.kind {
            NumberType::F16 => Samples::F16(self.read(file, count, f16::from_le_bytes)?),
            _ => Samples::F32(self.numbers(file, count, |number| number as f32)?),
        })
    }

    /// Reads `count` numbers in double precision, which only whole numbers beyond 2⁵³ are rounded to.
    pub(super) fn read_doubles(self, file: &mut impl Read, count: usize) -> io::Result<Vec<f64>> {
        self.numbers(file, count, |number| number)
    }

    fn numbers<T>(self, file: &mut impl Read, count: usize, of: impl Fn(f64) -> T) -> io::Result<Vec<T>> {
        match self.kind {
            NumberType::Bool => {
                self.read(file, count, |[byte]: [u8; 1]| of(if byte == 0 { 0.0 } else { 1.0 }))
            }
            NumberType::I8 => self.read(file, count, |bytes| of(i8::from_le_bytes(bytes).into())),
            NumberType::I16 => self.read(file, count, |bytes| of(i16::from_le_bytes(bytes).into())),
            NumberType::I32 => self.read(file, count, |bytes| of(i32::from_le_bytes(bytes).into())),
            NumberType::I64 => self.read(file, count, |bytes| of(i64::from_le_bytes(bytes) as f64)),
            NumberType::U8 => self.read(file, count, |bytes| of(u8::from_le_bytes(bytes).into())),
            NumberType::U16 => self.read(file, count, |bytes| of(u16::from_le_bytes(bytes).into())),
            NumberType::U32 => self.read(file, count, |bytes| of(u32::from_le_bytes(bytes).into())),
            NumberType::U64 => self.read(file, count, |bytes| of(u64::from_le_bytes(bytes) as f64)),
            NumberType::F16 => self.read(file, count, |bytes| of(f16::from_le_bytes(bytes).into())),
            NumberType::F32 => self.read(file, count, |bytes| of(f32::from_le_bytes(bytes).into())),
            NumberType::F64 => self.read(file, count, |bytes| of(f64::from_le_bytes(bytes))),
        }
    }

    fn read<const WIDTH: usize, T>(
        self,
        file: &mut impl Read,
        count: usize,
        of: impl Fn([u8; WIDTH]) -> T,
    ) -> io::Result<Vec<T>> {
        let mut values = Vec::new();
        values.try_reserve_exact(count).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
        let mut bytes = vec![0; WIDTH * AT_ONCE.min(count)];
        while values.len() < count {
            let part = &mut bytes[..WIDTH * AT_ONCE.min(count - values.len())];
            file.read_exact(part)?;
            let (numbers, _) = part.as_chunks_mut();
            if self.big_endian {
                numbers.iter_mut().for_each(|number| number.reverse());
            }
            values.extend(numbers.iter().map(|&number| of(number)));
        }
        Ok(values)
    }
}

/// Writes numbers, the lowest byte of each first.
pub(super) fn write_samples(file: &mut (impl Write + ?Sized), samples: &Samples) -> io::Result<()> {
    match samples {
        Samples::F32(values) => write(file, values, |value| value.to_le_bytes()),
        Samples::F16(values) => write(file, values, |value| value.to_le_bytes()),
    }
}

/// Writes numbers as [`write_samples`] does, all in single precision.
pub(super) fn write_singles(file: &mut (impl Write + ?Sized), samples: &Samples) -> io::Result<()> {
    match samples {
        Samples::F32(_) => write_samples(file, samples),
        Samples::F16(values) => write(file, values, |value| value.to_f32().to_le_bytes()),
    }
}

fn write<const WIDTH: usize, T: Copy>(
    file: &mut (impl Write + ?Sized),
    values: &[T],
    bytes_of: impl Fn(T) -> [u8; WIDTH],
) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(AT_ONCE * WIDTH);
    for part in values.chunks(AT_ONCE) {
        bytes.clear();
        bytes.extend(part.iter().flat_map(|&value| bytes_of(value)));
        file.write_all(&bytes)?;
    }
    Ok(())
}

/// The transform that the rows of a matrix stand for, acting on columns: (p, 1) ↦ M (p, 1).
///
/// Errors: why it is none, as the end of a sentence that begins with the name of the matrix.
pub(super) fn affine_of_rows(rows: &[[f64; 4]; 4]) -> Result<DAffine3, &'static str> {
    if rows.as_flattened().iter().any(|number| !number.is_finite()) {
        return Err("holds a number that is not finite");
    }
    // Files of other programs hold this row as it came out of a computation.
    if rows[3].iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(number, expected)| (number - expected).abs() > 1e-6) {
        return Err("does not end in the row 0 0 0 1");
    }
    let column = |index: usize| DVec3::new(rows[0][index], rows[1][index], rows[2][index]);
    let matrix3 = DMat3::from_cols(column(0), column(1), column(2));
    let volume = column(0).length() * column(1).length() * column(2).length();
    if !(volume.is_finite() && matrix3.determinant().abs() > 1e-9 * volume) {
        return Err("is singular");
    }
    Ok(DAffine3 { matrix3, translation: column(3) })
}

/// The matrix of a transform, row by row.
pub(super) fn rows_of_affine(transform: &DAffine3) -> [[f64; 4]; 4] {
    let DAffine3 { matrix3, translation } = transform;
    let row = |index: usize| {
        [matrix3.x_axis[index], matrix3.y_axis[index], matrix3.z_axis[index], translation[index]]
    };
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_kind_are_read_in_either_order() {
        let whole: [(NumberType, Vec<u8>, [f32; 2]); 9] = [
            (NumberType::Bool, vec![0, 2], [0.0, 1.0]),
            (NumberType::I8, [-7_i8, 100].map(i8::to_le_bytes).concat(), [-7.0, 100.0]),
            (NumberType::I16, [-700_i16, 10_000].map(i16::to_le_bytes).concat(), [-700.0, 10_000.0]),
            (NumberType::I32, [-70_000_i32, 1 << 30].map(i32::to_le_bytes).concat(), [-7e4, 1073741824.0]),
            (NumberType::I64, [-70_000_i64, 1 << 40].map(i64::to_le_bytes).concat(), [-7e4, 1099511627776.0]),
            (NumberType::U8, vec![7, 255], [7.0, 255.0]),
            (NumberType::U16, [7_u16, 65_535].map(u16::to_le_bytes).concat(), [7.0, 65_535.0]),
            (NumberType::U32, [7_u32, 1 << 31].map(u32::to_le_bytes).concat(), [7.0, 2147483648.0]),
            (NumberType::U64, [7_u64, 1 << 63].map(u64::to_le_bytes).concat(), [7.0, 9.223372e18]),
        ];
        for (kind, bytes, numbers) in whole {
            let little = Encoding { kind, big_endian: false };
            let turned: Vec<u8> =
                bytes.chunks(little.width()).flat_map(|number| number.iter().rev().copied()).collect();
            for (encoding, bytes) in [(little, &bytes), (Encoding { kind, big_endian: true }, &turned)] {
                let samples = encoding.read_samples(&mut bytes.as_slice(), 2).unwrap();
                assert_eq!(samples, Samples::F32(numbers.to_vec()), "{kind:?}");
                let doubles = encoding.read_doubles(&mut bytes.as_slice(), 2).unwrap();
                assert_eq!(doubles, numbers.map(f64::from), "{kind:?}");
            }
        }
        let cases: [(NumberType, Vec<u8>); 3] = [
            (NumberType::F16, [0.5, -3.25].map(|v| f16::from_f32(v).to_le_bytes()).concat()),
            (NumberType::F32, [0.5_f32, -3.25].map(f32::to_le_bytes).concat()),
            (NumberType::F64, [0.5_f64, -3.25].map(f64::to_le_bytes).concat()),
        ];
        for (kind, bytes) in cases {
            let little = Encoding { kind, big_endian: false };
            let big = Encoding { kind, big_endian: true };
            let turned: Vec<u8> =
                bytes.chunks(little.width()).flat_map(|number| number.iter().rev().copied()).collect();
            for (encoding, bytes) in [(little, &bytes), (big, &turned)] {
                let samples = encoding.read_samples(&mut bytes.as_slice(), 2).unwrap();
                assert_eq!(samples.iter().collect::<Vec<_>>(), [0.5, -3.25]);
                assert_eq!(matches!(samples, Samples::F16(_)), kind == NumberType::F16);
                assert_eq!(encoding.read_doubles(&mut bytes.as_slice(), 2).unwrap(), [0.5, -3.25]);
                assert!(encoding.read_samples(&mut bytes.as_slice(), 3).is_err());
            }
            let mistaken = big.read_samples(&mut bytes.as_slice(), 2).unwrap();
            assert_ne!(mistaken.get(0), 0.5, "{kind:?} in the wrong order");
        }
        let bytes = Encoding { kind: NumberType::U8, big_endian: true };
        assert_eq!(bytes.read_samples(&mut [0, 255].as_slice(), 2).unwrap(), Samples::F32(vec![0.0, 255.0]));
    }

    #[test]
    fn memory_that_is_not_there_is_an_error() {
        let bytes = Encoding { kind: NumberType::U8, big_endian: false };
        let failed = bytes.read_samples(&mut io::empty(), usize::MAX / 8).unwrap_err();
        assert_eq!(failed.kind(), io::ErrorKind::OutOfMemory);
    }

    #[test]
    fn matrices_and_transforms_are_the_same() {
        let rows = [[2.0, 0.1, 0.0, 5.0], [0.0, -3.0, 0.2, 6.0], [0.3, 0.0, 4.0, 7.0], [0.0, 0.0, 0.0, 1.0]];
        let transform = affine_of_rows(&rows).unwrap();
        assert_eq!(transform.transform_point3(DVec3::X), DVec3::new(7.0, 6.0, 7.3));
        assert_eq!(rows_of_affine(&transform), rows);
        let mut turned = rows;
        (turned[0][1], turned[1][0]) = (rows[1][0], rows[0][1]);
        assert_ne!(affine_of_rows(&turned).unwrap(), transform);
        for (row, column, number) in [(0, 0, f64::NAN), (1, 3, f64::INFINITY), (3, 0, 0.1), (3, 3, 0.0)] {
            let mut wrong = rows;
            wrong[row][column] = number;
            assert!(affine_of_rows(&wrong).is_err(), "{wrong:?}");
        }
        assert_eq!(affine_of_rows(&[rows[0], rows[0], rows[2], rows[3]]), Err("is singular"));
    }
}
