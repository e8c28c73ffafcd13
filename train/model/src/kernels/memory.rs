//! Buffers of float32 on cache-line boundaries, kept for the next use.
//!
//! In: a length. Out: a slice of that length. An update needs the same few hundred megabytes again and again; asking the
//! system for them each time costs more than some of the arithmetic.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// One cache line.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Line([f32; 16]);

/// Buffers given back, smallest first.
static SHELF: Mutex<Vec<Vec<Line>>> = Mutex::new(Vec::new());

/// At most this many buffers are kept.
const KEPT: usize = 96;

fn shelf() -> MutexGuard<'static, Vec<Vec<Line>>> {
    SHELF.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A slice of float32 that starts on a cache line.
#[derive(Clone)]
pub(super) struct Buffer {
    lines: Vec<Line>,
    len: usize,
}

impl Buffer {
    /// A buffer whose contents are whatever it held before: write before reading.
    pub(super) fn stale(len: usize) -> Self {
        let lines = len.div_ceil(16);
        let mut shelf = shelf();
        let place = shelf.partition_point(|kept| kept.len() < lines);
        // A much larger one stays for who needs it.
        let fits = shelf
            .get(place)
            .is_some_and(|kept| kept.len() <= 2 * lines + 64);
        let lines = if fits {
            shelf.remove(place)
        } else {
            drop(shelf);
            vec![Line([0.0; 16]); lines]
        };
        Self { lines, len }
    }

    /// A buffer of zeros.
    pub(super) fn zeros(len: usize) -> Self {
        let mut buffer = Self::stale(len);
        buffer.fill(0.0);
        buffer
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let lines = std::mem::take(&mut self.lines);
        let mut shelf = shelf();
        if shelf.len() >= KEPT {
            shelf.remove(0);
        }
        let place = shelf.partition_point(|kept| kept.len() < lines.len());
        shelf.insert(place, lines);
    }
}

impl Deref for Buffer {
    type Target = [f32];
    fn deref(&self) -> &[f32] {
        &bytemuck::cast_slice(&self.lines)[..self.len]
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.len]
    }
}

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer({})", self.len)
    }
}
