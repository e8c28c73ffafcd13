//! The networks of the agents that act through a GRU and do not imagine: recurrent soft actor-critic, and `CoRe` (apple/ml-core) on the same ones. In: pictures one at a
//! time. Out: values of actions, actions, latents.
//!
//! The encoder and the GRU of the dynamics are those of a world model ([`World`](crate::World)), so that both kinds of agents look at pictures alike; critics and actor
//! are perceptrons over (h, s), hidden state and latent.
//!
//! | module | what it holds |
//! |---|---|
//! | [`networks`] | all of them with the critics' slow copy, and their file |
//! | [`agent`] | a trained agent at work |

pub mod agent;
pub mod networks;

pub use agent::RecurrentAgent;
pub use networks::{RecurrentConfig, RecurrentNetworks};
