//! Recurrent weights as the products read them.
//!
//! In: `[hidden, 3·hidden]`. Out: panels, padded with zeros.

use rayon::prelude::*;

use super::Sizes;
use crate::kernels::memory::Buffer;
use crate::kernels::product::PANEL;

/// Recurrent weights in panels: `[3·panels][padded, PANEL]`.
pub(super) fn packed(sizes: Sizes, weight: &[f32]) -> Buffer {
    let plane = sizes.padded() * PANEL;
    let mut packed = Buffer::zeros(3 * sizes.panels() * plane);
    packed.par_chunks_exact_mut(plane).enumerate().for_each(|(index, packed)| {
        let (gate, panel) = (index / sizes.panels(), index % sizes.panels());
        for (packed, weight) in packed.chunks_exact_mut(PANEL).zip(weight.chunks_exact(3 * sizes.hidden)) {
            let start = gate * sizes.hidden + panel * PANEL;
            packed[..sizes.width(panel)].copy_from_slice(&weight[start..start + sizes.width(panel)]);
        }
    });
    packed
}

/// The same turned round: `[panels][3·padded, PANEL]`.
pub(super) fn packed_turned(sizes: Sizes, weight: &[f32]) -> Buffer {
    let plane = 3 * sizes.padded() * PANEL;
    let mut packed = Buffer::zeros(sizes.panels() * plane);
    packed.par_chunks_exact_mut(plane).enumerate().for_each(|(panel, packed)| {
        for (gate, packed) in packed.chunks_exact_mut(sizes.padded() * PANEL).enumerate() {
            // Square by square, so that what is written stays near the core until its lines are full.
            for (square, packed) in packed.chunks_exact_mut(PANEL * PANEL).enumerate() {
                for lane in 0..sizes.width(panel) {
                    let start = (panel * PANEL + lane) * 3 * sizes.hidden + gate * sizes.hidden + square * PANEL;
                    let weight = &weight[start..start + sizes.width(square)];
                    for (row, number) in weight.iter().enumerate() {
                        packed[row * PANEL + lane] = *number;
                    }
                }
            }
        }
    });
    packed
}
