//! The operations that decide how long a training update takes on a CPU, each as one function on Burn tensors.
//!
//! In: pixels, weights, gate inputs, parameters with their gradients. Out: features, hidden states, updated parameters; all
//! differentiable through Burn's autodiff where that makes sense.
//!
//! A tensor's device decides how a function runs. On `flex` it is a custom operation with a hand-written backward pass
//! (`convolution`, `conv3`, `transposed`, `recurrence`); on every other device it is the composition of ordinary Burn operations in [`plain`],
//! which is also what the tests compare against. The numbers agree up to float32 rounding.
//!
//! The fast path is float32 throughout. It picks its instructions when the program runs (AVX-512, AVX2 with FMA, or what
//! every machine has, see [`Instructions`]), and its result does not depend on the number of threads. There is no bfloat16
//! path: on the one core of an Emerald Rapids without AMX where it was measured, the bfloat16 dot product (`vdpbf16ps`) did 86 GFLOP/s and
//! the float32 multiply-add 175; the saving comes from multiplying less ([`features`]) and from staying in cache.

pub mod adam;
mod conv3;
mod convolution;
#[cfg(test)]
mod draws;
mod flex;
mod imagination;
mod instructions;
mod lanes;
mod layered;
mod layers;
mod linear;
mod memory;
mod operation;
mod perceptron;
mod pixel_error;
pub mod plain;
mod product;
mod recurrence;
mod sheet;
mod squares;
mod transposed;

pub use adam::{Adam, Moments};
pub use conv3::{conv3_features, conv3_size};
pub use convolution::{feature_count, features, pixel_tensor};
pub use imagination::{ActorWeights, Beginning, Imagined, WorldWeights, imagination};
pub use instructions::Instructions;
pub use layers::{Conv3Layer, ConvLayer, LayerWeights, TransposedLayer};
pub use linear::linear;
pub use perceptron::perceptron;
pub use pixel_error::pixel_error;
pub use recurrence::gru;
pub use squares::sum_of_squares;
pub use transposed::transposed;
