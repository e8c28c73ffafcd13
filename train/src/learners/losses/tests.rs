//! Every loss against numbers computed in float64 by other programs (`tests/golden/README.md`): values, and gradients where learning needs them.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use burn::module::Param;
use burn::tensor::{Device, Gradients, Int, Tensor, TensorData};
use serde_json::Value as Json;
use vibes_model::cross_entropy::CrossEntropy;
use vibes_model::linear::Linear;
use vibes_model::mlp::Mlp;
use vibes_model::parameters::to_values;
use vibes_model::sac::characteristic::Characteristic;

use super::*;
use crate::learners::losses::dbc::NextLatent;
use crate::learners::losses::kl_constraint::Beliefs;
use crate::learners::recurrent::model_losses::{self, Predicted};
use crate::learners::recurrent::options::RecurrentOptions;
use crate::learners::sac::options::Size;

const TOLERANCE: f32 = 1e-5;

/// One case of a golden file.
struct Case {
    json: Json,
    device: Device,
}

fn case(file: &str, name: &str) -> Case {
    let golden: Json = serde_json::from_str(file).unwrap();
    Case { json: golden["cases"][name].clone(), device: Device::flex().autodiff() }
}

fn shared(name: &str) -> Case {
    case(include_str!("../../../tests/golden/losses.json"), name)
}

fn own(name: &str) -> Case {
    case(include_str!("../../../tests/golden/baselines.json"), name)
}

fn flatten(json: &Json, out: &mut Vec<f32>) {
    match json {
        Json::Array(items) => items.iter().for_each(|item| flatten(item, out)),
        number => out.push(number.as_f64().unwrap() as f32),
    }
}

fn numbers(json: &Json) -> Vec<f32> {
    let mut out = Vec::new();
    flatten(json, &mut out);
    out
}

fn shape<const D: usize>(json: &Json) -> [usize; D] {
    let (mut shape, mut at) = ([1; D], json);
    for length in &mut shape {
        if let Some(items) = at.as_array() {
            (*length, at) = (items.len(), &items[0]);
        }
    }
    shape
}

fn assert_close(found: &[f32], wanted: &[f32], what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for (index, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        let error = (found - wanted).abs() / wanted.abs().max(1.0);
        assert!(error <= TOLERANCE, "{what}[{index}]: {found} against {wanted}");
    }
}

impl Case {
    /// An input as a tensor whose gradient is kept.
    fn input<const D: usize>(&self, name: &str) -> Tensor<D> {
        let json = &self.json["in"][name];
        Tensor::<D>::from_data(TensorData::new(numbers(json), shape::<D>(json)), &self.device).require_grad()
    }

    fn number(&self, name: &str) -> f32 {
        self.json["in"][name].as_f64().unwrap() as f32
    }

    fn is_out<const D: usize>(&self, name: &str, found: Tensor<D>) {
        assert_close(&to_values(found), &numbers(&self.json["out"][name]), name);
    }

    fn is_gradient<const D: usize>(&self, name: &str, of: &Tensor<D>, gradients: &Gradients) {
        let found = of.grad(gradients).unwrap_or_else(|| panic!("no gradient for {name}"));
        assert_close(&to_values(found), &numbers(&self.json["grad"][name]), name);
    }
}

#[test]
fn what_stands_beside_the_critics_in_core() {
    let case = own("core");
    let options = RecurrentOptions::system("core", Size::Small).unwrap();
    let wide = |name: &str| case.input::<2>(name);
    let line = |name: &str| case.input::<1>(name);
    let (features, sharpness) = (wide("features"), line("sharpness"));
    let beliefs = Beliefs {
        mean: wide("mean"),
        std: case.number("std"),
        prior_mean: wide("prior_mean"),
        prior_std: wide("prior_std"),
    };
    let (rewards, actions) = (line("reward_prediction"), wide("action_prediction"));
    let expected = wide("expected");
    let predicted = Predicted {
        features: expected.clone(),
        sharpness: sharpness.clone(),
        rewards: rewards.clone(),
        actions: actions.clone(),
        beliefs: beliefs.clone(),
    };
    let loss = model_losses::of(predicted, features.clone(), line("reward"), wide("action"), &options);
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    let of_wide = [
        ("expected", &expected),
        ("features", &features),
        ("action_prediction", &actions),
        ("mean", &beliefs.mean),
        ("prior_mean", &beliefs.prior_mean),
        ("prior_std", &beliefs.prior_std),
    ];
    for (name, of) in of_wide {
        case.is_gradient(name, of, &gradients);
    }
    case.is_gradient("sharpness", &sharpness, &gradients);
    case.is_gradient("reward_prediction", &rewards, &gradients);
    // Below the free nats the divergence is a constant.
    let free = RecurrentOptions { free_nats: 1e3, ..options };
    let predicted = Predicted { features: expected, sharpness, rewards, actions, beliefs: beliefs.clone() };
    let loss = model_losses::of(predicted, features, line("reward"), wide("action"), &free);
    let of_mean = beliefs.mean.grad(&loss.backward()).map_or(0.0, |gradient| gradient.abs().max().into_scalar());
    assert_eq!(of_mean, 0.0);
}

