//! Drawing: from a state of the physics and the distractors' parameters to a picture.
//!
//! In: a model, positions, a [`View`] and the videos. Out: RGB, `[size, size, 3]`, row major from the top. Each [`Renderer`] has its own OpenGL
//! context and its own copy of the model, so that what it changes there (materials, cameras) is seen by nobody else. It stays on its thread unless it is
//! used inside [`visiting`].
//!
//! Two looks: [`Look::Suite`] draws what the Distracting Control Suite draws; [`Look::Fast`] leaves out what costs most and shows least.

mod difference;
mod egl;
mod scene;
mod sky;
mod speed;

use std::fmt;
use std::mem::ManuallyDrop;
use std::str::FromStr;
use std::time::{Duration, Instant};

use mujoco_rs::mujoco_c::mjr_finish;
use mujoco_rs::prelude::{MjModel, MjrContext, MjrRectangle, MjvCamera, MjvOption, MjvPerturb, MjvScene};
use serde::{Deserialize, Serialize};
use vibes_data::BackgroundFrame;

pub use difference::picture_difference;
pub use egl::{on_one_display, visiting, without_rasteriser_threads};
pub use scene::{CameraProbe, camera_start, material_colors, material_names, undistracted};
pub use speed::{Speed, SpeedTrial, StageTimes};

use crate::distractors::view::{Anchor, CameraFrame};
use crate::distractors::{Scenery, View};
use crate::error::{Error, Result};
use crate::videos::{LEVELS, SUITE_SIDE, VideoLibrary};
use egl::EglContext;
use scene::Stage;
use sky::Sky;

/// How pictures are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// As the suite draws: fine shadows, the floor's mirror image, a fine sky. Multisampling is the model's own in both looks: 4 samples, MuJoCo's default.
    Suite,
    /// Cheap and close.
    #[default]
    Fast,
}

impl Look {
    /// The look's name as typed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Suite => "suite",
            Self::Fast => "fast",
        }
    }

    /// Side of the video frames a picture of `size` pixels needs, of the suite's 800: where the sky is finer than the picture, its finest
    /// mipmap levels are never looked at.
    pub fn sky_side(self, size: usize) -> usize {
        // Sky pixels per picture pixel in the middle of a picture of 45°. A camera that looks at a face's edge needs up to a third less.
        let density = SUITE_SIDE as f64 / 2.0 * (2.0 * 22.5_f64.to_radians().tan()) / size as f64;
        let spare = match self {
            Self::Suite => density * 0.65,
            Self::Fast => density * 1.1,
        };
        let halvings = spare.max(1.0).log2().floor() as usize;
        SUITE_SIDE >> halvings.min(LEVELS)
    }
}

impl fmt::Display for Look {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Look {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "suite" => Ok(Self::Suite),
            "fast" => Ok(Self::Fast),
            _ => Err(Error::UnknownName { what: "look", name: text.to_owned(), known: "suite, fast".to_owned() }),
        }
    }
}

/// What pictures look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RenderSettings {
    /// Height and width, pixels.
    pub size: usize,
    /// How they are drawn.
    pub look: Look,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self { size: 64, look: Look::default() }
    }
}

/// Largest picture drawn.
pub const MAX_SIZE: usize = 2048;

/// Draws pictures of one model.
#[derive(Debug)]
pub struct Renderer {
    settings: RenderSettings,
    stage: Stage,
    scene: MjvScene,
    option: MjvOption,
    perturbation: MjvPerturb,
    own_sky: u32,
    /// Made when the first video is shown, of the side of its library.
    sky: Option<Sky>,
    stages: StageTimes,
    separate_stages: bool,
    // Dropped in this order, what lies in the context first, and only while it is current.
    context: ManuallyDrop<MjrContext>,
    gl: EglContext,
}

// SAFETY: what lies in the OpenGL context is reached only by `new`, `draw` and `drop`, which make it current on their thread first. EGL refuses a context
// that is current on another thread, and then nothing of it is touched.
#[allow(unsafe_code, reason = "MuJoCo's context holds pointers")]
unsafe impl Send for Renderer {}

/// Whether this machine can draw at all: to be asked before anything is made for pictures.
///
/// # Errors
/// [`Error::NoEgl`].
pub fn check_drawing() -> Result<()> {
    EglContext::new().map(drop)
}

impl Renderer {
    /// Opens a context on this thread, for a task's scenery; `model` is copied, with its overrides.
    ///
    /// # Errors
    /// [`Error::NoEgl`] on a machine that cannot draw; [`Error::Render`] for an impossible size or a model the suite has no camera for.
    #[allow(unsafe_code, reason = "MuJoCo's context has to be made and dropped while an OpenGL context is current")]
    pub fn new(settings: RenderSettings, scenery: Scenery, model: &MjModel) -> Result<Self> {
        if !(1..=MAX_SIZE).contains(&settings.size) {
            let expected = format!("a size is 1 to {MAX_SIZE}");
            return Err(Error::Render { fact: format!("pictures of {} pixels", settings.size), expected });
        }
        let stage = Stage::new(model, &settings, scenery)?;
        let gl = EglContext::new()?;
        // SAFETY: the context made above is current; `Drop` makes it so again before this is dropped.
        let mut context = unsafe { MjrContext::new(stage.data.model()) };
        context.offscreen();
        let mut scene = MjvScene::new(stage.data.model(), scene::MAX_GEOMS);
        scene::set_flags(scene.flags_mut(), settings.look);
        let own_sky = context.texture()[scene::SKY];
        Ok(Self {
            settings,
            stage,
            scene,
            option: MjvOption::default(),
            perturbation: MjvPerturb::default(),
            own_sky,
            sky: None,
            stages: StageTimes::default(),
            separate_stages: false,
            context: ManuallyDrop::new(context),
            gl,
        })
    }

