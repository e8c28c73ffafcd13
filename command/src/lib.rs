//! What the command lines of the three programs share, so that one rule holds for all of them.
//!
//! In: a program's clap parser and its work. Out: the process's exit code. On the way: options from a file ([`config`](self#options-from-a-file)),
//! how much is said ([`Output`]), which options were given ([`Given`]), how it ended ([`Ending`]), and a clean end on signals ([`stop_on_signals`]) and where nothing can be printed. Before everything else: how many threads a matrix
//! product uses ([`products_on_one_thread`]).
//!
//! # Options from a file
//!
//! `--config FILE.toml` or `--config=FILE.toml`, before or behind the verb. A key is a long option of the verb (`_` may stand for `-`), at the
//! top of the file or in a table with the verb's name; tables of other verbs are left alone. What is typed wins, also over an option of the
//! file that it conflicts with. A key that is no option of the verb is an error, because it would have no effect.

mod config;
mod ending;
mod given;
mod output;
mod printing;
mod products;
mod program;
mod signals;

pub use ending::{Ending, error_text};
pub use given::{Given, options_of};
pub use output::Output;
pub use products::products_on_one_thread;
pub use program::{parse, parse_typed, run};
pub use signals::stop_on_signals;
