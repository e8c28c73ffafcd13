//! Which backend tensors live on. `flex` (CPU) is always there; `wgpu` and `cuda` are cargo features.

use anyhow::Result;
use burn::tensor::Device;
use clap::ValueEnum;
use vibes_train::TrainError;

/// A backend by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DeviceName {
    /// The CPU, with kernels of our own.
    Flex,
    /// The CPU, through ndarray: slow, for comparison.
    Ndarray,
    /// A GPU through wgpu.
    Wgpu,
    /// An NVIDIA GPU.
    Cuda,
}

impl DeviceName {
    /// The device itself.
    pub(crate) fn open(self) -> Result<Device> {
        match self {
            Self::Flex => Ok(Device::flex()),
            Self::Ndarray => Ok(ndarray()),
            Self::Wgpu => wgpu(),
            Self::Cuda => cuda(),
        }
    }
}

#[allow(deprecated, reason = "kept so that it can be chosen and compared with")]
fn ndarray() -> Device {
    Device::ndarray()
}

#[cfg(feature = "wgpu")]
fn wgpu() -> Result<Device> {
    Ok(Device::wgpu(Default::default()))
}

#[cfg(not(feature = "wgpu"))]
fn wgpu() -> Result<Device> {
    missing("wgpu")
}

#[cfg(feature = "cuda")]
fn cuda() -> Result<Device> {
    Ok(Device::cuda(0))
}

#[cfg(not(feature = "cuda"))]
fn cuda() -> Result<Device> {
    missing("cuda")
}

#[cfg(not(all(feature = "wgpu", feature = "cuda")))]
fn missing(name: &str) -> Result<Device> {
    let message = format!(
        "this program was built without {name}; build it with `cargo build --features vibes-train/{name}`, or use --device flex"
    );
    Err(TrainError::Options(message).into())
}
