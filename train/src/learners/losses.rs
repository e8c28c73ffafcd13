//! Losses of the systems the paper compares with, as functions of tensors alone. In: features or latents `[rows, dims]`, rewards, predictions. Out: one number to
//! minimise, `[1]`. Representation objectives and the model-free agents' auxiliary losses are made of the same ones.
//!
//! | module | what it compares | used by |
//! |---|---|---|
//! | [`pair`] | a distance between rows with a target distance | `dbc`, `mico`, `simsr` |
//! | [`dbc`], [`mico`], [`simsr`] | the distances and targets of the bisimulation metrics | |
//! | [`contrast`] | each row with its own partner among all partners | CURL, next-feature contrast |
//! | [`self_prediction`] | rolled-out predictions with later latents | SPR |
//! | [`inverse`] | an action with what two latents tell about it | multi-step inverse |
//! | [`transition`] | the next latent and the reward with their predictions | `DeepMDP` |
//! | [`kl_constraint`] | posterior and prior, held at a target by a dual variable | `RePo` |
//! | [`characteristic`] | the characteristic function of the next actions with what heads expect of it | SAR |
//! | [`actor_critic`] | action values with their targets, the actor, the temperature | SAC, QT-Opt |

pub mod actor_critic;
pub mod characteristic;
pub mod contrast;
pub mod dbc;
pub mod inverse;
pub mod kl_constraint;
pub mod mico;
pub mod pair;
pub mod self_prediction;
pub mod simsr;
pub mod transition;

#[cfg(test)]
mod tests;
