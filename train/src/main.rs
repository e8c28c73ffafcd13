//! `vibes-train`: fit VIBES and its ablations to recordings, and encode recordings into latents.

mod cli;

/// How many threads ndarray's products use.
const PRODUCT_THREADS: &str = "MATMUL_NUM_THREADS";

fn main() -> std::process::ExitCode {
    products_on_one_thread();
    cli::main()
}

/// The products of `vibes-measure` are made on one thread, unless the user says otherwise. Theirs wait for each other in busy loops: beside other work,
/// `evaluate` took more than nine minutes instead of one.
#[allow(unsafe_code, reason = "there is no other way to tell the library")]
fn products_on_one_thread() {
    if std::env::var_os(PRODUCT_THREADS).is_none() {
        // SAFETY: the first thing in `main`: no other thread is there that could read the environment.
        unsafe { std::env::set_var(PRODUCT_THREADS, "1") };
    }
}
