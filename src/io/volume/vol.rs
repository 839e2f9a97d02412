//! Grid volumes of Mitsuba, version 3 of the format: little-endian, a header of 48 bytes, then the values with the
//! channels of a voxel side by side and x the fastest axis.
//!
//! | bytes  | what                                                                                       |
//! |--------|--------------------------------------------------------------------------------------------|
//! | 0..4   | `VOL` and the version                                                                      |
//! | 4..8   | encoding: 1 f32, 2 f16, 3 u8 for 0 to 1, 4 directions; Mitsuba 3 reads only the first      |
//! | 8..20  | size: x, y, z                                                                              |
//! | 20..24 | channels                                                                                   |
//! | 24..48 | box: least x, y, z, then greatest x, y, z. Mitsuba 3 heeds it with `use_grid_bbox` only    |
//!
//! The box is that of the voxels, whose values lie at their centres, as Mitsuba 3 has it. Mitsuba 0.6 had the outermost
//! values on the faces of the box.

use std::io::Read;
use std::path::Path;

use glam::{DAffine3, DVec3};

use super::Stored;
use super::file::VolumeFile;
use crate::io::numbers::{Encoding, NumberType, write_singles};
use crate::io::write_whole;
use crate::scene::{Samples, Volume, VoxelGrid};
use crate::{Error, Result};

const HEADER_BYTES: usize = 48;
const MAGIC: &[u8; 4] = b"VOL\x03";
const F32: i32 = 1;

pub(super) fn read(source: VolumeFile) -> Result<Stored> {
    let (mut file, bytes) = source.open()?;
    let mut header = [0; HEADER_BYTES];
    file.read_exact(&mut header).map_err(|failed| source.stopped(failed))?;
    let header = Header::parse(source, &header)?;
    let count = source.count(header.size, header.channels)?;
    let needed = (count * header.encoding.width()) as u64;
    let available = bytes.saturating_sub(HEADER_BYTES as u64);
    if needed != available {
        let reason = format!("its values take {available} bytes, where its header asks for {needed}");
        return Err(source.wrong(reason));
    }
    let samples = match source.samples(&mut file, header.encoding, count)? {
        Samples::F32(values) if header.encoding.kind == NumberType::U8 => {
            Samples::F32(values.into_iter().map(|byte| byte / 255.0).collect())
        }
        samples => samples,
    };
    source.volume(header.size, header.channels, samples, Some(header.world_from_grid()))
}

struct Header {
    encoding: Encoding,
    size: [usize; 3],
    channels: usize,
    corners: [DVec3; 2],
}

impl Header {
    fn parse(source: VolumeFile, header: &[u8; HEADER_BYTES]) -> Result<Self> {
        let (words, _) = header.as_chunks::<4>();
        if words[0][..3] != MAGIC[..3] {
            return Err(source.wrong("its first bytes are not `VOL`"));
        }
        if words[0] != *MAGIC {
            return Err(source.wrong(format!("its version is {} and only 3 can be read", words[0][3])));
        }
        let whole = |word: usize| i32::from_le_bytes(words[word]);
        let length = |word: usize| {
            let problem = || source.wrong(format!("a length in its header is {}", whole(word)));
            usize::try_from(whole(word)).map_err(|_| problem())
        };
        let point = |word: usize| {
            DVec3::from_array([0, 1, 2].map(|axis| f64::from(f32::from_le_bytes(words[word + axis]))))
        };
        let corners = [point(6), point(9)];
        let extent = corners[1] - corners[0];
        if !(extent.is_finite() && extent.min_element() > 0.0) {
            return Err(source.wrong(format!("its box from {} to {} is empty", corners[0], corners[1])));
        }
        Ok(Self {
            encoding: encoding(source, whole(1))?,
            size: [length(2)?, length(3)?, length(4)?],
            channels: length(5)?,
            corners,
        })
    }

    fn world_from_grid(&self) -> DAffine3 {
        let sides = DVec3::from_array(self.size.map(|side| side as f64));
        let [least, greatest] = self.corners;
        DAffine3::from_translation(least) * DAffine3::from_scale((greatest - least) / sides)
    }
}

fn encoding(source: VolumeFile, number: i32) -> Result<Encoding> {
    let kind = match number {
        F32 => NumberType::F32,
        2 => NumberType::F16,
        3 => NumberType::U8,
        4 => return Err(source.wrong("it holds directions (encoding 4) instead of values")),
        other => return Err(source.wrong(format!("its encoding is {other}, and there are 1 to 4"))),
    };
    Ok(Encoding { kind, big_endian: false })
}

pub(super) fn write(path: &Path, volume: &Volume) -> Result<()> {
    let mut header = MAGIC.to_vec();
    header.extend(F32.to_le_bytes());
    let [x, y, z] = volume.grid().size();
    header.extend([x, y, z, volume.channels()].map(|length| length as i32).map(i32::to_le_bytes).concat());
    let [least, greatest] = bounds(volume.grid()).unwrap_or([[0.0; 3], [1.0; 3]]);
    header.extend([least, greatest].as_flattened().iter().flat_map(|number| number.to_le_bytes()));
    write_whole(path, |file| {
        let failed = |source| Error::File { action: "write", path: path.to_owned(), source };
        file.write_all(&header).map_err(failed)?;
        write_singles(file, volume.samples()).map_err(failed)
    })
}

/// The box that the grid fills, where it lies along the axes and single precision can tell its faces apart.
fn bounds(grid: &VoxelGrid) -> Option<[[f32; 3]; 2]> {
    /// What single precision does not see.
    const SKEW: f64 = 1e-8;
    let world_from_cube = grid.world_from_cube();
    let m = world_from_cube.matrix3;
    let extent = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let is_straight = (0..3).all(|axis| {
        let along = DVec3::AXES[axis] * extent[axis];
        extent[axis] > 0.0 && (columns[axis] - along).length() <= SKEW * extent.min_element()
    });
    let least = world_from_cube.translation.as_vec3();
    let greatest = (world_from_cube.translation + extent).as_vec3();
    let is_open = least.is_finite() && greatest.is_finite() && least.cmplt(greatest).all();
    (is_straight && is_open).then(|| [least.to_array(), greatest.to_array()])
}
