//! Our distractors and pictures beside the suite's.

use mujoco_rs::prelude::MjModel;
use vibes_data::BackgroundFrame;

use super::{DistractorTrace, TraceStep};
use crate::error::{Error, Result};
use crate::largest::{largest, largest_difference};
use vibes_env::Environment;
use vibes_env::distractors::background::{BackgroundReset, BackgroundWalk};
use vibes_env::distractors::camera::{CameraBounds, CameraWalk};
use vibes_env::distractors::color::ColorWalk;
use vibes_env::distractors::{CameraRanges, ColorRanges, Scenery, View};
use vibes_env::render::{
    CameraProbe, RenderSettings, Renderer, camera_start, material_colors, material_names, picture_difference,
};
use vibes_env::videos::{VideoLibrary, VideoSet, VideoSource};

/// The largest difference from the suite in each quantity, over all steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TraceComparison {
    /// Of the box of the camera's walk.
    pub bounds: f64,
    /// Of r, h, v and roll.
    pub pose: f64,
    /// Of the velocities.
    pub velocity: f64,
    /// Of the camera's position in the world, metres.
    pub position: f64,
    /// Of its rotation matrix.
    pub orientation: f64,
    /// Of the material colours.
    pub color: f64,
    /// Of the opacity of the ground.
    pub ground_alpha: f64,
    /// Steps whose video frame or direction is another.
    pub wrong_frames: usize,
    /// Steps compared.
    pub steps: usize,
}

impl TraceComparison {
    /// Each quantity with its largest error.
    pub fn errors(&self) -> [(&'static str, f64); 8] {
        [
            ("bounds", self.bounds),
            ("pose", self.pose),
            ("velocity", self.velocity),
            ("position", self.position),
            ("orientation", self.orientation),
            ("color", self.color),
            ("ground_alpha", self.ground_alpha),
            ("background", self.wrong_frames as f64),
        ]
    }

    /// Whether everything agrees.
    pub fn is_within(&self, tolerance: f64) -> bool {
        self.errors().iter().all(|(_, error)| *error <= tolerance)
    }
}

/// One picture beside the suite's.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureComparison {
    /// Control step.
    pub step: usize,
    /// Pixels each way.
    pub size: usize,
    /// Mean absolute error, in levels of 255.
    pub mean_absolute_error: f64,
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
    /// The drawn picture, `[size, size, 3]`.
    pub picture: Vec<u8>,
}

impl DistractorTrace {
    /// Feeds the recorded positions and draws through our distractors. `environment` is the task's, with the trace's overrides applied.
    ///
    /// # Errors
    /// When the model is not the trace's.
    pub fn compare(&self, environment: &Environment) -> Result<TraceComparison> {
        let (scenery, model) = (environment.scenery(), environment.physics().model());
        self.check_materials(model)?;
        let start = camera_start(scenery, model)?;
        let ranges = CameraRanges::new(self.difficulty, self.dynamic);
        let bounds = CameraBounds::new(&start, &ranges);
        let mut camera = CameraWalk::reset(bounds, ranges, &self.camera_reset);
        let color_ranges = ColorRanges::new(self.difficulty, self.dynamic);
        let mut color = ColorWalk::reset(&material_colors(model), &color_ranges, &self.color_reset);
        let mut background = self.background();
        let mut probe = CameraProbe::new(scenery, model)?;
        let mut colors = Vec::new();
        let mut worst = self.beginning(&bounds, scenery);
        for (index, step) in self.steps.iter().enumerate() {
            camera.advance(&step.camera_draws);
            if index > 0 {
                color.advance(&step.color_draws);
                background.advance();
            } else {
                probe.begin_episode(&step.qpos).map_err(|error| Error::from(error).at_step(index))?;
            }
            worst.add_camera(&camera, &mut probe, step).map_err(|error| error.at_step(index))?;
            color.rgb(&mut colors);
            raise(&mut worst.color, colors.iter().copied().map(f64::from).zip(step.rgb.iter().copied()));
            let shown = (background.frame().frame as usize, background.forwards());
            worst.wrong_frames += usize::from(shown != step.background);
            worst.steps += 1;
        }
        Ok(worst)
    }

    fn check_materials(&self, model: &MjModel) -> Result<()> {
        let names = material_names(model);
        if names == self.materials {
            return Ok(());
        }
        let fact = format!("materials {}", self.materials.join(", "));
        Err(Error::malformed(&self.path, fact, format!("{} has {}", self.task, names.join(", "))))
    }

    /// The trace holds no draws of the background: its walk starts at the first step's frame.
    fn background(&self) -> BackgroundWalk {
        let (start, forwards) = self.steps.first().map_or((0, true), |step| step.background);
        BackgroundWalk::reset(&BackgroundReset { video: 0, start, forwards }, self.frame_count, self.dynamic)
    }