/// The head's forward pass too: the oracle computes it row by row.
#[test]
fn characteristic_functions_of_actions() {
    let case = own("sar");
    let (wide, line) = (|name: &str| case.input::<2>(name), |name: &str| case.input::<1>(name));
    let linear = |weight: &str, bias: &str| Linear {
        weight: Param::from_tensor(wide(weight)),
        bias: Param::from_tensor(line(bias)),
    };
    let head = Characteristic {
        actions: linear("g", "g_bias"),
        rewards: linear("r", "r_bias"),
        frequency: linear("f", "f_bias"),
        predictor: Mlp { first: linear("w1", "b1"), second: linear("w2", "b2"), last: linear("w3", "b3") },
        center: Param::from_tensor(line("center")),
        spread: Param::from_tensor(line("spread")),
    };
    let (features, views) = (wide("features"), case.number("views") as usize);
    let all_views = |name: &str| wide(name).repeat_dim(0, views);
    let frequencies = head.frequencies(wide("noise"));
    let expected = head.expected(features.clone(), all_views("rewards"), frequencies.clone());
    let own = head.own(frequencies, all_views("actions"));
    let loss = characteristic::loss(expected, own, views, case.number("best") as usize);
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("features", &features, &gradients);
    let Mlp { first, second, last } = &head.predictor;
    let layers = [
        (["g", "g_bias"], &head.actions),
        (["r", "r_bias"], &head.rewards),
        (["f", "f_bias"], &head.frequency),
        (["w1", "b1"], first),
        (["w2", "b2"], second),
        (["w3", "b3"], last),
    ];
    for ([weight, bias], layer) in layers {
        case.is_gradient(weight, &layer.weight.val(), &gradients);
        case.is_gradient(bias, &layer.bias.val(), &gradients);
    }
    case.is_gradient("center", &head.center.val(), &gradients);
    case.is_gradient("spread", &head.spread.val(), &gradients);
}

#[test]
fn soft_actor_critic() {
    let case = shared("sac");
    let input = |name: &str| case.input::<1>(name);
    let (alpha, discount) = (case.number("alpha"), case.number("gamma"));
    let (q1, q2) = (input("q1"), input("q2"));
    let value = actor_critic::soft_value([input("q1n"), input("q2n")], input("logp_n"), alpha);
    let target = actor_critic::target(input("r"), value, discount);
    case.is_out("target", target.clone());
    let loss = actor_critic::critic_loss([q1.clone(), q2.clone()], &target);
    case.is_out("loss", loss.clone());
    case.is_out("actor_loss", actor_critic::actor_loss([input("q1a"), input("q2a")], input("logp"), alpha));
    let log_alpha = Tensor::<1>::from_data([alpha.ln()], &case.device).require_grad();
    let temperature = actor_critic::temperature_loss(log_alpha.clone(), input("logp"), case.number("target_entropy"));
    case.is_out("temperature_loss", temperature.clone());
    // The loss is α times a constant, so its slope in ln α is the loss itself.
    assert_close(&to_values(log_alpha.grad(&temperature.clone().backward()).unwrap()), &to_values(temperature), "ln α");
    let gradients = loss.backward();
    case.is_gradient("q1", &q1, &gradients);
    case.is_gradient("q2", &q2, &gradients);
}

