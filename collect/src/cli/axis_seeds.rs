//! The seeds of single axes as arguments, for every verb that draws distractors.

use clap::Args;

use crate::plan::ChosenSeeds;

#[derive(Clone, Copy, Debug, Args)]
pub(super) struct AxisSeedArgs {
    /// Seed of the videos alone; then the same states and cameras have other backgrounds.
    #[arg(long, value_name = "N")]
    background_seed: Option<u64>,
    /// Seed of the camera's walk alone.
    #[arg(long, value_name = "N")]
    camera_seed: Option<u64>,
    /// Seed of the colours alone.
    #[arg(long, value_name = "N")]
    color_seed: Option<u64>,
}

impl From<AxisSeedArgs> for ChosenSeeds {
    fn from(args: AxisSeedArgs) -> Self {
        Self { background: args.background_seed, camera: args.camera_seed, color: args.color_seed }
    }
}