    /// The size and look of the pictures.
    pub fn settings(&self) -> RenderSettings {
        self.settings
    }

    /// Bytes of a picture.
    pub fn picture_bytes(&self) -> usize {
        3 * self.settings.size * self.settings.size
    }

    /// Takes over an episode's model overrides; `model` is the same model otherwise.
    ///
    /// # Errors
    /// When it is another model.
    pub fn set_model(&mut self, model: &MjModel) -> Result<()> {
        self.stage.set_model(model, &self.settings)
    }

    /// Starts an episode at its first row's positions: a fixed camera looks for the whole episode at the point it looked at then.
    ///
    /// # Errors
    /// When `qpos` has another length than the model's.
    pub fn begin_episode(&mut self, qpos: &[f64]) -> Result<()> {
        self.stage.pose(qpos)?;
        self.stage.fix_look_at();
        Ok(())
    }

    /// Draws one row into `picture`, `[size, size, 3]`.
    ///
    /// # Errors
    /// When a length does not fit, a video frame does not exist, or the context is lost.
    pub fn draw(&mut self, qpos: &[f64], view: &View<'_>, videos: &VideoLibrary, picture: &mut [u8]) -> Result<()> {
        let mut clock = Instant::now();
        self.gl.make_current()?;
        self.stage.pose(qpos)?;
        self.stage.paint(view)?;
        let camera = self.stage.aim(view.camera.as_ref());
        let mut eye = MjvCamera::new_fixed(scene::CAMERA);
        self.scene.update(&mut self.stage.data, &self.option, &self.perturbation, &mut eye);
        self.stages.scene += self.lap(&mut clock);
        self.hang_sky(view.background, videos, &camera)?;
        self.stages.upload += self.lap(&mut clock);
        let size = self.settings.size as i32;
        let rectangle = MjrRectangle::new(0, 0, size, size);
        self.scene.render(&rectangle, &self.context);
        self.stages.render += self.lap(&mut clock);
        self.read(&rectangle, picture)?;
        self.stages.read_back += self.lap(&mut clock);
        Ok(())
    }

    /// Whether to wait for every stage to end before the next begins, to time them; slower.
    pub(crate) fn separate_stages(&mut self, on: bool) {
        self.separate_stages = on;
    }

    /// Time spent drawing since the last call.
    pub(crate) fn take_stages(&mut self) -> StageTimes {
        std::mem::take(&mut self.stages)
    }

    #[allow(unsafe_code, reason = "glFinish")]
    fn lap(&self, clock: &mut Instant) -> Duration {
        if self.separate_stages {
            // SAFETY: the context is current.
            unsafe { mjr_finish() };
        }
        let begin = std::mem::replace(clock, Instant::now());
        *clock - begin
    }

    #[allow(unsafe_code, reason = "the texture's name in MuJoCo's context is exchanged")]
    fn hang_sky(
        &mut self,
        background: Option<BackgroundFrame>,
        videos: &VideoLibrary,
        camera: &CameraFrame,
    ) -> Result<()> {
        let texture = match background {
            None => self.own_sky,
            Some(frame) => {
                if self.sky.is_none() {
                    self.sky = Some(Sky::new(&self.gl, videos.side())?);
                }
                let Some(sky) = &mut self.sky else { return Ok(()) };
                sky.show(frame, videos, camera, self.stage.tangent())?;
                sky.texture()
            }
        };
        // SAFETY: both are cube textures of this context; the model's own is put back before MuJoCo frees it.
        unsafe { self.context.ffi_mut().texture[scene::SKY] = texture };
        Ok(())
    }

    /// Reads the picture, which OpenGL keeps from the bottom, into rows from the top.
    fn read(&self, rectangle: &MjrRectangle, picture: &mut [u8]) -> Result<()> {
        let wrong =
            |fact: String| Error::Render { fact, expected: format!("a picture has {} bytes", self.picture_bytes()) };
        if picture.len() != self.picture_bytes() {
            return Err(wrong(format!("{} bytes for a picture", picture.len())));
        }
        self.context.read_pixels(Some(picture), None, rectangle).map_err(|error| wrong(error.to_string()))?;
        let row = 3 * self.settings.size;
        let mut rows = picture.chunks_exact_mut(row);
        while let (Some(upper), Some(lower)) = (rows.next(), rows.next_back()) {
            upper.swap_with_slice(lower);
        }
        Ok(())
    }
}

impl Drop for Renderer {
    #[allow(
        unsafe_code,
        reason = "the texture's name in MuJoCo's context is put back, and the context is freed while it is current"
    )]
    fn drop(&mut self) {
        if self.gl.make_current().is_err() {
            // It is current elsewhere, and what lies in it stays until the process ends.
            return;
        }
        // SAFETY: the name is the one MuJoCo made and will free.
        unsafe { self.context.ffi_mut().texture[scene::SKY] = self.own_sky };
        if let Some(sky) = &mut self.sky {
            sky.delete();
        }
        // SAFETY: its OpenGL context is current, and nothing looks at it afterwards.
        unsafe { ManuallyDrop::drop(&mut self.context) };
    }
}

/// The anchor of a camera: see [`Anchor`].
fn anchor(is_tracking: bool, center: [f64; 3], look_at: [f64; 3]) -> Anchor {
    Anchor { origin: if is_tracking { center } else { [0.0; 3] }, look_at }
}

#[cfg(test)]
mod tests;
