//! How numbers from the environment enter the networks: actions to −1..1 by the task's bounds, vector
//! observations through symlog. Pixels stay bytes until the first convolution.

/// Actions from the task's bounds to −1..1, in place; `actions` is `[…, A]`. An axis without extent becomes 0.
pub fn actions(actions: &mut [f32], min: &[f32], max: &[f32]) {
    for action in actions.chunks_exact_mut(min.len().max(1)) {
        for ((value, low), high) in action.iter_mut().zip(min).zip(max) {
            let extent = high - low;
            *value = if extent > 0.0 { 2.0 * (*value - low) / extent - 1.0 } else { 0.0 };
        }
    }
}

/// Actions from −1..1 to the task's bounds, in place; `actions` is `[…, A]`. The other way round of [`actions`].
pub fn to_bounds(actions: &mut [f32], min: &[f32], max: &[f32]) {
    for action in actions.chunks_exact_mut(min.len().max(1)) {
        for ((value, low), high) in action.iter_mut().zip(min).zip(max) {
            *value = low + 0.5 * (*value + 1.0) * (high - low);
        }
    }
}

/// `sign(x) ln(1 + |x|)`, in place: tames the large velocities of vector observations without knowing the data's scale. Open in the paper.
pub fn symlog(values: &mut [f32]) {
    for value in values {
        *value = value.signum() * value.abs().ln_1p();
    }
}