#[test]
fn views_average_the_target_and_add_up_the_loss() {
    let case = shared("drq");
    let (next, values) = (case.input::<2>("qn"), case.input::<2>("q"));
    let view = |x: &Tensor<2>, index: usize| x.clone().narrow(0, index, 1).squeeze_dim::<1>(0);
    let next = actor_critic::over_views(vec![view(&next, 0), view(&next, 1)]);
    let target = actor_critic::target(case.input::<1>("r"), next, case.number("gamma"));
    case.is_out("target", target.clone());
    // The case has one critic; the other one is made perfect.
    let loss = |index| actor_critic::critic_loss([view(&values, index), target.clone()], &target);
    let loss = loss(0) + loss(1);
    case.is_out("loss", loss.clone());
    case.is_gradient("q", &values, &loss.backward());
}

#[test]
fn huber_critics() {
    let case = own("huber_critic");
    let (q1, q2) = (case.input::<1>("q1"), case.input::<1>("q2"));
    let loss = actor_critic::huber_critic_loss([q1.clone(), q2.clone()], &case.input::<1>("y"));
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("q1", &q1, &gradients);
    case.is_gradient("q2", &q2, &gradients);
}

#[test]
fn bilinear_contrast() {
    let case = shared("curl");
    let (queries, keys, bilinear) = (case.input::<2>("q"), case.input::<2>("k"), case.input::<2>("W"));
    case.is_out("logits", contrast::bilinear_logits(queries.clone(), keys.clone(), bilinear.clone()));
    let loss = contrast::bilinear(queries.clone(), keys.clone(), bilinear.clone());
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("q", &queries, &gradients);
    case.is_gradient("W", &bilinear, &gradients);
    assert!(keys.grad(&gradients).is_none(), "no gradient to the keys");
}

#[test]
fn next_feature_contrast() {
    let case = shared("contrastive");
    let (y, x) = (case.input::<2>("y"), case.input::<2>("x"));
    let temperature = Tensor::<1>::from_data([case.number("tau")], &case.device).require_grad();
    case.is_out("logits", contrast::scaled_logits(y.clone(), x.clone(), temperature.clone()));
    let loss = contrast::next_feature(y.clone(), x.clone(), temperature.clone());
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("y", &y, &gradients);
    case.is_gradient("x", &x, &gradients);
    case.is_gradient("tau", &temperature, &gradients);
}

#[test]
fn bisimulation_for_control() {
    let case = shared("dbc");
    let (z, rewards) = (case.input::<2>("z"), case.input::<1>("r"));
    let next = NextLatent { mean: case.input::<2>("mu"), std: case.input::<2>("sigma") };
    let partners: Vec<i32> = serde_json::from_value(case.json["out"]["permutation"].clone()).unwrap();
    let rows = partners.len();
    let partners = Tensor::<1, Int>::from_data(TensorData::new(partners, [rows]), &case.device);
    let discount = case.number("gamma");
    case.is_out("target", dbc::target(&rewards, &next, &partners, discount));
    let loss = dbc::loss(z.clone(), &rewards, &next, &partners, discount);
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("z", &z, &gradients);
    assert!(next.mean.grad(&gradients).is_none() && next.std.grad(&gradients).is_none());
}

#[test]
fn mico_distances() {
    let case = shared("mico");
    let (x, slow, next) = (case.input::<2>("x"), case.input::<2>("y"), case.input::<2>("nxt"));
    case.is_out("distance", mico::distance(&x, &slow));
    let loss = mico::loss(&x, slow.clone(), next.clone(), &case.input::<1>("r"), case.number("gamma"));
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("x", &x, &gradients);
    assert!(slow.grad(&gradients).is_none() && next.grad(&gradients).is_none());
}

#[test]
fn cosine_distances() {
    let case = shared("simsr");
    let (z, next) = (case.input::<2>("z"), case.input::<2>("nxt"));
    let loss = simsr::loss(&z, next.clone(), &case.input::<1>("r"), case.number("gamma"));
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("z", &z, &gradients);
    assert!(next.grad(&gradients).is_none());
}

#[test]
fn self_predictions() {
    let case = shared("self_prediction");
    let (predictions, targets) = (case.input::<3>("pred"), case.input::<3>("tgt"));
    let loss = self_prediction::loss(predictions.clone(), targets.clone());
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("pred", &predictions, &gradients);
    assert!(targets.grad(&gradients).is_none());
}

