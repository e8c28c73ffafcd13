//! The background axis: which frame of which video is shown.
//!
//! In: the number of frames of each video and random draws. Out: one [`BackgroundFrame`] per control step. The video runs forwards and
//! backwards; its last frame shows twice at the turn, its first once. Source: `distracting_control/background.py`, over sorted frames.

use rand::Rng;
use vibes_data::BackgroundFrame;

/// The random draws of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackgroundReset {
    /// Index of the video.
    pub video: usize,
    /// Frame shown first. In a static background the only one.
    pub start: usize,
    /// Runs forwards.
    pub forwards: bool,
}

impl BackgroundReset {
    /// Draws a reset: the video, then (static) the one frame or (dynamic) the first frame, then the direction.
    /// `frames` holds the number of frames of each video, none zero.
    pub fn draw(frames: &[usize], rng: &mut impl Rng) -> Self {
        let video = rng.random_range(0..frames.len());
        Self { video, start: rng.random_range(0..frames[video]), forwards: rng.random() }
    }
}

/// The walk, between two steps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BackgroundWalk {
    video: usize,
    frames: usize,
    index: usize,
    forwards: bool,
    dynamic: bool,
}

impl BackgroundWalk {
    /// Starts an episode with a video of `frames` frames.
    pub fn reset(draws: &BackgroundReset, frames: usize, dynamic: bool) -> Self {
        Self { video: draws.video, frames, index: draws.start, forwards: draws.forwards, dynamic }
    }

    /// One control step.
    pub fn advance(&mut self) {
        if !self.dynamic {
            return;
        }
        let mut index = self.index as i64 + if self.forwards { 1 } else { -1 };
        if index <= 0 {
            (index, self.forwards) = (0, true);
        }
        if index >= self.frames as i64 {
            (index, self.forwards) = (self.frames as i64 - 1, false);
        }
        self.index = index as usize;
    }

    /// What is shown.
    pub fn frame(&self) -> BackgroundFrame {
        BackgroundFrame { video: self.video as u32, frame: self.index as u32 }
    }

    /// Whether the next step goes forwards.
    pub fn forwards(&self) -> bool {
        self.forwards
    }
}
