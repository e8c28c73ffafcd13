//! The Control Suite's models, embedded at build time, and how MuJoCo reads them: XML text in, a compiled model out.

use mujoco_rs::prelude::MjModel;
use mujoco_rs::wrappers::mj_auxiliary::MjVfs;

use crate::{Error, Result};

/// Every model of the suite by its path there, as in `reacher.xml` and `common/skybox.xml`; listed by the build script.
const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/models.rs"));

/// The text of one of the suite's models, as in `reacher.xml`.
pub(crate) fn suite_xml(name: &str) -> Result<&'static str> {
    let found = FILES.iter().find(|(file, _)| *file == name);
    found
        .map(|(_, text)| *text)
        .ok_or_else(|| Error::Model { name: name.to_owned(), fact: "it is not among the embedded models".to_owned() })
}

/// Compiles a model; `xml` may include the suite's `./common/*.xml`.
pub(crate) fn compile(name: &str, xml: &str) -> Result<MjModel> {
    let refused = |fact: String| Error::Model { name: name.to_owned(), fact };
    let mut files = MjVfs::new();
    for (file, text) in FILES.iter().filter(|(file, _)| file.starts_with("common/")) {
        files.add_from_buffer(file, text.as_bytes()).map_err(|error| refused(error.to_string()))?;
    }
    files.add_from_buffer("model.xml", xml.as_bytes()).map_err(|error| refused(error.to_string()))?;
    MjModel::from_xml_vfs("model.xml", &files).map_err(|error| refused(error.to_string()))
}