#[test]
fn constrained_divergence() {
    let case = shared("kl_constraint");
    let (mean, prior_mean, prior_std) = (case.input::<2>("mq"), case.input::<2>("mp"), case.input::<2>("sp"));
    let beliefs =
        Beliefs { mean: mean.clone(), std: 0.1, prior_mean: prior_mean.clone(), prior_std: prior_std.clone() };
    case.is_out("kl", beliefs.divergence());
    let loss = beliefs.divergence().mean();
    case.is_out("loss", loss.clone());
    let log_beta = Tensor::<1>::from_data([case.number("log_beta")], &case.device).require_grad();
    let dual = kl_constraint::dual_loss(log_beta.clone(), loss.clone(), case.number("target"));
    case.is_out("beta_loss", dual.clone());
    // β must rise while the divergence is above its target: the slope in ln β is then below 0.
    assert!(to_values(log_beta.grad(&dual.backward()).unwrap())[0] < 0.0);
    let gradients = loss.backward();
    case.is_gradient("mq", &mean, &gradients);
    case.is_gradient("mp", &prior_mean, &gradients);
    case.is_gradient("sp", &prior_std, &gradients);
    // The balanced form has the same value and so many parts of each gradient.
    let balanced = beliefs.balanced_divergence().mean();
    case.is_out("loss", balanced.clone());
    let parts = balanced.backward();
    for (tensor, share) in [(&mean, 1.0 / 6.0), (&prior_mean, 5.0 / 6.0), (&prior_std, 5.0 / 6.0)] {
        let whole: Vec<f32> = to_values(tensor.grad(&gradients).unwrap()).iter().map(|value| value * share).collect();
        assert_close(&to_values(tensor.grad(&parts).unwrap()), &whole, "share");
    }
}

#[test]
fn inverse_dynamics() {
    let case = own("inverse");
    let predictions = case.input::<2>("prediction");
    let loss = inverse::loss(predictions.clone(), case.input::<2>("action"));
    case.is_out("loss", loss.clone());
    case.is_gradient("prediction", &predictions, &loss.backward());
}

#[test]
fn inverse_pairs_lie_in_their_window_and_every_distance_is_equally_likely() {
    use rand::SeedableRng;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let (length, batch, most) = (9, 400, 4);
    let pairs = inverse::Pairs::draw(length, batch, most, &mut rng);
    assert_eq!(pairs.earlier.len(), (length - 1) * batch);
    let mut counts = [0_u32; 5];
    for ((earlier, later), steps) in pairs.earlier.iter().zip(&pairs.later).zip(&pairs.steps) {
        assert_eq!(later - earlier, (steps * batch) as i32);
        assert!(*later < (length * batch) as i32);
        // Where the window leaves room for all of them.
        if (*earlier as usize) < (length - most) * batch {
            counts[*steps] += 1;
        }
    }
    // 2000 draws of four values: 500 each, with a standard deviation of 19.
    assert!(counts[1..].iter().all(|&count| count.abs_diff(500) < 100), "{counts:?}");
}

#[test]
fn transitions() {
    let case = own("transition");
    let (mean, std) = (case.input::<2>("mean"), case.input::<2>("std"));
    let (next, prediction) = (case.input::<2>("next"), case.input::<1>("prediction"));
    let latent = transition::latent(&NextLatent { mean: mean.clone(), std: std.clone() }, next.clone());
    let loss = latent + transition::reward(prediction.clone(), case.input::<1>("reward"));
    case.is_out("loss", loss.clone());
    let gradients = loss.backward();
    case.is_gradient("mean", &mean, &gradients);
    case.is_gradient("std", &std, &gradients);
    case.is_gradient("prediction", &prediction, &gradients);
    assert!(next.grad(&gradients).is_none());
}

#[test]
fn cross_entropy_search_takes_the_same_way_to_the_best_action() {
    let case = own("cross_entropy");
    let count = |name: &str| case.number(name) as usize;
    let (noise, best) = (case.input::<3>("noise").inner(), case.input::<2>("best_action").inner());
    let [rows, width] = best.dims();
    let search = CrossEntropy { samples: count("samples"), elites: count("elites"), iterations: noise.dims()[0] };
    let wanted = best.unsqueeze_dim::<3>(1).repeat_dim(1, search.samples).reshape([rows * search.samples, width]);
    let found =
        search.search(noise, |actions| (actions - wanted.clone()).square().sum_dim(1).squeeze_dim::<1>(1).neg());
    case.is_out("actions", found);
}
