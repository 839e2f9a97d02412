//! `cargo run --release --bin mutate -- FORMAT COUNT SEED [FOLDER…]`: files of the corpus, and of the folders, damaged by lot.
//!
//! Ends with 1 where a reader panicked, took 10 s, or took more than a budget of memory. Such files are left in `artifacts/FORMAT`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

use unscatter_fuzz::formats::{Reader, files, root};

/// Seconds a file may take.
const SLOW: f64 = 10.0;
/// Bytes a file may take at a time: scenes of the corpus are allowed 64 MiB, files of kilobytes in other formats
/// have headers that ask for less.
const LARGE: usize = 300 << 20;

struct Counting;
static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn taken(size: usize) {
    let now = NOW.fetch_add(size, Relaxed) + size;
    PEAK.fetch_max(now, Relaxed);
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Marsaglia's xorshift: the same files from the same seed, on every machine.
struct Lot(u64);

impl Lot {
    fn new(seed: u64) -> Self {
        let mut lot = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        (0..10).for_each(|_| {
            lot.next();
        });
        lot
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}

/// Formats in which words and numbers are changed, not only bytes.
const TEXTS: [&str; 8] = ["animation", "gltf", "mtl", "obj", "raw", "scene", "transforms", "volume"];

/// Numbers and words that readers stumble over.
const WORDS: [&str; 26] = [
    "0",
    "-1",
    "1",
    "1e30",
    "-1e30",
    "1e-30",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "1e400",
    "nan",
    "null",
    "\"\"",
    "[]",
    "{}",
    "true",
    "16384",
    "16385",
    "1000000000",
    "0.5",
    "-0",
    "65536",
    "inf",
    "2147483648",
    "1e300",
];
const BYTES: [u8; 10] = [0, 0xff, 0x7f, 0x80, 1, b' ', b'"', b'0', b'-', b'\n'];
const NUMBERS: [u64; 14] = [
    0,
    1,
    255,
    65535,
    0x1_0000,
    16384,
    0x7f80_0000,
    0x7fc0_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 40,
    i64::MAX as u64,
    u64::MAX,
];

/// One of the seeds with a few places changed.
fn damaged(lot: &mut Lot, is_text: bool, seeds: &[Vec<u8>]) -> Vec<u8> {
    let which = lot.below(seeds.len());
    let mut bytes = seeds[which].clone();
    let changes = 1 + if lot.below(3) == 0 { lot.below(12) } else { lot.below(3) };
    for _ in 0..changes {
        if bytes.is_empty() {
            bytes.push(0);
        }
        let at = lot.below(bytes.len());
        let within = |lot: &mut Lot, most: usize, len: usize| 1 + lot.below(most.min(len - at));
        match lot.below(if is_text { 11 } else { 8 }) {
            0 => bytes[at] ^= 1 << lot.below(8),
            1 => bytes[at] = lot.next() as u8,
            2 => bytes[at] = lot.of(&BYTES),
            3 => {
                let end = at + within(lot, 8, bytes.len());
                bytes.drain(at..end);
            }
            4 => {
                let copy = bytes[at..at + within(lot, 16, bytes.len())].to_vec();
                let to = lot.below(bytes.len());
                bytes.splice(to..to, copy);
            }
            5 => {
                if lot.below(4) == 0 {
                    bytes.truncate(at + 1);
                }
            }
            6 => {
                let number = lot.of(&NUMBERS);
                let width = lot.of(&[2, 4, 8]);
                let number = if lot.below(2) == 0 {
                    number.to_le_bytes()
                } else {
                    (number << (64 - 8 * width)).to_be_bytes()
                };
                bytes[at..].iter_mut().zip(&number[..width]).for_each(|(byte, new)| *byte = *new);
            }
            7 => {
                let other = lot.below(seeds.len());
                let from = lot.below(seeds[other].len());
                let part = &seeds[other][from..];
                let part = &part[..part.len().min(1 + lot.below(64))];
                bytes.splice(at..at, part.iter().copied());
            }
            _ => {
                let is_number = |byte: &u8| byte.is_ascii_digit() || b".-e".contains(byte);
                let Some(start) = bytes[at..].iter().position(is_number) else { continue };
                let start = at + start;
                let length =
                    bytes[start..].iter().position(|byte| !is_number(byte)).unwrap_or(bytes.len() - start);
                bytes.splice(start..start + length, lot.of(&WORDS).bytes());
            }
        }
    }
    bytes
}

/// With sums that are right, so that what they guard is reached.
fn with_sums(format: &str, bytes: &mut [u8]) {
    match format {
        "png" => {
            let mut at = 8;
            while let Some(length) = bytes.get(at..at + 4) {
                let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
                let end = at + 8 + length;
                let Some(chunk) = bytes.get(at + 4..end) else { return };
                let sum = crc32fast::hash(chunk).to_be_bytes();
                let Some(place) = bytes.get_mut(end..end + 4) else { return };
                place.copy_from_slice(&sum);
                at = end + 4;
            }
        }
        "checkpoint" if bytes.len() > 4 => {
            let (body, place) = bytes.split_at_mut(bytes.len() - 4);
            place.copy_from_slice(&crc32fast::hash(body).to_le_bytes());
        }
        _ => (),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, count, seed, folders @ ..] = &arguments[..] else {
        eprintln!("usage: mutate FORMAT COUNT SEED [FOLDER…]");
        std::process::exit(2);
    };
    let (count, seed): (u64, u64) = (count.parse().expect("a count"), seed.parse().expect("a seed"));
    std::panic::set_hook(Box::new(|panic| {
        if !unscatter::io::is_guarded() {
            eprintln!("{panic}");
        }
    }));
    let reader = Reader::new(name);
    let mut folders: Vec<PathBuf> = folders.iter().map(PathBuf::from).collect();
    folders.insert(0, root().join("corpus").join(name));
    let seeds: Vec<Vec<u8>> = folders
        .iter()
        .flat_map(|folder| files(folder))
        .map(|file| std::fs::read(file).expect("a seed"))
        .collect();
    let known = seeds.iter().filter(|seed| reader.read(seed).is_ok()).count();
    let artifacts = root().join("artifacts").join(name);
    let is_text = TEXTS.contains(&name.as_str());
    let mut lot = Lot::new(seed);
    let (mut read, mut bad, mut slowest, mut largest) = (0_u64, 0_u64, 0.0_f64, 0_usize);
    let begun = Instant::now();
    for index in 0..count {
        let mut bytes = damaged(&mut lot, is_text, &seeds);
        if lot.below(8) != 0 {
            with_sums(name, &mut bytes);
        }
        let before = NOW.load(Relaxed);
        PEAK.store(before, Relaxed);
        let start = Instant::now();
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| reader.read(&bytes)));
        let (seconds, peak) = (start.elapsed().as_secs_f64(), PEAK.load(Relaxed).saturating_sub(before));
        read += u64::from(matches!(outcome, Ok(Ok(()))));
        (slowest, largest) = (slowest.max(seconds), largest.max(peak));
        if outcome.is_err() || seconds > SLOW || peak > LARGE {
            bad += 1;
            std::fs::create_dir_all(&artifacts).expect("a folder");
            let file = artifacts.join(format!("{seed}_{index}"));
            std::fs::write(&file, &bytes).expect("a file");
            println!("{}: {seconds:.2} s, {} MiB", file.display(), peak >> 20);
        }
    }
    println!(
        "{name}: {} seeds ({known} read), {count} files by seed {seed}: {read} read, {bad} bad, slowest {slowest:.3} s, \
         largest {} MiB, {:.0} s in all",
        seeds.len(),
        largest >> 20,
        begun.elapsed().as_secs_f64()
    );
    std::process::exit(i32::from(bad > 0));
}
