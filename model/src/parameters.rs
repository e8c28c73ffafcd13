//! Parameters by name: reads a module's tensors out as plain numbers and puts plain numbers back. Names are the module's field
//! path (`encoder.gru.w_hidden`), which are also the names in a checkpoint.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};

use crate::error::ModelError;

/// One tensor on the host: row-major values and their shape.
#[derive(Debug, Clone, PartialEq)]
pub struct HostTensor {
    /// Length of every axis.
    pub shape: Vec<usize>,
    /// The values, row-major.
    pub values: Vec<f32>,
}

/// Tensors by name, in the order of their names.
pub type HostTensors = BTreeMap<String, HostTensor>;

/// Copies every parameter of `module` to the host; names begin with `prefix` and a dot.
pub fn read_parameters<M: Module>(module: &M, prefix: &str) -> HostTensors {
    let mut reader = Reader { path: vec![prefix.to_owned()], found: BTreeMap::new() };
    module.visit(&mut reader);
    reader.found
}

/// Puts `tensors` (names as from [`read_parameters`]) into `module`; each parameter keeps its device and whether it is trained.
///
/// # Errors
/// A parameter of `module` that is absent from `tensors`, or has another shape there.
pub fn write_parameters<M: Module>(module: M, prefix: &str, tensors: &HostTensors) -> Result<M, ModelError> {
    let mut writer = Writer { path: vec![prefix.to_owned()], tensors, error: None };
    let module = module.map(&mut writer);
    match writer.error {
        Some(error) => Err(error),
        None => Ok(module),
    }
}

struct Reader {
    path: Vec<String>,
    found: HostTensors,
}

impl ModuleVisitor for Reader {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        let shape = tensor.dims().to_vec();
        self.found.insert(self.path.join("."), HostTensor { shape, values: to_values(tensor) });
    }
}

struct Writer<'a> {
    path: Vec<String>,
    tensors: &'a HostTensors,
    error: Option<ModelError>,
}

impl ModuleMapper for Writer<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.join(".");
        let wanted = param.val().dims().to_vec();
        match self.tensors.get(&name) {
            None => {
                self.error.get_or_insert(ModelError::MissingTensor { name });
                param
            }
            Some(found) if found.shape != wanted => {
                let error = ModelError::TensorShape { name, found: found.shape.clone(), wanted };
                self.error.get_or_insert(error);
                param
            }
            Some(found) => param.map(|tensor| {
                let trained = tensor.is_require_grad();
                let data = TensorData::new(found.values.clone(), found.shape.clone());
                Tensor::from_data(data, &tensor.device()).set_require_grad(trained)
            }),
        }
    }
}

/// The values of a tensor, row-major, on the host.
pub fn to_values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    let data = tensor.into_data_as::<f32>();
    data.try_into_vec().unwrap_or_default()
}
