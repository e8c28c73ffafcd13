//! A slow copy of a module, which follows it by exponential moving averages. In: the copy, the module, a rate for every parameter. Out: the copy moved towards it.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::Tensor;

/// `copy + rate · (module − copy)` for every parameter, outside of autodiff; `rate` is asked by the parameter's name.
pub fn towards<M: Module>(copy: M, module: &M, rate: impl Fn(&str) -> f32) -> M {
    let mut reader = Reader { path: Vec::new(), found: BTreeMap::new() };
    module.visit(&mut reader);
    copy.map(&mut Mover { path: Vec::new(), goals: reader.found, rate })
}

struct Reader {
    path: Vec<String>,
    found: BTreeMap<String, Tensor<1>>,
}

impl ModuleVisitor for Reader {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let value = param.val();
        let value = if value.device().is_autodiff() { value.inner() } else { value };
        let count = value.shape().num_elements();
        self.found.insert(self.path.join("."), value.reshape([count]));
    }
}

struct Mover<R> {
    path: Vec<String>,
    goals: BTreeMap<String, Tensor<1>>,
    rate: R,
}

impl<R: Fn(&str) -> f32> ModuleMapper for Mover<R> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.join(".");
        let Some(goal) = self.goals.remove(&name) else { return param };
        let rate = (self.rate)(&name);
        param.map(|value| {
            let value = if value.device().is_autodiff() { value.inner() } else { value };
            let goal = goal.reshape(value.dims());
            value.clone() + (goal - value) * rate
        })
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor};
    use rand::SeedableRng;

    use super::*;
    use crate::linear::LinearConfig;
    use crate::parameters::to_values;

    #[test]
    fn every_parameter_moves_by_its_own_rate() {
        let device = Device::flex();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut layer = || LinearConfig { input: 3, output: 2 }.init(&mut rng, &device);
        let (copy, goal) = (layer(), layer());
        let goal = crate::linear::Linear { bias: goal.bias.map(|_| Tensor::from_data([5.0, -2.0], &device)), ..goal };
        let moved = towards(copy.clone(), &goal, |name| if name == "bias" { 1.0 } else { 0.25 });
        assert_eq!(to_values(moved.bias.val()), [5.0, -2.0]);
        let (from, to) = (to_values(copy.weight.val()), to_values(goal.weight.val()));
        for ((moved, from), to) in to_values(moved.weight.val()).iter().zip(&from).zip(&to) {
            assert!((moved - (from + 0.25 * (to - from))).abs() < 1e-6);
        }
    }
}
