//! Every reader of a foreign file under seeded mutations of a valid one: flips, cuts, repeated and foreign pieces, and numbers that are too large. An error is
//! fine; a panic, or an allocation that such a small file cannot justify, is not. The files in `fuzz/corpus/` are read too: those that libFuzzer kept because each
//! reaches code that the others do not, and those that once broke a reader.
//!
//! `VIBES_FUZZ_ROUNDS=100` makes it a hundred times longer, `VIBES_FUZZ_ONLY=minari_hdf5` runs one reader. The functions under test are those that
//! `make fuzz` runs under libFuzzer. One test a process, since the largest allocation is the process's.

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::readers::{Part, Reader, Readers};

/// No valid file here is longer than 100 kB, and none expands a thousandfold.
const LARGEST_ALLOCATION: usize = 256 << 20;
/// Mutations of each file in an ordinary test run.
const MUTATIONS: usize = 600;

/// The system's allocator, which remembers the largest request.
struct Watched;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code, reason = "an allocator is unsafe by nature")]
// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        LARGEST.fetch_max(size, Ordering::Relaxed);
        // SAFETY: as the caller promised.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Watched = Watched;

fn rounds() -> usize {
    std::env::var("VIBES_FUZZ_ROUNDS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(1)
}

/// A few changes of a kind that has broken readers before.
fn mutate(valid: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = valid.to_vec();
    for _ in 0..rng.random_range(1..4) {
        if bytes.is_empty() {
            break;
        }
        // Heads and tails are where offsets and lengths stand.
        let at = match rng.random_range(0..4) {
            0 => rng.random_range(0..bytes.len().min(64)),
            1 => bytes.len() - 1 - rng.random_range(0..bytes.len().min(1024)),
            _ => rng.random_range(0..bytes.len()),
        };
        match rng.random_range(0..8) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => bytes[at] = rng.random(),
            3 => {
                const EXTREMES: [u64; 8] =
                    [0, 1, u64::MAX, i64::MAX as u64, i64::MIN as u64, u32::MAX as u64, i32::MAX as u64, 1 << 40];
                let extreme = EXTREMES[rng.random_range(0..8)].to_le_bytes();
                let width = [1, 2, 4, 8][rng.random_range(0..4)].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&extreme[..width]);
            }
            4 => {
                let end = (at + rng.random_range(1..64)).min(bytes.len());
                bytes.drain(at..end);
            }
            5 => {
                let end = (at + rng.random_range(1..64)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                let place = rng.random_range(0..=bytes.len());
                bytes.splice(place..place, piece);
            }
            6 => {
                // In text a number becomes another, in binary any byte a digit.
                bytes[at] = b"0123456789-eE.\"[]{},:"[rng.random_range(0..21)];
            }
            _ => {
                let end = (at + rng.random_range(1..32)).min(bytes.len());
                bytes[at..end].fill([0, 0xFF][rng.random_range(0..2)]);
            }
        }
    }
    bytes
}

/// Runs one mutation; says what went wrong, and whether the reader took it.
fn fault_of(readers: &Readers, reader: &Reader, bytes: &[u8]) -> (Option<String>, bool) {
    LARGEST.store(0, Ordering::Relaxed);
    let outcome = catch_unwind(AssertUnwindSafe(|| readers.run(reader, bytes)));
    let largest = LARGEST.load(Ordering::Relaxed);
    match outcome {
        Err(_) => (Some("panicked".into()), false),
        Ok(_) if largest > LARGEST_ALLOCATION => (Some(format!("asked for {largest} bytes at once")), false),
        Ok(taken) => (None, taken),
    }
}

/// What libFuzzer found worth keeping for a reader, and what once broke it.
fn kept(reader: &Reader) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(reader.name);
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{error}: {}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no file: {}", folder.display());
    files
}

/// Fails on every fault of a part's readers.
pub(crate) fn check(part: Part) {
    let all = part.readers;
    let readers = Readers::new(&[part]);
    let mut faults = Vec::new();
    let only = std::env::var("VIBES_FUZZ_ONLY").ok();
    let chosen = |reader: &Reader| only.as_deref().is_none_or(|name| name == reader.name);
    for (number, reader) in all.iter().enumerate().filter(|(_, reader)| chosen(reader)) {
        let valid = readers.valid(reader);
        assert!(readers.run(reader, &valid), "{} does not read its own valid file", reader.name);
        for path in kept(reader) {
            let (fault, _) = fault_of(&readers, reader, &std::fs::read(&path).unwrap());
            faults.extend(fault.map(|fault| format!("{}: {fault}: {}", reader.name, path.display())));
        }
        faults.extend(faults_of_mutations(&readers, reader, &valid, number as u64));
        assert!(readers.run(reader, &valid));
    }
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults[..faults.len().min(40)].join("\n"));
}

/// What seeded mutations of its valid file find in a reader, which must take at least one of them.
fn faults_of_mutations(readers: &Readers, reader: &Reader, valid: &[u8], seed: u64) -> Vec<String> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut faults, mut taken) = (Vec::new(), 0);
    for trial in 0..MUTATIONS * rounds() {
        let bytes = mutate(valid, &mut rng);
        match fault_of(readers, reader, &bytes) {
            (None, is_taken) => taken += usize::from(is_taken && bytes != valid),
            (Some(fault), _) => {
                let kept = std::env::temp_dir().join(format!("vibes-fuzz-{}-{trial}", reader.name));
                std::fs::write(&kept, &bytes).unwrap();
                faults.push(format!("{}, mutation {trial}: {fault}: {}", reader.name, kept.display()));
            }
        }
    }
    assert!(taken > 0 || !faults.is_empty(), "{} takes no mutation: they all end where reading begins", reader.name);
    faults
}
