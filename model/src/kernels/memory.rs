//! Buffers of float32 on page boundaries, kept for the next use.
//!
//! In: a length. Out: a slice of that length. An update needs the same few hundred megabytes again and again; asking the
//! system for them each time, and finding them through small pages, costs more than some of the arithmetic.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError};

use memmap2::MmapMut;

/// Bytes of a huge page; buffers of at least a quarter of it are made of whole ones.
const HUGE: usize = 1 << 21;
/// Bytes of an ordinary page.
const PAGE: usize = 1 << 12;
/// At most so many bytes are kept.
const KEPT: usize = 1 << 30;

/// Buffers given back, smallest first.
static SHELF: Mutex<Shelf> = Mutex::new(Shelf { kept: Vec::new(), bytes: 0 });

struct Shelf {
    kept: Vec<MmapMut>,
    bytes: usize,
}

fn shelf() -> MutexGuard<'static, Shelf> {
    SHELF.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shelf {
    /// The smallest that holds `bytes`; a much larger one stays for who needs it.
    fn take(&mut self, bytes: usize) -> Option<MmapMut> {
        let place = self.kept.partition_point(|kept| kept.len() < bytes);
        self.kept.get(place).filter(|kept| kept.len() <= 2 * bytes)?;
        let taken = self.kept.remove(place);
        self.bytes -= taken.len();
        Some(taken)
    }

    fn put(&mut self, memory: MmapMut) {
        if self.bytes + memory.len() <= KEPT {
            self.bytes += memory.len();
            let place = self.kept.partition_point(|kept| kept.len() < memory.len());
            self.kept.insert(place, memory);
        }
    }
}

/// A slice of float32 that starts on a page.
pub(super) struct Buffer {
    /// `None` only when empty.
    memory: Option<MmapMut>,
    len: usize,
}

impl Buffer {
    /// A buffer whose contents are whatever it held before: write before reading.
    ///
    /// # Panics
    /// If the system has no memory left.
    pub(super) fn stale(len: usize) -> Self {
        if len == 0 {
            return Self { memory: None, len };
        }
        let bytes = len * size_of::<f32>();
        let bytes = bytes.next_multiple_of(if bytes >= HUGE / 4 { HUGE } else { PAGE });
        let kept = shelf().take(bytes);
        Self { memory: Some(kept.unwrap_or_else(|| ask(bytes))), len }
    }

    /// A buffer of zeros.
    pub(super) fn zeros(len: usize) -> Self {
        let mut buffer = Self::stale(len);
        buffer.fill(0.0);
        buffer
    }
}

/// Fresh memory from the system.
fn ask(bytes: usize) -> MmapMut {
    let memory = MmapMut::map_anon(bytes).expect("memory for the kernels' buffers");
    #[cfg(target_os = "linux")]
    if bytes >= HUGE {
        // Only a wish: without huge pages everything works, more slowly.
        let _ = memory.advise(memmap2::Advice::HugePage);
    }
    memory
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if let Some(memory) = self.memory.take() {
            shelf().put(memory);
        }
    }
}

impl Clone for Buffer {
    fn clone(&self) -> Self {
        let mut copy = Self::stale(self.len);
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for Buffer {
    type Target = [f32];
    fn deref(&self) -> &[f32] {
        self.memory.as_ref().map_or(&[], |memory| &bytemuck::cast_slice(&memory[..])[..self.len])
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        self.memory.as_mut().map_or(&mut [], |memory| &mut bytemuck::cast_slice_mut(&mut memory[..])[..self.len])
    }
}

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer({})", self.len)
    }
}
