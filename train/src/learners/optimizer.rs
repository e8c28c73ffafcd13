//! Adam over all parameters of a module. In: the module and its gradients. Out: the module after one step. Its moments go by the parameters' names, so that they
//! can be saved and read like weights.

use std::collections::BTreeMap;
use std::path::Path;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use vibes_model::kernels::{Adam, Moments, sum_of_squares};
use vibes_model::parameters::{HostTensor, HostTensors, read_parameters, to_values};

use crate::error::{Result, malformed};

/// Adam's state for one module.
#[derive(Debug, Clone)]
pub struct Optimizer {
    adam: Adam,
    moments: BTreeMap<String, Moments<1>>,
    /// Steps of the module that were none of a parameter's own, where there were any: those before its first one, of a head that is added to a model in training (its moments begin at
    /// zero then, whatever the others have seen), and those that brought it no gradient. Its moments are corrected for its own steps alone.
    begun: BTreeMap<String, u64>,
    steps: u64,
}

/// Gradients of a module by parameter name, flattened.
#[derive(Debug)]
pub struct NamedGradients {
    by_name: BTreeMap<String, Tensor<1>>,
    /// The squares of each one's numbers, summed: asked for several times in a step, and made once.
    squares: BTreeMap<String, f64>,
}

impl NamedGradients {
    /// Takes the gradients of `module` out of `gradients`.
    pub fn take<M: Module>(module: &M, gradients: &mut Gradients) -> Self {
        let mut taker = Taker { path: Vec::new(), gradients, by_name: BTreeMap::new() };
        module.visit(&mut taker);
        let squares = taker.by_name.iter().map(|(name, gradient)| (name.clone(), sum_of_squares(gradient))).collect();
        Self { by_name: taker.by_name, squares }
    }

    /// ℓ₂ norm over all parameters whose name begins with `prefix`.
    pub fn norm(&self, prefix: &str) -> f32 {
        let chosen = self.squares.iter().filter(|(name, _)| name.starts_with(prefix));
        chosen.map(|(_, squares)| squares).sum::<f64>().sqrt() as f32
    }
}

impl Optimizer {
    /// Before its first step.
    pub fn new(epsilon: f32) -> Self {
        Self { adam: Adam { epsilon, ..Adam::default() }, moments: BTreeMap::new(), begun: BTreeMap::new(), steps: 0 }
    }

    /// Steps made so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// One step against the gradients, scaled so that their global norm is at most `clip`.
    pub fn step<M: Module>(&mut self, module: M, gradients: NamedGradients, learning_rate: f64, clip: f32) -> M {
        let norm = gradients.norm("");
        self.steps += 1;
        let scale = if norm > clip { clip / norm } else { 1.0 };
        module.map(&mut Stepper {
            path: Vec::new(),
            optimizer: self,
            gradients: gradients.by_name,
            learning_rate,
            scale,
        })
    }

    /// Notes a step that brings a parameter no gradient, once its own have begun.
    fn pass_over(&mut self, name: String) {
        if self.moments.contains_key(&name) {
            *self.begun.entry(name).or_default() += 1;
        }
    }

    /// The moments as tensors to save, names beginning with `prefix`.
    pub fn to_tensors(&self, prefix: &str) -> HostTensors {
        let mut tensors = HostTensors::new();
        for (name, moments) in &self.moments {
            for (kind, values) in [("first", &moments.first), ("second", &moments.second)] {
                let tensor = HostTensor { shape: vec![values.dims()[0]], values: to_values(values.clone()) };
                tensors.insert(format!("{prefix}.{kind}.{name}"), tensor);
            }
        }
        for (name, begun) in &self.begun {
            let tensor = HostTensor { shape: vec![1], values: vec![*begun as f32] };
            tensors.insert(format!("{prefix}.begun.{name}"), tensor);
        }
        tensors
    }

    /// The state that [`Optimizer::to_tensors`] saved after `steps` steps of a module with these weights, from the tensors of this file. Weights that never had a gradient have none.
    ///
    /// # Errors
    /// [`crate::error::TrainError::Malformed`]: moments are of other weights or are not whole, or a parameter's first step is none of those.
    pub fn restore(
        &mut self,
        prefix: &str,
        counts: &Counts,
        (tensors, file): (&HostTensors, &Path),
        steps: u64,
        device: &Device,
    ) -> Result<()> {
        let [first, second, begun] = ["first", "second", "begun"].map(|kind| of_kind(tensors, prefix, kind));
        let damaged =
            |fact: String| malformed(file, fact, "the moments that were saved with this checkpoint's weights");
        check_moments(counts, &first, &second).map_err(damaged)?;
        if steps > 0 && first.is_empty() && !counts.is_empty() {
            return Err(damaged(format!("no moments of `{prefix}`, which has made {steps} steps")));
        }
        let load = |tensor: &HostTensor| {
            Tensor::<1>::from_data(TensorData::new(tensor.values.clone(), [tensor.values.len()]), device)
        };
        let pairs = first.iter().filter_map(|(name, first)| Some((*name, *first, *second.get(name)?)));
        let moments =
            pairs.map(|(name, first, second)| (name.to_owned(), Moments { first: load(first), second: load(second) }));
        self.moments = moments.collect();
        self.begun = begun_after(&begun, &first, steps).map_err(damaged)?;
        self.steps = steps;
        Ok(())
    }
}

