//! Single transitions of stacked pictures. In: windows of a replay, a little longer than the stack. Out: the stacks before and after one action of each window, that
//! action and its reward; and random views of the stacks as tensors.

use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::Rng;
use rand::seq::SliceRandom;
use vibes_data::WindowBatch;
use vibes_model::kernels::pixel_tensor;
use vibes_model::sac::SacConfig;
use vibes_model::sac::cut::{Border, cut};
use vibes_model::sac::stack::interleave;
use vibes_model::scale;

use super::augment::Augment;
use crate::error::{Result, TrainError};

/// A batch of transitions.
#[derive(Debug, Clone)]
pub struct Transitions {
    /// How many.
    pub rows: usize,
    /// `[height, width, channels]` of a stack.
    pub shape: [usize; 3],
    /// Stacks before the action: `[rows, height, width, channels]`
    pub stacks: Vec<u8>,
    /// Stacks after it.
    pub next_stacks: Vec<u8>,
    /// Scaled to −1..1: `[rows, A]`
    pub actions: Vec<f32>,
    /// `[rows]`
    pub rewards: Vec<f32>,
    /// The stacks and rewards of the next steps, where something looks at them.
    pub ahead: Option<Ahead>,
}

/// What follows the stacks before the actions, those and their rewards included.
#[derive(Debug, Clone)]
pub struct Ahead {
    /// How many steps.
    pub steps: usize,
    /// `[steps, rows, height, width, channels]`
    pub stacks: Vec<u8>,
    /// `[rows, steps]`
    pub rewards: Vec<f32>,
}

/// Rows of a window that one transition is made of, and the `sequence` of steps from it on.
pub fn window_length(stack: usize, sequence: usize) -> usize {
    stack + sequence.saturating_sub(1).max(1)
}

impl Transitions {
    /// One transition of every window, whose length must be [`window_length`]. In a window in mid-episode the transition is the first whose stack is full; one that begins
    /// its episode also stands for the episode's first steps, whose stacks are filled up with the first picture, each equally likely.
    ///
    /// # Errors
    /// The windows are of another length or hold other pictures than the networks take.
    pub fn of_windows(windows: &WindowBatch, config: &SacConfig, rng: &mut impl Rng) -> Result<Self> {
        let (stack, rows) = (config.stack, windows.batch);
        let frame = 3 * config.picture[0] * config.picture[1];
        let length = window_length(stack, config.sequence);
        if windows.length != length || windows.pixels.len() != windows.length * rows * frame {
            return Err(TrainError::Options(format!(
                "windows of {} rows with {} bytes a picture; wanted {length} rows with {frame} bytes",
                windows.length,
                windows.pixels.len() / (windows.length * rows).max(1),
            )));
        }
        let mut made = Self {
            rows,
            shape: [config.picture[0], config.picture[1], config.channels()],
            stacks: Vec::new(),
            next_stacks: Vec::new(),
            actions: Vec::new(),
            rewards: Vec::new(),
            ahead: None,
        };
        let width = config.actions();
        let steps: Vec<usize> = (0..rows)
            .map(|window| if windows.is_first[window] { rng.random_range(0..stack) } else { stack - 1 })
            .collect();
        let stacked = |window: usize, last: usize, out: &mut Vec<u8>| {
            let picture = |step: usize| &windows.pixels[(step * rows + window) * frame..][..frame];
            let frames: Vec<&[u8]> = (0..stack).rev().map(|back| picture(last.saturating_sub(back))).collect();
            interleave(&frames, out);
        };
        for (window, &step) in steps.iter().enumerate() {
            stacked(window, step, &mut made.stacks);
            stacked(window, step + 1, &mut made.next_stacks);
            let row = step * rows + window;
            made.actions.extend_from_slice(&windows.actions[row * width..(row + 1) * width]);
            made.rewards.push(windows.rewards[row]);
        }
        if config.sequence > 0 {
            let mut ahead = Ahead { steps: config.sequence, stacks: Vec::new(), rewards: Vec::new() };
            for further in 0..config.sequence {
                steps.iter().enumerate().for_each(|(window, step)| stacked(window, step + further, &mut ahead.stacks));
            }
            for (window, step) in steps.iter().enumerate() {
                ahead.rewards.extend((0..config.sequence).map(|k| windows.rewards[(step + k) * rows + window]));
            }
            made.ahead = Some(ahead);
        }
        scale::actions(&mut made.actions, &config.action_min, &config.action_max);
        Ok(made)
    }

