//! Laws over every task.

use super::*;
use crate::distractors::{Axes, AxisSeeds, Difficulty, DistractorSettings, DistractorTrajectory};
use crate::videos::{VideoSet, VideoSource};
use crate::{Environment, EnvironmentOptions};

const SIZE: usize = 48;

fn tasks() -> Vec<String> {
    crate::example_tasks().into_iter().map(str::to_owned).collect()
}

fn videos(look: Look) -> VideoLibrary {
    let source = VideoSource::Procedural;
    VideoLibrary::open(&source, VideoSet::Train, &source.list(VideoSet::Train, Some(2)).unwrap(), look.sky_side(SIZE))
        .unwrap()
}

fn environment(task: &str) -> Environment {
    Environment::new(task, EnvironmentOptions::default()).unwrap()
}

fn trajectory(task: &str, axes: Axes, videos: &VideoLibrary) -> DistractorTrajectory {
    let environment = environment(task);
    let model = environment.physics().model();
    let settings = DistractorSettings { axes, difficulty: Difficulty::Hard, dynamic: true };
    let undistracted = undistracted(environment.scenery(), model, videos).unwrap();
    DistractorTrajectory::generate(&settings, &undistracted, 3, 5, AxisSeeds::from(2))
}

fn draw(task: &str, look: Look, view: &View<'_>, videos: &VideoLibrary) -> Vec<u8> {
    let environment = environment(task);
    let mut renderer =
        Renderer::new(RenderSettings { size: SIZE, look }, environment.scenery(), environment.physics().model())
            .unwrap();
    let mut picture = vec![0; renderer.picture_bytes()];
    renderer.begin_episode(environment.physics().qpos()).unwrap();
    renderer.draw(environment.physics().qpos(), view, videos, &mut picture).unwrap();
    picture
}

fn difference(a: &[u8], b: &[u8]) -> f64 {
    picture_difference(a, b).0
}

#[test]
fn every_axis_changes_every_tasks_picture() {
    for (look, tasks) in [(Look::Fast, tasks()), (Look::Suite, vec!["reacher-easy".to_owned()])] {
        let videos = videos(look);
        for task in tasks {
            let plain = draw(&task, look, &View::default(), &videos);
            for name in ["background", "camera", "color"] {
                let trajectory = trajectory(&task, name.parse().unwrap(), &videos);
                let picture = draw(&task, look, &trajectory.view(2), &videos);
                assert!(difference(&plain, &picture) > 0.5, "{task} {look}: {name} is not seen");
            }
        }
    }
}

/// The rest pose and the model's own colours, as recorded without distractors, draw what the model draws.
#[test]
fn without_distractors_the_picture_is_the_models_own() {
    let videos = VideoLibrary::none();
    for task in tasks() {
        let trajectory = trajectory(&task, Axes::NONE, &videos);
        let (own, rest) = (
            draw(&task, Look::Suite, &View::default(), &videos),
            draw(&task, Look::Suite, &trajectory.view(1), &videos),
        );
        assert!(difference(&own, &rest) < 1.0, "{task}: {}", difference(&own, &rest));
    }
}

#[test]
fn the_same_parameters_draw_the_same_picture_on_any_thread() {
    let videos = videos(Look::Fast);
    let trajectory = trajectory("walker-walk", Axes::ALL, &videos);
    let draw = || draw("walker-walk", Look::Fast, &trajectory.view(1), &videos);
    let here = draw();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(draw)).collect();
        assert!(threads.into_iter().all(|thread| thread.join().unwrap() == here));
    });
}

/// Frames, cameras and faces come in any order; what was drawn before leaves no trace.
#[test]
fn a_picture_does_not_depend_on_those_before() {
    let videos = videos(Look::Fast);
    let trajectory = trajectory("cheetah-run", Axes::ALL, &videos);
    let environment = environment("cheetah-run");
    let qpos = environment.physics().qpos();
    let mut renderer = Renderer::new(
        RenderSettings { size: SIZE, look: Look::Fast },
        environment.scenery(),
        environment.physics().model(),
    )
    .unwrap();
    let mut picture = vec![0; renderer.picture_bytes()];
    for row in [3, 0, 2, 2, 1, 0] {
        renderer.draw(qpos, &View::default(), &videos, &mut picture).unwrap();
        renderer.draw(qpos, &trajectory.view(row), &videos, &mut picture).unwrap();
        assert_eq!(picture, draw("cheetah-run", Look::Fast, &trajectory.view(row), &videos));
    }
}

#[test]
fn two_renderers_share_a_thread() {
    let videos = videos(Look::Fast);
    let environments = [environment("reacher-easy"), environment("walker-walk")];
    let mut renderers = environments.each_ref().map(|environment| {
        Renderer::new(
            RenderSettings { size: SIZE, look: Look::Fast },
            environment.scenery(),
            environment.physics().model(),
        )
        .unwrap()
    });
    let mut picture = vec![0; 3 * SIZE * SIZE];
    for _ in 0..2 {
        for (environment, renderer) in environments.iter().zip(&mut renderers) {
            renderer.draw(environment.physics().qpos(), &View::default(), &videos, &mut picture).unwrap();
            assert_eq!(picture, draw(environment.name(), Look::Fast, &View::default(), &videos));
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let environment = environment("reacher-easy");
    let model = environment.physics().model();
    for size in [0, MAX_SIZE + 1] {
        assert!(Renderer::new(RenderSettings { size, look: Look::Fast }, environment.scenery(), model).is_err());
    }
    let mut renderer = Renderer::new(RenderSettings::default(), environment.scenery(), model).unwrap();
    let (videos, mut picture) = (VideoLibrary::none(), vec![0; renderer.picture_bytes()]);
    let qpos = environment.physics().qpos();
    assert!(renderer.draw(&qpos[1..], &View::default(), &videos, &mut picture).is_err());
    assert!(renderer.draw(qpos, &View::default(), &videos, &mut picture[1..]).is_err());
    assert!(renderer.draw(qpos, &View { colors: Some(&[0.5; 4]), ..View::default() }, &videos, &mut picture).is_err());
    let missing = Some(BackgroundFrame { video: 0, frame: 0 });
    assert!(renderer.draw(qpos, &View { background: missing, ..View::default() }, &videos, &mut picture).is_err());
    assert!(renderer.set_model(self::environment("walker-walk").physics().model()).is_err());
    assert!(renderer.draw(qpos, &View::default(), &videos, &mut picture).is_ok());
}

#[test]
fn the_sky_is_as_fine_as_the_picture_needs() {
    assert_eq!([32, 64, 84, 128, 256, 512].map(|size| Look::Suite.sky_side(size)), [200, 400, 400, 800, 800, 800]);
    assert_eq!([32, 64, 84, 128, 256, 512].map(|size| Look::Fast.sky_side(size)), [100, 200, 200, 400, 800, 800]);
}