/// Numbers of each parameter of a module, by name.
pub type Counts = BTreeMap<String, usize>;

/// The [`Counts`] of a module.
pub fn counts<M: Module>(module: &M) -> Counts {
    let of = |(name, tensor): (String, HostTensor)| Some((name.strip_prefix("of.")?.to_owned(), tensor.values.len()));
    read_parameters(module, "of").into_iter().filter_map(of).collect()
}

/// Tensors of one kind, by the names of their parameters.
type Named<'a> = BTreeMap<&'a str, &'a HostTensor>;

/// The tensors whose names begin with the prefix and the kind.
fn of_kind<'a>(tensors: &'a HostTensors, prefix: &str, kind: &str) -> Named<'a> {
    let start = format!("{prefix}.{kind}.");
    tensors.iter().filter_map(|(name, tensor)| Some((name.strip_prefix(&start)?, tensor))).collect()
}

/// What is wrong with the moments of a module: of others they would move some of the weights and leave the rest.
fn check_moments(counts: &Counts, first: &Named<'_>, second: &Named<'_>) -> std::result::Result<(), String> {
    for (name, moment) in first.iter().chain(second) {
        let (found, wanted) = (moment.values.len(), counts.get(*name).copied());
        if wanted != Some(found) {
            let wanted = wanted.map_or("no weights of that name".to_owned(), |count| format!("{count} weights"));
            return Err(format!("moments of {found} weights of {name}, of which this model has {wanted}"));
        }
    }
    for (kind, name) in first.keys().map(|name| ("second", name)).chain(second.keys().map(|name| ("first", name))) {
        if !(first.contains_key(name) && second.contains_key(name)) {
            return Err(format!("no {kind} moments of {name}"));
        }
    }
    Ok(())
}

/// Steps that were none of a parameter's own: one that was made leaves moments behind, and comes after those before it.
fn begun_after(
    begun: &Named<'_>,
    moments: &Named<'_>,
    steps: u64,
) -> std::result::Result<BTreeMap<String, u64>, String> {
    let mut all = BTreeMap::new();
    for (name, tensor) in begun {
        let Some(&begun) = tensor.values.first() else { continue };
        // Of a number that is none the fraction is none either.
        if begun.fract() != 0.0 || begun < 0.0 || begun as u64 >= steps || !moments.contains_key(name) {
            return Err(format!("{name} began to be learned after {begun} of {steps} steps"));
        }
        all.insert((*name).to_owned(), begun as u64);
    }
    Ok(all)
}

struct Taker<'a> {
    path: Vec<String>,
    gradients: &'a mut Gradients,
    by_name: BTreeMap<String, Tensor<1>>,
}

impl ModuleVisitor for Taker<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = param.val().grad_remove(self.gradients) {
            let count = gradient.shape().num_elements();
            self.by_name.insert(self.path.join("."), gradient.reshape([count]));
        }
    }
}

struct Stepper<'a> {
    path: Vec<String>,
    optimizer: &'a mut Optimizer,
    gradients: BTreeMap<String, Tensor<1>>,
    learning_rate: f64,
    scale: f32,
}

impl ModuleMapper for Stepper<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.join(".");
        let Some(gradient) = self.gradients.remove(&name) else {
            self.optimizer.pass_over(name);
            return param;
        };
        let moments = self.optimizer.moments.remove(&name);
        let (id, tensor, mapper) = param.consume();
        let shape = tensor.dims();
        // `inner` leaves the autodiff graph; by now nothing else holds the values, so Adam may work in place.
        let flat = tensor.inner().reshape([gradient.dims()[0]]);
        let Optimizer { adam, steps, .. } = *self.optimizer;
        if moments.is_none() && steps > 1 {
            self.optimizer.begun.insert(name.clone(), steps - 1);
        }
        let begun = self.optimizer.begun.get(&name).copied().unwrap_or(0);
        let (flat, moments) = adam.update(flat, gradient, moments, self.learning_rate, self.scale, steps - begun);
        self.optimizer.moments.insert(name, moments);
        let tensor = Tensor::from_inner(flat.reshape(shape)).require_grad();
        Param::from_mapped_value(id, tensor, mapper)
    }
}

#[cfg(test)]
mod tests;