    /// The actions as a tensor: `[rows, A]`.
    pub fn actions(&self, device: &Device) -> Tensor<2> {
        let width = self.actions.len() / self.rows.max(1);
        Tensor::from_data(TensorData::new(self.actions.clone(), [self.rows, width]), device)
    }

    /// The rewards as a tensor: `[rows]`.
    pub fn rewards(&self, device: &Device) -> Tensor<1> {
        Tensor::from_data(TensorData::new(self.rewards.clone(), [self.rows]), device)
    }

    /// A random view of every stack before the action: `[rows, view height, view width, channels]`.
    pub fn view(&self, augment: Augment, rng: &mut impl Rng, device: &Device) -> Tensor<4, Int> {
        views(&self.stacks, self.shape, augment, rng, device)
    }

    /// A random view of every stack after it.
    pub fn next_view(&self, augment: Augment, rng: &mut impl Rng, device: &Device) -> Tensor<4, Int> {
        views(&self.next_stacks, self.shape, augment, rng, device)
    }
}

impl Ahead {
    /// The stacks as they are looked at without variation: `[steps · rows, view height, view width, channels]`, one step after the other.
    pub fn plain(&self, shape: [usize; 3], augment: Augment, device: &Device) -> Tensor<4, Int> {
        let middle = augment.middle([shape[0], shape[1]]);
        cut_all(&self.stacks, shape, augment, || middle, device)
    }

    /// The rewards of each step as columns, each step's `discount` times that of the one before: `[rows, steps]`.
    pub fn rewards(&self, discount: f32, device: &Device) -> Tensor<2> {
        let weighed = self
            .rewards
            .chunks_exact(self.steps)
            .flat_map(|rewards| rewards.iter().enumerate().map(|(step, reward)| reward * discount.powi(step as i32)));
        let rows = self.rewards.len() / self.steps.max(1);
        Tensor::from_data(TensorData::new(weighed.collect::<Vec<f32>>(), [rows, self.steps]), device)
    }
}

/// A view of every stack, each cut at a place of its own that all its pictures share.
fn views(stacks: &[u8], shape: [usize; 3], augment: Augment, rng: &mut impl Rng, device: &Device) -> Tensor<4, Int> {
    cut_all(stacks, shape, augment, || augment.draw([shape[0], shape[1]], rng), device)
}

/// Every stack cut at its place.
fn cut_all(
    stacks: &[u8],
    shape: [usize; 3],
    augment: Augment,
    mut place: impl FnMut() -> [i32; 2],
    device: &Device,
) -> Tensor<4, Int> {
    let [height, width, channels] = shape;
    let size = augment.size([height, width]);
    let stack = height * width * channels;
    let mut out = Vec::with_capacity(stacks.len() / stack.max(1) * size[0] * size[1] * channels);
    for stack in stacks.chunks_exact(stack) {
        cut(stack, shape, place(), size, Border::Repeated, &mut out);
    }
    let rows = stacks.len() / stack.max(1);
    pixel_tensor(out, [rows, size[0], size[1], channels], device)
}