    /// What can be compared before the first step.
    fn beginning(&self, bounds: &CameraBounds, scenery: Scenery) -> TraceComparison {
        let ground_alpha = largest([f64::from(scenery.ground_alpha) - f64::from(self.ground_alpha)]);
        TraceComparison { bounds: self.bounds_error(bounds), ground_alpha, ..TraceComparison::default() }
    }

    fn bounds_error(&self, bounds: &CameraBounds) -> f64 {
        let mut error = largest([bounds.velocity_scaling - self.velocity_scaling]);
        for (ours, theirs) in [bounds.r, bounds.h, bounds.v, bounds.roll].iter().zip(&self.camera_bounds) {
            raise(&mut error, [(ours.0, theirs.0), (ours.1, theirs.1)].into_iter());
        }
        error
    }

    /// Draws every recorded picture, from the recorded positions, cameras, colours and video frames, with videos from the folder `videos`.
    ///
    /// # Errors
    /// When there is no EGL, or a video or picture is missing or of another size.
    pub fn compare_pictures(
        &self,
        environment: &Environment,
        videos: &std::path::Path,
        look: vibes_env::render::Look,
    ) -> Result<Vec<PictureComparison>> {
        let sizes: std::collections::BTreeSet<usize> =
            self.steps.iter().flat_map(|step| step.pictures.keys().copied()).collect();
        let source = VideoSource::Folder(videos.to_owned());
        let mut comparisons = Vec::new();
        for size in sizes {
            let names = [self.video.clone()];
            let library = VideoLibrary::open(&source, VideoSet::Train, &names, look.sky_side(size))?;
            let mut renderer =
                Renderer::new(RenderSettings { size, look }, environment.scenery(), environment.physics().model())?;
            for (index, step) in self.steps.iter().enumerate() {
                if index == 0 {
                    renderer.begin_episode(&step.qpos).map_err(|error| Error::from(error).at_step(index))?;
                }
                if let Some(name) = step.pictures.get(&size) {
                    let theirs = self.read_picture(name, size)?;
                    comparisons.push(draw_beside(&mut renderer, index, step, &library, &theirs)?);
                }
            }
        }
        Ok(comparisons)
    }

    fn read_picture(&self, name: &str, size: usize) -> Result<Vec<u8>> {
        let path = self.picture_path(name);
        let bytes = std::fs::read(&path).map_err(Error::io("read the picture", &path))?;
        let picture = image::load_from_memory(&bytes)
            .map_err(|error| Error::malformed(&path, error.to_string(), "pictures are PNG"))?;
        let picture = picture.into_rgb8();
        if (picture.width() as usize, picture.height() as usize) != (size, size) {
            let fact = format!("a picture of {}×{}", picture.width(), picture.height());
            return Err(Error::malformed(&path, fact, format!("the trace calls it {size}×{size}")));
        }
        Ok(picture.into_raw())
    }
}

fn draw_beside(
    renderer: &mut Renderer,
    index: usize,
    step: &TraceStep,
    library: &VideoLibrary,
    theirs: &[u8],
) -> Result<PictureComparison> {
    let colors: Vec<f32> = step.rgb.iter().map(|&channel| channel as f32).collect();
    let background = BackgroundFrame { video: 0, frame: step.background.0 as u32 };
    let view = View { camera: Some(step.camera.pose), background: Some(background), colors: Some(&colors) };
    let mut picture = vec![0; renderer.picture_bytes()];
    renderer.draw(&step.qpos, &view, library, &mut picture)?;
    let (mean_absolute_error, psnr) = picture_difference(&picture, theirs);
    Ok(PictureComparison { step: index, size: renderer.settings().size, mean_absolute_error, psnr, picture })
}

impl TraceComparison {
    fn add_camera(&mut self, camera: &CameraWalk, probe: &mut CameraProbe, step: &TraceStep) -> Result<()> {
        let (ours, theirs) = (camera.pose(), step.camera.pose);
        let poses = [(ours.r, theirs.r), (ours.h, theirs.h), (ours.v, theirs.v), (ours.roll, theirs.roll)];
        raise(&mut self.pose, poses.into_iter());
        let ((velocity, roll), (their_velocity, their_roll)) = (camera.velocity(), step.camera.velocity);
        raise(&mut self.velocity, velocity.into_iter().zip(their_velocity).chain([(roll, their_roll)]));
        let frame = probe.frame(&step.qpos, &ours)?;
        raise(&mut self.position, frame.position.into_iter().zip(step.camera.position));
        raise(&mut self.orientation, frame.orientation.into_iter().zip(step.camera.orientation));
        Ok(())
    }
}

/// Raises `worst` to the largest difference; not a number counts as infinite.
fn raise(worst: &mut f64, pairs: impl Iterator<Item = (f64, f64)>) {
    *worst = largest([*worst, largest_difference(pairs)]);
}
