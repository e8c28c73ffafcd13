//! The action-only control: what a table of latents would hold if its encoder saw nothing but past actions.
//!
//! In: the actions of one episode. Out: features of every row. All cells of one state trajectory of a grid share their actions, and actions move the
//! state, so an encoder that sees only actions looks invariant and can be probed for the state without a single picture. Every number therefore stands
//! beside the same number of this table.

/// How many of the latest actions are features, one by one.
const RECENT: usize = 8;
/// Memories of the running averages, in rows.
const MEMORIES: [f32; 4] = [8.0, 16.0, 32.0, 64.0];

/// Features a row has when an action has `axes` numbers.
#[must_use]
pub fn past_action_dims(axes: usize) -> usize {
    axes * (RECENT + MEMORIES.len()) + 1
}

/// Features of the actions before each row of an episode: the last eight actions `a_{t-1} … a_{t-8}` (zeros before the first), running averages
/// `u_t = u_{t-1} + (a_{t-1} - u_{t-1}) / m` with memories m of 8, 16, 32 and 64 rows, and the step t itself.
///
/// A linear reader of these is a linear recurrent encoder with fixed time constants; nothing of the picture enters.
///
/// # Shapes
/// - `actions`: `[steps, axes]`, row-major
/// - output: `[steps + 1, past_action_dims(axes)]`
#[must_use]
pub fn past_action_features(actions: &[f32], axes: usize) -> Vec<f32> {
    let steps = actions.len().checked_div(axes).unwrap_or(0);
    if axes == 0 {
        return Vec::new();
    }
    let mut features = Vec::with_capacity((steps + 1) * past_action_dims(axes));
    let mut averages = vec![0.0; axes * MEMORIES.len()];
    for step in 0..=steps {
        for back in 1..=RECENT {
            match step.checked_sub(back) {
                Some(before) => features.extend_from_slice(&actions[before * axes..(before + 1) * axes]),
                None => features.extend(std::iter::repeat_n(0.0, axes)),
            }
        }
        features.extend_from_slice(&averages);
        features.push(step as f32);
        let taken = actions[step * axes..].iter().take(axes);
        for (average, memory) in averages.chunks_exact_mut(axes).zip(MEMORIES) {
            average
                .iter_mut()
                .zip(taken.clone())
                .for_each(|(average, action)| *average += (action - *average) / memory);
        }
    }
    features
}

#[cfg(test)]
mod tests {
    use super::{past_action_dims, past_action_features};

    #[test]
    fn a_row_sees_the_actions_before_it_and_not_its_own() {
        let actions: Vec<f32> = (0..20).map(|at| at as f32).collect();
        let (dims, found) = (past_action_dims(2), past_action_features(&actions, 2));
        assert_eq!(found.len(), 11 * dims);
        let row = |step: usize| &found[step * dims..(step + 1) * dims];
        assert_eq!(row(0), [vec![0.0; dims - 1], vec![0.0]].concat());
        assert_eq!(row(3)[..8], [4.0, 5.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0]);
        // A memory of 8 after one action of (0, 1) and one of (2, 3).
        assert_eq!(row(2)[16..18], [0.25, 1.0 / 8.0 + (3.0 - 1.0 / 8.0) / 8.0]);
        assert_eq!(row(10)[dims - 1], 10.0);
        let mut later = actions.clone();
        later[10] = 77.0;
        let changed = past_action_features(&later, 2);
        assert_eq!(changed[..6 * dims], found[..6 * dims], "the action of step 5 is not known at step 5");
        assert_ne!(changed[6 * dims..7 * dims], found[6 * dims..7 * dims]);
    }
}
