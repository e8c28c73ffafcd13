//! Which backend tensors live on. `flex` (CPU) is always there; `wgpu` and `cuda` are cargo features. In: a name. Out: the device, or why it cannot be had.

use anyhow::Result;
use burn::tensor::Device;
use clap::{Args, ValueEnum};

/// The option, for the verbs that compute.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct DeviceArgs {
    /// What computes.
    #[arg(long = "device", default_value = "flex", value_name = "DEVICE")]
    name: DeviceName,
}

impl DeviceArgs {
    /// The device itself.
    pub(crate) fn open(self) -> Result<Device> {
        self.name.open()
    }
}

/// A backend by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DeviceName {
    /// The CPU, with kernels made for these networks.
    Flex,
    /// The CPU, through ndarray: slow, for comparison.
    Ndarray,
    /// A GPU through wgpu.
    Wgpu,
    /// An NVIDIA GPU.
    Cuda,
}

impl DeviceName {
    fn open(self) -> Result<Device> {
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
    // `Device::wgpu` would look for a GPU at the first tensor, and panic where there is none.
    Device::wgpu_options().init().map_err(|error| {
        anyhow::anyhow!(
            "{error}; --device wgpu needs a GPU with a driver for Vulkan, Metal or DirectX 12, or Mesa's lavapipe"
        )
    })
}

#[cfg(not(feature = "wgpu"))]
fn wgpu() -> Result<Device> {
    missing("wgpu")
}

#[cfg(feature = "cuda")]
fn cuda() -> Result<Device> {
    // Asked first, because the first tensor on a device that is not there panics.
    if Device::enumerate(burn::tensor::DeviceType::Cuda).is_empty() {
        anyhow::bail!("no CUDA device; --device cuda needs an NVIDIA GPU with its driver and the CUDA toolkit");
    }
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
    Err(vibes_train::TrainError::Options(message).into())
}
