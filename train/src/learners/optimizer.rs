//! Adam over all parameters of a module. In: the module and its gradients. Out: the module after one step. Its moments go by the parameters' names, so that they
//! can be saved and read like weights.

use std::collections::BTreeMap;
use std::path::Path;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use vibes_model::kernels::{Adam, Moments, sum_of_squares};
use vibes_model::parameters::{HostTensor, HostTensors, to_values};

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

    /// The state that [`Optimizer::to_tensors`] saved after `steps` steps, from the tensors of this file.
    ///
    /// # Errors
    /// [`crate::error::TrainError::Malformed`]: a parameter's first step is none of those.
    pub fn restore(
        &mut self,
        prefix: &str,
        (tensors, file): (&HostTensors, &Path),
        steps: u64,
        device: &Device,
    ) -> Result<()> {
        let (first, second) = (format!("{prefix}.first."), format!("{prefix}.second."));
        let load = |tensor: &HostTensor| {
            Tensor::<1>::from_data(TensorData::new(tensor.values.clone(), [tensor.values.len()]), device)
        };
        let named = tensors.iter().filter_map(|(name, tensor)| Some((name.strip_prefix(&first)?, tensor)));
        let pairs = named.filter_map(|(name, tensor)| Some((name, tensor, tensors.get(&format!("{second}{name}"))?)));
        let moments =
            pairs.map(|(name, first, second)| (name.to_owned(), Moments { first: load(first), second: load(second) }));
        self.moments = moments.collect();
        self.begun.clear();
        let begun = format!("{prefix}.begun.");
        let begun =
            tensors.iter().filter_map(|(name, tensor)| Some((name.strip_prefix(&begun)?, tensor.values.first()?)));
        for (name, &begun) in begun {
            // A step that was made leaves moments behind, and comes after those before it.
            if begun.fract() != 0.0 || begun < 0.0 || begun as u64 >= steps || !self.moments.contains_key(name) {
                let fact = format!("{name} began to be learned after {begun} of {steps} steps");
                return Err(malformed(file, fact, "the moments that were saved with this checkpoint's weights"));
            }
            self.begun.insert(name.to_owned(), begun as u64);
        }
        self.steps = steps;
        Ok(())
    }
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
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use vibes_model::init::constant;
    use vibes_model::linear::Linear;

    use super::*;

    type Loss = fn(&Linear) -> Tensor<1>;

    /// Gradients for the weight alone, for the bias alone, for both.
    const WEIGHT: Loss = |module| module.weight.val().square().sum();
    const BIAS: Loss = |module| module.bias.val().square().sum();
    const BOTH: Loss = |module| WEIGHT(module) + BIAS(module);

    fn module() -> Linear {
        let device = Device::flex();
        Linear { weight: constant([2, 1], 2.0, &device), bias: constant([1], -3.0, &device) }.train()
    }

    /// One step for every loss, on from what is there.
    fn after(mut optimizer: Optimizer, mut module: Linear, losses: &[Loss]) -> (Optimizer, Linear) {
        for loss in losses {
            let gradients = NamedGradients::take(&module, &mut loss(&module).backward());
            module = optimizer.step(module, gradients, 0.1, f32::INFINITY);
        }
        (optimizer, module)
    }

    fn values(module: &Linear) -> [Vec<f32>; 2] {
        [to_values(module.weight.val().inner()), to_values(module.bias.val().inner())]
    }

    #[test]
    fn a_step_without_a_gradient_is_none_of_a_parameters_own() {
        let turns = [WEIGHT, WEIGHT, BOTH, WEIGHT, WEIGHT, BOTH];
        for made in [3, 6] {
            let (optimizer, shared) = after(Optimizer::new(1e-8), module(), &turns[..made]);
            let own = |loss: Loss, steps: usize| values(&after(Optimizer::new(1e-8), module(), &vec![loss; steps]).1);
            let [weight, bias] = values(&shared);
            assert_eq!(weight, own(WEIGHT, made)[0], "after {made}");
            assert_eq!(bias, own(BIAS, made / 3)[1], "after {made}");
            assert_eq!(optimizer.begun, BTreeMap::from([("bias".to_owned(), made as u64 / 3 * 2)]));
        }
    }

    #[test]
    fn steps_of_its_own_are_counted_on_from_disk() {
        let (optimizer, shared) = after(Optimizer::new(1e-8), module(), &[BOTH, WEIGHT]);
        let mut restored = Optimizer::new(1e-8);
        let saved = optimizer.to_tensors("saved");
        restored.restore("saved", (&saved, Path::new("moments")), optimizer.steps(), &Device::flex()).unwrap();
        let go_on = |optimizer: Optimizer| values(&after(optimizer, shared.clone(), &[BOTH]).1);
        let gone_on = go_on(restored);
        assert_eq!(gone_on, go_on(optimizer));
        let own = after(Optimizer::new(1e-8), module(), &[BIAS, BIAS]).1;
        assert_eq!(gone_on[1], values(&own)[1]);
    }

    /// So that files of optimisers whose parameters all learn in every step are what they were.
    #[test]
    fn where_every_step_has_all_gradients_nothing_is_noted() {
        let optimizer = after(Optimizer::new(1e-8), module(), &[BOTH, BOTH, BOTH]).0;
        let names: Vec<String> = optimizer.to_tensors("saved").into_keys().collect();
        assert_eq!(names, ["saved.first.bias", "saved.first.weight", "saved.second.bias", "saved.second.weight"]);
    }
}
