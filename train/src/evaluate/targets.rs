//! What the probes try to read: the task's own quantities, and the distractors' parameters; and the features of past actions they are compared with.

use vibes_data::{EpisodeView, Spec};

use super::probe::{held_out, r_squared};
use super::{Cells, GridTable, Probe};

/// Past actions that enter the action-only control.
const RECENT: usize = 8;
/// Decays of the running averages that enter it too.
const DECAYS: [f32; 2] = [0.9, 0.98];
/// Numbers the control has for every axis of the action.
pub(super) const ACTION_FEATURES: usize = RECENT + DECAYS.len();

/// What past actions say at a row: the last eight, and two running averages of all.
pub(super) fn action_features(view: &EpisodeView, row: usize, out: &mut Vec<f32>) {
    let axes = view.action(0).len();
    for back in 1..=RECENT {
        match row.checked_sub(back) {
            Some(before) => out.extend_from_slice(view.action(before)),
            None => out.extend(std::iter::repeat_n(0.0, axes)),
        }
    }
    for decay in DECAYS {
        let mut average = vec![0.0; axes];
        for before in 0..row {
            average
                .iter_mut()
                .zip(view.action(before))
                .for_each(|(average, action)| *average += (1.0 - decay) * (action - *average));
        }
        out.extend(average);
    }
}

/// Every probe of a grid. Task quantities are held out by state trajectory, distractor parameters by distractor trajectory, so that no probe can
/// know a trajectory by heart; the video is asked of held-out states.
pub(super) fn probes(spec: &Spec, cells: &Cells, latents: &GridTable, actions: &GridTable) -> Vec<Probe> {
    let mut probes = task_probes(spec, cells, latents, actions);
    let camera = cells.table(4, |view, row, out| {
        let camera = view.camera(row);
        out.extend([camera.r, camera.h, camera.v, camera.roll].map(|x| x as f32));
    });
    let names = ["camera distance", "camera azimuth", "camera inclination", "camera roll"].map(str::to_owned);
    probes.extend(regress(&names, "distractor", Hold::Distractors, &camera, latents, actions));
    let colors = 3 * spec.materials.len();
    if colors > 0 {
        let table = cells.table(colors, |view, row, out| out.extend_from_slice(view.colors(row)));
        let names: Vec<String> = spec
            .materials
            .iter()
            .flat_map(|material| ["red", "green", "blue"].map(|channel| format!("{material} {channel}")))
            .collect();
        probes.extend(regress(&names, "distractor", Hold::Distractors, &table, latents, actions));
    }
    probes.extend(video(cells, latents, actions));
    probes
}

#[derive(Clone, Copy)]
enum Hold {
    States,
    Distractors,
}

/// The observation's numbers, their squares, and the distance to a target. The squares are what a latent can hold of a number while it cannot tell left from
/// right: a task that is its own mirror image earns the same rewards on both sides.
fn task_probes(spec: &Spec, cells: &Cells, latents: &GridTable, actions: &GridTable) -> Vec<Probe> {
    let mut names = spec.observation_names();
    let squares: Vec<String> = names.iter().map(|name| format!("{name} squared")).collect();
    names.extend(squares);
    let target = part_range(spec, "to_target");
    if target.is_some() {
        names.push("distance to target".to_owned());
    }
    let table = cells.table(names.len(), |view, row, out| {
        let observation = view.observation(row);
        out.extend_from_slice(observation);
        out.extend(observation.iter().map(|x| x * x));
        if let Some(range) = target.clone() {
            out.push(observation[range].iter().map(|x| x * x).sum::<f32>().sqrt());
        }
    });
    regress(&names, "task", Hold::States, &table, latents, actions)
}

fn part_range(spec: &Spec, name: &str) -> Option<std::ops::Range<usize>> {
    let mut start = 0;
    for part in &spec.observation {
        if part.name == name {
            return Some(start..start + part.len);
        }
        start += part.len;
    }
    None
}

fn regress(
    names: &[String],
    kind: &'static str,
    hold: Hold,
    targets: &GridTable,
    latents: &GridTable,
    actions: &GridTable,
) -> Vec<Probe> {
    let (blocks, count) = blocks(targets, hold);
    let of = |features: &GridTable| {
        let predictions = held_out(&features.values, features.dims, &targets.values, targets.dims, &blocks, count);
        r_squared(&predictions, &targets.values, targets.dims)
    };
    let (latents, actions) = (of(latents), of(actions));
    let probe = |(index, name): (usize, &String)| Probe {
        name: name.clone(),
        kind,
        latents: latents[index],
        actions: actions[index],
        chance: 0.0,
    };
    names.iter().enumerate().map(probe).filter(|probe| probe.latents.is_finite()).collect()
}

fn blocks(table: &GridTable, hold: Hold) -> (Vec<usize>, usize) {
    let block = |row: usize| match hold {
        Hold::States => row / (table.steps * table.distractors),
        Hold::Distractors => row / table.steps % table.distractors,
    };
    let count = match hold {
        Hold::States => table.states,
        Hold::Distractors => table.distractors,
    };
    ((0..table.states * table.distractors * table.steps).map(block).collect(), count)
}

/// Which video plays, as the largest of one ridge regression a video; none where there are fewer than two.
fn video(cells: &Cells, latents: &GridTable, actions: &GridTable) -> Option<Probe> {
    let ids = cells
        .table(1, |view, row, out| out.push(view.background(row).map_or(-1.0, |background| background.video as f32)));
    let mut classes: Vec<i64> = ids.values.iter().map(|&id| id as i64).collect();
    classes.sort_unstable();
    classes.dedup();
    if classes.len() < 2 {
        return None;
    }
    let count = classes.len();
    let class_of = |id: f32| classes.binary_search(&(id as i64)).unwrap_or(0);
    let labels: Vec<usize> = ids.values.iter().map(|&id| class_of(id)).collect();
    let one_hot: Vec<f32> =
        labels.iter().flat_map(|&label| (0..count).map(move |class| f32::from(class == label))).collect();
    let (blocks, folds) = blocks(&ids, Hold::States);
    let accuracy = |features: &GridTable| {
        let scores = held_out(&features.values, features.dims, &one_hot, count, &blocks, folds);
        let best = scores.chunks(count).map(|row| (0..count).max_by(|&a, &b| row[a].total_cmp(&row[b])).unwrap_or(0));
        best.zip(&labels).filter(|(found, label)| found == *label).count() as f64 / labels.len() as f64
    };
    let commonest = (0..count).map(|class| labels.iter().filter(|&&label| label == class).count()).max().unwrap_or(0);
    let chance = commonest as f64 / labels.len() as f64;
    Some(Probe {
        name: "video".to_owned(),
        kind: "distractor",
        latents: accuracy(latents),
        actions: accuracy(actions),
        chance,
    })
}
