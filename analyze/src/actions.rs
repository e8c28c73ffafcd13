//! The action-only control: what a table of latents would hold if its encoder saw nothing but past actions.
//!
//! Cells of one row of a grid share their actions, and actions move the state, so such an encoder looks invariant and can be probed for the
//! state without ever seeing a picture. Every measure of the latents belongs beside the same measure of this control.

use vibes_data::Latents;

use crate::input::Frames;

/// Memories of the leaky sums, in steps.
const MEMORIES: [f32; 7] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

/// Features of the past actions of every row, `[rows, dims]`, with their `dims`: for each action dimension leaky sums
/// `u_t = (1 − 1/m) u_{t−1} + a_{t−1} / m` with memories m of 1, 2, 4, … 64 steps, and the step itself.
///
/// A linear reader of these is a linear recurrent encoder with fixed time constants; nothing of the picture enters.
#[must_use]
pub fn action_features(latents: &Latents, frames: &Frames) -> (usize, Vec<f32>) {
    let actions = frames.recording().manifest().spec.action_len();
    let dims = actions * MEMORIES.len() + 1;
    let mut values = vec![0.0; latents.len() * dims];
    let mut order: Vec<usize> = (0..latents.len()).collect();
    order.sort_by_key(|&row| (latents.episode[row], latents.step[row]));
    for rows in order.chunk_by(|&a, &b| latents.episode[a] == latents.episode[b]) {
        let Some(view) = frames.view(latents.episode[rows[0]]) else { continue };
        let mut sums = vec![0.0; actions * MEMORIES.len()];
        let mut step = 0;
        for &row in rows {
            // Rows may skip steps; the sums do not.
            while step < latents.step[row] as usize {
                for (i, sum) in sums.iter_mut().enumerate() {
                    let m = MEMORIES[i % MEMORIES.len()];
                    *sum += (view.action(step)[i / MEMORIES.len()] - *sum) / m;
                }
                step += 1;
            }
            let place = &mut values[row * dims..(row + 1) * dims];
            place[..sums.len()].copy_from_slice(&sums);
            place[sums.len()] = step as f32;
        }
    }
    (dims, values)
}
