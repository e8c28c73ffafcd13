//! The Python package `vibes`: this toolkit's environments, recordings, measures and trained models on numpy arrays.
//!
//! In: numbers, names and arrays from Python. Out: arrays, dictionaries, and exceptions with the toolkit's own messages. What is here is the extension
//! module `vibes._vibes`; the folder `package/` makes of it what Gymnasium, `dm_env` and PyTorch expect. Nothing here holds the interpreter's
//! lock while it works, only while it copies the arrays it is given, and nothing a caller passes ends the process.

mod arrays;
mod error;
mod keeper;
mod measures;
mod models;
mod recording;
mod threads;
mod world;
mod writer;

use pyo3::prelude::*;

#[pymodule]
fn _vibes(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Error", module.py().get_type::<error::Error>())?;
    module.add_class::<measures::Table>()?;
    module.add_function(wrap_pyfunction!(measures::past_actions, module)?)?;
    module.add_class::<models::Model>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<recording::Episode>()?;
    module.add_class::<recording::Windows>()?;
    module.add_class::<world::World>()?;
    module.add_class::<writer::Writer>()?;
    module.add_function(wrap_pyfunction!(task_names, module)?)?;
    module.add_function(wrap_pyfunction!(example_tasks, module)?)
}

/// The names of the tasks.
#[pyfunction]
fn task_names() -> Vec<&'static str> {
    vibes_env::task_names()
}

/// Every name that the tasks give as an example: a pattern such as `swimmer-N` stands for several.
#[pyfunction]
fn example_tasks() -> Vec<&'static str> {
    vibes_env::all_example_tasks()
}