/// A random permutation of rows.
pub(super) fn partners(rows: usize, rng: &mut impl Rng) -> Vec<i32> {
    let mut partners: Vec<i32> = (0..rows as i32).collect();
    partners.shuffle(rng);
    partners
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use vibes_model::sac::config::LOG_STD_MIN;

    use super::*;

    fn config() -> SacConfig {
        SacConfig {
            task: "made-up".to_owned(),
            picture: [2, 1],
            view: [2, 1],
            stack: 3,
            action_min: vec![-2.0],
            action_max: vec![2.0],
            feature: 4,
            hidden: 4,
            squash: true,
            search: None,
            random_share: 0.0,
            bilinear: false,
            transition: false,
            sequence: 0,
            log_std_min: LOG_STD_MIN,
        }
    }

    /// Two windows of some rows; every byte of a picture is its step, plus 100 in the second window; rewards and actions say their step too.
    fn windows(is_first: bool, length: usize) -> WindowBatch {
        let batch = 2;
        let rows = || (0..length).flat_map(|step| (0..batch).map(move |window| (step, window)));
        WindowBatch {
            length,
            batch,
            pixels: rows().flat_map(|(step, window)| vec![(step + 100 * window) as u8; 6]).collect(),
            observations: Vec::new(),
            actions: rows().map(|(step, _)| step as f32 / 2.0).collect(),
            previous_actions: vec![0.0; length * batch],
            rewards: rows().map(|(step, window)| (step + 100 * window) as f32).collect(),
            is_first: rows().map(|(step, _)| is_first && step == 0).collect(),
            starts: vec![(0, 0); batch],
        }
    }

    #[test]
    fn stacks_actions_and_rewards_are_of_one_step() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let made = Transitions::of_windows(&windows(false, 4), &config(), &mut rng).unwrap();
        let pixel = |steps: [u8; 3]| steps.map(|step| [step; 3]).concat();
        assert_eq!(made.stacks[..9], pixel([0, 1, 2]));
        assert_eq!(made.next_stacks[..9], pixel([1, 2, 3]));
        assert_eq!(made.stacks[18..27], pixel([100, 101, 102]));
        assert_eq!(made.rewards, [2.0, 102.0]);
        assert_eq!(made.actions, [0.5, 0.5]);
    }

    #[test]
    fn an_episodes_first_steps_are_drawn_too_with_their_first_picture_repeated() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut counts = [0_u32; 3];
        for _ in 0..600 {
            let made = Transitions::of_windows(&windows(true, 4), &config(), &mut rng).unwrap();
            let step = made.rewards[0] as usize;
            counts[step] += 1;
            let wanted: Vec<u8> = [2, 1, 0].iter().flat_map(|back| [step.saturating_sub(*back) as u8; 3]).collect();
            assert_eq!(made.stacks[..9], wanted);
        }
        assert!(counts.iter().all(|&count| count.abs_diff(200) < 60), "{counts:?}");
    }

    #[test]
    fn what_follows_is_of_the_next_steps() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let config = SacConfig { sequence: 3, ..config() };
        for is_first in [false, true] {
            let made = Transitions::of_windows(&windows(is_first, 5), &config, &mut rng).unwrap();
            let ahead = made.ahead.as_ref().unwrap();
            let (size, device) = (made.stacks.len(), Device::flex());
            assert_eq!(
                (&ahead.stacks[..size], &ahead.stacks[size..2 * size]),
                (&made.stacks[..], &made.next_stacks[..])
            );
            let first = made.rewards[0];
            assert_eq!(ahead.rewards[..3], [first, first + 1.0, first + 2.0]);
            assert_eq!(ahead.stacks[2 * size..][..9].iter().max(), Some(&(first as u8 + 2)));
            let pictures = ahead.plain(made.shape, Augment::Shift, &device);
            assert_eq!(pictures.dims(), [6, 2, 1, 9]);
            let rewards = vibes_model::parameters::to_values(ahead.rewards(0.5, &device));
            assert_eq!(rewards[..3], [first, (first + 1.0) * 0.5, (first + 2.0) * 0.25]);
        }
    }

    #[test]
    fn windows_of_another_length_are_refused() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let other = SacConfig { stack: 2, ..config() };
        let error = Transitions::of_windows(&windows(false, 4), &other, &mut rng).unwrap_err().to_string();
        assert!(error.contains("wanted 3 rows"), "{error}");
    }
}
