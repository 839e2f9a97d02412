//! The volumes of heterogeneous air as a file that other programs and scenes read.

use super::folder::Folder;
use crate::Result;
use crate::io::vdb;
use crate::problem::Maps;
use crate::scene::{Samples, Volume};

/// Writes `air.vdb`, where something is painted in the air or baked: `amount`, `frequency`, `intensity` and `baked`. Of air between two key
/// frames it is the first.
pub(super) fn write_air(maps: &Maps, folder: &Folder, prefix: &str) -> Result<()> {
    let Some((_, field)) = maps.heterogeneity.as_ref().and_then(|air| air.fields().first()) else {
        return Ok(());
    };
    if !field.is_painted() {
        return Ok(());
    }
    let volumes = field.volumes()?;
    let volumes = volumes.into_iter().map(|(name, volume)| Ok((name, without_zeros(volume)?)));
    let volumes = volumes.collect::<Result<Vec<_>>>()?;
    let grids: Vec<(&str, &Volume)> = volumes.iter().map(|(name, volume)| (*name, volume)).collect();
    vdb::write(&folder.file(&format!("{prefix}air.vdb")), &grids, vdb::WriteOptions::default())
}

/// The same with the least number in the place of 0: voxels of 0 are inactive, and the box of a file that is read ends where they begin.
fn without_zeros(volume: Volume) -> Result<Volume> {
    let values = volume.samples().iter().map(|value| value.max(f32::MIN_POSITIVE));
    Volume::new(*volume.grid(), volume.channels(), Samples::F32(values.collect()))
}
