//! Damaged files are errors, and soon: whatever they claim, nothing is allocated or repeated for it.

use std::time::{Duration, Instant};

use super::*;
use crate::io::vdb::blosc;
use crate::io::vdb::header::Header;

/// Voxels that a damaged file may make of a few.
const FEW: usize = 1 << 22;
/// Long for what takes less than a hundredth of it.
const SOON: Duration = Duration::from_secs(5);

/// Reads every grid; whether it is an error does not matter.
fn survive(bytes: &[u8]) {
    let mut source = ByteReader::new(Cursor::new(bytes), Path::new("memory.vdb")).unwrap();
    let start = Instant::now();
    if let Ok(header) = Header::read(&mut source) {
        for grid in header.grids.iter().take(3) {
            let _ = read_few(bytes, Some(&grid.name), FEW);
        }
    }
    assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
}

fn undamaged() -> Vec<Vec<u8>> {
    const FIXTURES: [&str; 9] = [
        "affine",
        "codes",
        "float_none",
        "float_zip",
        "half_blosc",
        "several",
        "tiles",
        "vec3s_blosc",
        "vec3s_half_zip",
    ];
    let mut files: Vec<_> = FIXTURES.iter().map(|name| std::fs::read(fixture(name)).unwrap()).collect();
    let volume = read(&fixture("vec3s_blosc"), None).unwrap();
    for compression in [Compression::None, Compression::Zip, Compression::Blosc] {
        for half in [false, true] {
            files.push(written(&[("a", &volume)], WriteOptions { compression, half }));
        }
    }
    files
}

#[derive(Debug, Clone)]
enum Damage {
    Flip(prop::sample::Index, u8),
    Cut(prop::sample::Index),
    Insert(prop::sample::Index, Vec<u8>),
    Remove(prop::sample::Index, usize),
    Claim32(prop::sample::Index, u32),
    Claim64(prop::sample::Index, i64),
}

impl Damage {
    fn to(&self, file: &mut Vec<u8>) {
        if file.len() < 16 {
            return;
        }
        let place = |index: &prop::sample::Index| {
            // Half of them where there is more than masks: near the beginning or near the end.
            let at = index.index(3 * file.len());
            match at % 3 {
                0 => at / 3 % 900,
                1 => file.len() - 1 - (at / 3 % 2500).min(file.len() - 1),
                _ => at / 3,
            }
            .min(file.len() - 8)
        };
        match self {
            Self::Flip(index, bit) => {
                let at = place(index);
                file[at] ^= 1 << bit;
            }
            Self::Cut(index) => file.truncate(index.index(file.len())),
            Self::Insert(index, bytes) => {
                let at = place(index);
                file.splice(at..at, bytes.iter().copied());
            }
            Self::Remove(index, count) => {
                let at = place(index);
                file.drain(at..(at + count).min(file.len()));
            }
            Self::Claim32(index, claim) => {
                let at = place(index);
                file[at..at + 4].copy_from_slice(&claim.to_le_bytes());
            }
            Self::Claim64(index, claim) => {
                let at = place(index);
                file[at..at + 8].copy_from_slice(&claim.to_le_bytes());
            }
        }
    }
}

fn damage() -> impl Strategy<Value = Damage> {
    let at = any::<prop::sample::Index>;
    let claims =
        prop_oneof![Just(i64::MAX), Just(i64::MIN), Just(-1), Just(1 << 50), 0..20_000_i64, -20_000..0_i64];
    prop_oneof![
        6 => (at(), 0..8_u8).prop_map(|(at, bit)| Damage::Flip(at, bit)),
        1 => at().prop_map(Damage::Cut),
        2 => (at(), prop::collection::vec(any::<u8>(), 1..40)).prop_map(|(at, bytes)| Damage::Insert(at, bytes)),
        2 => (at(), 1..40_usize).prop_map(|(at, count)| Damage::Remove(at, count)),
        3 => (at(), prop_oneof![any::<u32>(), Just(u32::MAX), 0..5000_u32])
            .prop_map(|(at, claim)| Damage::Claim32(at, claim)),
        3 => (at(), claims).prop_map(|(at, claim)| Damage::Claim64(at, claim)),
    ]
}

proptest! {
    /// Set `PROPTEST_CASES` for more of them.
    #[test]
    fn damaged_files_neither_panic_nor_take_long(
        file in prop::sample::select(undamaged()),
        damages in prop::collection::vec(damage(), 1..4),
    ) {
        let mut file = file;
        damages.iter().for_each(|damage| damage.to(&mut file));
        survive(&file);
    }

    #[test]
    fn blosc_takes_back_what_it_packs_and_survives_damage(
        bytes in prop::collection::vec(prop_oneof![4 => Just(0_u8), 1 => any::<u8>()], 0..6000),
        width in prop::sample::select(vec![1_usize, 2, 4, 12, 16, 17]),
        damages in prop::collection::vec(damage(), 1..4),
    ) {
        let bytes = &bytes[..bytes.len() / width * width];
        if let Some(mut chunk) = blosc::encode(bytes, width) {
            prop_assert!(chunk.len() < bytes.len());
            let mut back = vec![1; bytes.len()];
            blosc::decode(&chunk, &mut back).unwrap();
            prop_assert_eq!(&back, bytes);
            damages.iter().for_each(|damage| damage.to(&mut chunk));
            let _ = blosc::decode(&chunk, &mut back);
        }
    }
}

#[test]
fn every_place_may_claim_petabytes() {
    let file = std::fs::read(fixture("codes")).unwrap();
    let claims = [0x00ff_ffff_ffff_ffff_u64, u64::MAX, 0xffff_ffff];
    let (begin, end) = (0..800, file.len() - 1500..file.len() - 8);
    for (at, claim) in begin.chain(end.step_by(5)).zip(claims.into_iter().cycle()) {
        let mut claiming = file.clone();
        claiming[at..at + 8].copy_from_slice(&claim.to_le_bytes());
        survive(&claiming);
    }
}

#[test]
fn every_shorter_file_is_an_error() {
    for file in undamaged().iter().take(6) {
        for len in (0..file.len()).step_by(7).chain(file.len() - 30..file.len()) {
            assert!(read_bytes(&file[..len], None).is_err(), "{len} of {}", file.len());
        }
    }
}

#[test]
fn two_voxels_far_apart_are_too_large() {
    let grid = VoxelGrid::new([4096, 1, 2], DAffine3::IDENTITY).unwrap();
    let mut samples = vec![0.0; grid.len()];
    samples[0] = 1.0;
    *samples.last_mut().unwrap() = 1.0;
    let volume = Volume::new(grid, 1, Samples::F32(samples)).unwrap();
    let file = written(&[("a", &volume)], WriteOptions::default());
    assert_eq!(read_bytes(&file, None).unwrap(), volume);
    assert!(matches!(read_few(&file, None, 8191), Err(Error::TooLarge { .. })));
}
