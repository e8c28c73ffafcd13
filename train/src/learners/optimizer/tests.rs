//! Steps with and without gradients, and moments on their way through a file.
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
    let from = (&saved, Path::new("moments"));
    restored.restore("saved", &counts(&shared), from, optimizer.steps(), &Device::flex()).unwrap();
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

/// What is said of these moments of [`module`] after so many steps; nothing if they are taken.
fn refusal(saved: &HostTensors, steps: u64) -> Option<String> {
    let from = (saved, Path::new("moments"));
    let restored = Optimizer::new(1e-8).restore("saved", &counts(&module()), from, steps, &Device::flex());
    restored.err().map(|error| error.to_string())
}

#[test]
fn moments_that_are_not_those_of_the_weights_are_refused() {
    let saved = after(Optimizer::new(1e-8), module(), &[BOTH, BOTH]).0.to_tensors("saved");
    assert_eq!(refusal(&saved, 2), None);
    let refused = |change: &dyn Fn(&mut HostTensors)| {
        let mut changed = saved.clone();
        change(&mut changed);
        refusal(&changed, 2).expect("refused")
    };
    for kind in ["first", "second"] {
        let name = format!("saved.{kind}.weight");
        let shorter = refused(&|all| all.get_mut(&name).unwrap().values.truncate(1));
        assert!(shorter.contains("moments of 1 weights of weight, of which this model has 2 weights"), "{shorter}");
        let lone = refused(&|all| drop(all.remove(&name)));
        assert!(lone.contains(&format!("no {kind} moments of weight")), "{lone}");
    }
    let foreign = refused(&|all| {
        let moments = all["saved.first.bias"].clone();
        all.insert("saved.first.gain".to_owned(), moments);
    });
    assert!(foreign.contains("gain, of which this model has no weights of that name"), "{foreign}");
}

#[test]
fn no_moments_at_all_are_refused_once_steps_were_made() {
    let none = HostTensors::new();
    let refused = refusal(&none, 2).expect("refused");
    assert!(refused.contains("no moments of `saved`, which has made 2 steps"), "{refused}");
    assert_eq!(refusal(&none, 0), None);
    // A parameter that never had a gradient has none.
    assert_eq!(refusal(&after(Optimizer::new(1e-8), module(), &[WEIGHT]).0.to_tensors("saved"), 1), None);
    // Nor has a module without parameters.
    let from = (&none, Path::new("moments"));
    Optimizer::new(1e-8).restore("saved", &Counts::new(), from, 2, &Device::flex()).unwrap();
}
