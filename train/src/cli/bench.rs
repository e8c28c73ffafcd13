//! `vibes-train bench`: how long an update takes, by part.

use anyhow::Result;
use clap::Args;
use vibes_train::bench::{Sizes, bench};

use super::Context;
use super::flags::OptionArgs;

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// Height and width of the pictures.
    #[arg(long, default_value_t = 64)]
    size: usize,
    /// Values of an action.
    #[arg(long, default_value_t = 2)]
    actions: usize,
    /// Updates to time; the median counts.
    #[arg(long, default_value_t = 5)]
    repeats: usize,
    #[command(flatten)]
    options: OptionArgs,
}

pub(crate) fn run(context: &Context, args: &BenchArgs) -> Result<()> {
    let options = args.options.resolve()?;
    let sizes = Sizes { picture: args.size, actions: args.actions, repeats: args.repeats };
    let report = bench(&options, sizes, &context.device.open()?)?;
    if context.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    println!(
        "{} update, batch {} × {}, {size}×{size}, depth {}",
        options.objective,
        options.batch,
        options.length,
        options.depth,
        size = args.size
    );
    println!("  whole update                  {:8.1} ms", report.update_ms);
    println!("  encoder CNN, forward          {:8.1} ms", report.cnn_forward_ms);
    println!("  encoder CNN, both passes      {:8.1} ms", report.cnn_both_ms);
    println!("  encoder GRU, both passes      {:8.1} ms", report.gru_both_ms);
    println!("  bytes to tensors (beside)     {:8.1} ms", report.batch_ms);
    println!(
        "  convolutions of an update     {:8.1} GFLOP: {:.0} GFLOP/s over the whole update",
        report.convolution_gflop, report.convolution_gflops
    );
    println!("  matrix product 1024³          {:8.0} GFLOP/s", report.matrix_product_gflops);
    Ok(())
}
