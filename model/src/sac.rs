//! The networks of the agents that learn from pixels without a world model: soft actor-critic, QT-Opt, and what stands on them (RAD, DrQ, CURL and others). In:
//! stacks of pictures. Out: values of actions, actions, features.
//!
//! Sizes are those that this family of systems shares (`MishaLaskin/rad`, denisyarats/drq): four 3×3 convolutions of 32 filters, a linear layer to 50 features with
//! layer norm and tanh, perceptrons with two hidden layers. The convolutions are tied: the actor looks through those of the critic and never moves them.
//!
//! | module | what it holds |
//! |---|---|
//! | [`config`] | sizes |
//! | [`features`] | convolutions, and the trunk on top of them |
//! | [`critic`] | two critics on one trunk |
//! | [`actor`] | trunk, perceptron, distribution of actions |
//! | [`characteristic`] | SAR's head: the characteristic function of the next actions |
//! | [`networks`] | all of them with the critic's slow copy, and their file |
//! | [`stack`], [`cut`] | the last pictures side by side, and views of them |
//! | [`agent`] | a trained agent at work |

pub mod actor;
pub mod agent;
pub mod characteristic;
pub mod config;
pub mod critic;
pub mod cut;
pub mod features;
pub mod networks;
pub mod stack;

pub use agent::SacAgent;
pub use config::SacConfig;
pub use networks::SacNetworks;
