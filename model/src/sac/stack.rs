//! The last few pictures of an episode side by side in the channels, so that a network without memory sees what moves. In: one picture after another. Out: the stack.

use std::collections::VecDeque;

/// Follows one episode.
#[derive(Debug, Clone)]
pub struct FrameStack {
    size: usize,
    frames: VecDeque<Vec<u8>>,
}

impl FrameStack {
    /// An empty stack of `size` pictures.
    pub fn new(size: usize) -> Self {
        Self { size: size.max(1), frames: VecDeque::new() }
    }

    /// Forgets the episode before.
    pub fn begin(&mut self) {
        self.frames.clear();
    }

    /// Takes in the next picture; an episode's first one fills the whole stack.
    pub fn push(&mut self, picture: &[u8]) {
        let missing = if self.frames.is_empty() { self.size } else { 1 };
        for _ in 0..missing {
            self.frames.push_back(picture.to_vec());
        }
        while self.frames.len() > self.size {
            self.frames.pop_front();
        }
    }

    /// The stack, oldest picture first: `[height, width, 3·size]`.
    pub fn stacked(&self) -> Vec<u8> {
        let frames: Vec<&[u8]> = self.frames.iter().map(Vec::as_slice).collect();
        let mut out = Vec::new();
        interleave(&frames, &mut out);
        out
    }
}

/// Appends pictures `[height, width, 3]` as one `[height, width, 3·count]`.
pub fn interleave(frames: &[&[u8]], out: &mut Vec<u8>) {
    let pixels = frames.first().map_or(0, |frame| frame.len() / 3);
    out.reserve(pixels * 3 * frames.len());
    for pixel in 0..pixels {
        for frame in frames {
            out.extend_from_slice(&frame[3 * pixel..3 * pixel + 3]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_picture_fills_the_stack_and_the_oldest_leaves_first() {
        let picture = |value: u8| vec![value; 6];
        let mut stack = FrameStack::new(3);
        stack.push(&picture(1));
        assert_eq!(stack.stacked(), [1; 18]);
        for value in 2..=4 {
            stack.push(&picture(value));
        }
        let pixel = [2, 2, 2, 3, 3, 3, 4, 4, 4];
        assert_eq!(stack.stacked(), [pixel, pixel].concat());
        stack.begin();
        stack.push(&picture(9));
        assert_eq!(stack.stacked(), [9; 18]);
    }
}
