//! The seam to Burn: tensors on `flex` as slices, and back.
//!
//! In: tensors of any device. Out: their `flex` primitives, or nothing where a tensor lives elsewhere, is not float32, or
//! is recorded for gradient checkpointing; the caller then falls back to [`plain`](super::plain) operations.

use burn::backend::{Autodiff, Flex};
use burn::tensor::{DType, Device, Int, IntDType, Tensor};
use burn_flex::FlexTensor;

/// A tensor primitive that autodiff follows.
pub(super) type Followed = burn::backend::tensor::FloatTensor<Autodiff<Flex>>;

/// Whether tensors on this device take the custom operations.
pub(super) fn runs_on_flex(device: &Device) -> bool {
    use burn::backend::DispatchDevice;
    match device.as_dispatch() {
        DispatchDevice::Flex(_) => true,
        DispatchDevice::Autodiff(device) => matches!(**device, DispatchDevice::Flex(_)),
        #[allow(unreachable_patterns, reason = "other variants exist with other backend features")]
        _ => false,
    }
}

/// A float32 tensor on `flex`, as autodiff's primitive; one that is not followed becomes a constant.
pub(super) fn followed<const D: usize>(tensor: Tensor<D>) -> Option<Followed> {
    if tensor.dtype() != DType::F32 || !runs_on_flex(&tensor.device()) {
        return None;
    }
    let tensor = if tensor.device().is_autodiff() { tensor } else { Tensor::from_inner(tensor) };
    tensor.try_into_primitive::<Autodiff<Flex>>().ok()
}

/// The tensor with its numbers beside one another: itself where they are, also as a part of a larger one, and a copy elsewhere.
pub(super) fn in_one_piece(tensor: FlexTensor) -> FlexTensor {
    if tensor.is_contiguous() { tensor } else { tensor.to_contiguous() }
}

/// A float32 tensor on `flex` without autodiff, in one piece and with memory of its own.
pub(super) fn unfollowed<const D: usize>(tensor: Tensor<D>) -> Option<FlexTensor> {
    if tensor.dtype() != DType::F32 {
        return None;
    }
    let tensor = tensor.try_into_primitive::<Flex>().ok()?;
    Some(tensor.to_contiguous())
}

/// Pixels on `flex` as bytes in one piece.
pub(super) fn bytes(pixels: &Tensor<4, Int>) -> Option<FlexTensor> {
    let pixels = if pixels.device().is_autodiff() { pixels.clone().inner() } else { pixels.clone() };
    let pixels = if pixels.dtype() == DType::U8 { pixels } else { pixels.cast(IntDType::U8) };
    Some(pixels.try_into_primitive::<Flex>().ok()?.to_contiguous())
}

/// A tensor in one piece as numbers.
pub(super) fn numbers(tensor: &FlexTensor) -> &[f32] {
    tensor.as_slice().expect("a float32 tensor in one piece")
}

/// Numbers as a tensor.
///
/// # Panics
/// If `shape` does not hold as many.
pub(super) fn tensor<const D: usize>(numbers: Vec<f32>, shape: [usize; D]) -> FlexTensor {
    FlexTensor::from_data(burn::tensor::TensorData::new(numbers, shape))
}
