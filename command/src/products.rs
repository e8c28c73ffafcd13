//! One thread for ndarray's matrix products. In and out: the process's environment, which the library reads before its first product.
#![allow(unsafe_code, reason = "there is no other way to tell the library")]

/// How many threads ndarray's products use.
const THREADS: &str = "MATMUL_NUM_THREADS";

/// Makes ndarray's products on one thread, unless the user says otherwise: the programs make many products at once, and the library's own threads wait for each
/// other in busy loops. Beside other work `evaluate` took more than nine minutes instead of one, and on one core a search for neighbours takes twice as long.
///
/// Call it first in `main`.
pub fn products_on_one_thread() {
    if std::env::var_os(THREADS).is_none() {
        // SAFETY: the first thing in `main`: no other thread is there that could read the environment.
        unsafe { std::env::set_var(THREADS, "1") };
    }
}
