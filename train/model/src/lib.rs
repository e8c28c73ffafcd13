//! Skeleton.

pub mod kernels;
