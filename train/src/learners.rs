//! The learners: what is maximised, and one update of it. In: a model, a batch of windows. Out: the model after the update, and its measures.
//!
//! An [`objective`] is chosen by name and says what stands beside the reward; any number of [`auxiliary`] terms may be added to it by their weights.
//! Each is one file that states its name, options, networks and value, and one line in its registry.

pub mod auxiliary;
pub mod behaviour;
pub mod losses;
pub mod model_free;
pub mod moments;
pub mod number;
pub mod objective;
pub mod optimizer;
pub mod recurrent;
pub mod rollout;
pub mod sac;
pub mod scene;
pub mod world;

use crate::settings::own::Declared;

/// Every option that objectives and auxiliary terms declare for themselves.
pub fn declared() -> impl Iterator<Item = Declared> {
    let of_objectives = objective::REGISTRY.into_iter().flat_map(|definition| definition.options());
    let of_terms = auxiliary::REGISTRY.into_iter().flat_map(|term| term.options());
    of_objectives.chain(of_terms).copied()
}
