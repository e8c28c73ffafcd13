//! All three axes step by step, for whoever cannot know in advance how long an episode is or wants one row at a time.
//!
//! In: [`DistractorSettings`], what the distractors start from, a seed an axis. Out: a [`View`] after every control step. Each axis draws from a
//! generator of its own, so that switching one off leaves the others as they are.

use rand_chacha::ChaCha8Rng;
use vibes_data::{BackgroundFrame, CameraPose};

use super::background::{BackgroundReset, BackgroundWalk};
use super::camera::{CameraBounds, CameraReset, CameraStart, CameraStep, CameraWalk};
use super::color::{self, ColorWalk};
use super::{AxisSeeds, CameraRanges, ColorRanges, DistractorSettings, Undistracted, View};

/// The distractors of an episode, at one control step.
#[derive(Clone, Debug)]
pub struct DistractorWalk {
    camera: Option<(CameraWalk, ChaCha8Rng)>,
    background: Option<BackgroundWalk>,
    color: Option<(ColorWalk, ChaCha8Rng)>,
    pose: CameraPose,
    /// RGB of every material, `[materials, 3]`.
    colors: Vec<f32>,
    /// Room for the draws of a step.
    normals: Vec<f64>,
}

impl DistractorWalk {
    /// Begins an episode: what its first row shows.
    pub fn reset(settings: &DistractorSettings, from: &Undistracted, seeds: AxisSeeds) -> Self {
        let [background, camera, color] = seeds.generators();
        let mut walk = Self {
            camera: settings.axes.camera.then(|| begin_camera(settings, from.camera, camera)),
            background: (settings.axes.background && !from.video_frames.is_empty())
                .then(|| begin_background(settings, &from.video_frames, background)),
            color: None,
            pose: from.camera.pose,
            colors: from.colors.clone(),
            normals: Vec::new(),
        };
        if settings.axes.color {
            walk.begin_colors(settings, &from.colors, color);
        }
        if let Some((camera, _)) = &walk.camera {
            walk.pose = camera.pose();
        }
        walk
    }

    fn begin_colors(&mut self, settings: &DistractorSettings, original: &[f32], mut rng: ChaCha8Rng) {
        let ranges = ColorRanges::new(settings.difficulty, settings.dynamic);
        self.normals = color::draw_reset(original.len(), &mut rng);
        let walk = ColorWalk::reset(original, &ranges, &self.normals);
        walk.rgb(&mut self.colors);
        self.color = Some((walk, rng));
    }

    /// One control step on every axis.
    pub fn advance(&mut self) {
        if let Some((walk, rng)) = &mut self.camera {
            walk.advance(&CameraStep::draw(rng));
            self.pose = walk.pose();
        }
        if let Some(walk) = &mut self.background {
            walk.advance();
        }
        if let Some((walk, rng)) = &mut self.color {
            color::draw_step(&mut self.normals, rng);
            walk.advance(&self.normals);
            walk.rgb(&mut self.colors);
        }
    }

    /// Where the camera is; the rest pose where its axis is off.
    pub fn camera(&self) -> CameraPose {
        self.pose
    }

    /// The video frame behind the task; none where the background axis is off.
    pub fn background(&self) -> Option<BackgroundFrame> {
        self.background.as_ref().map(BackgroundWalk::frame)
    }

    /// RGB of every material, `[materials, 3]`; the model's own where the colour axis is off.
    pub fn colors(&self) -> &[f32] {
        &self.colors
    }

    /// The present step as the renderer takes it.
    pub fn view(&self) -> View<'_> {
        View { camera: Some(self.pose), background: self.background(), colors: Some(&self.colors) }
    }
}

/// As in the suite, the camera moves once before the first picture.
fn begin_camera(settings: &DistractorSettings, start: CameraStart, mut rng: ChaCha8Rng) -> (CameraWalk, ChaCha8Rng) {
    let ranges = CameraRanges::new(settings.difficulty, settings.dynamic);
    let bounds = CameraBounds::new(&start, &ranges);
    let reset = CameraReset::draw(&bounds, &ranges, &mut rng);
    let mut walk = CameraWalk::reset(bounds, ranges, &reset);
    walk.advance(&CameraStep::draw(&mut rng));
    (walk, rng)
}

fn begin_background(settings: &DistractorSettings, video_frames: &[usize], mut rng: ChaCha8Rng) -> BackgroundWalk {
    let reset = BackgroundReset::draw(video_frames, &mut rng);
    BackgroundWalk::reset(&reset, video_frames[reset.video], settings.dynamic)
}
