//! The renderer's own copy of the model and its state: where things are, what colour they have, where the camera looks.
//!
//! In: positions and a [`View`]. Out: MuJoCo data from which a scene can be made.
#![allow(unsafe_code, reason = "MuJoCo's model may be changed only through its C structure once it belongs to a state")]

use mujoco_rs::mujoco_c::mj_copyModel;
use mujoco_rs::prelude::{MjData, MjModel, MjtCamLight, MjtObjBase, MjtRndFlag};
use vibes_data::CameraPose;

use super::{Look, RenderSettings, anchor};
use crate::distractors::camera::{CameraStart, cartesian_to_spherical};
use crate::distractors::view::CameraFrame;
use crate::distractors::{Scenery, Undistracted, View};
use crate::error::{Error, Result};
use crate::videos::VideoLibrary;

/// The sky's texture in every model of the suite.
pub(super) const SKY: usize = 0;
/// The camera that pictures are taken with.
pub(super) const CAMERA: usize = 0;
/// The body whose subtree's centre of mass the camera follows: the first that is not the world.
const TRACKED: usize = 1;
/// Room for geoms; the largest model, the swimmer of 100 links, needs about 400.
pub(super) const MAX_GEOMS: usize = 2000;

/// What is drawn, before it is drawn.
#[derive(Debug)]
pub(super) struct Stage {
    pub(super) data: MjData<Box<MjModel>>,
    own_rgba: Vec<[f32; 4]>,
    ground: Option<usize>,
    ground_alpha: f32,
    is_tracking: bool,
    keep_upright: bool,
    /// Of a fixed camera, for the episode.
    look_at: [f64; 3],
}

impl Stage {
    pub(super) fn new(model: &MjModel, settings: &RenderSettings, scenery: Scenery) -> Result<Self> {
        let is_tracking = is_tracking(model)?;
        let mut stage = Self {
            data: MjData::try_new(prepared(model, settings)).map_err(refused)?,
            own_rgba: model.mat_rgba().to_vec(),
            ground: model.name_to_id(MjtObjBase::mjOBJ_MATERIAL, "grid"),
            ground_alpha: scenery.ground_alpha,
            is_tracking,
            keep_upright: scenery.upper_quadrant,
            look_at: [0.0; 3],
        };
        stage.place();
        stage.fix_look_at();
        Ok(stage)
    }

    pub(super) fn set_model(&mut self, model: &MjModel, settings: &RenderSettings) -> Result<()> {
        let sizes = |model: &MjModel| {
            let model = model.ffi();
            [model.nbuffer, model.nq, model.nbody, model.ngeom, model.nmat]
        };
        if sizes(self.data.model()) != sizes(model) {
            return Err(refused("another model"));
        }
        self.own_rgba = model.mat_rgba().to_vec();
        // A new copy for every episode would tear the heap to pieces: its textures take some 12 MB.
        // SAFETY: both are whole models, of the same sizes, so that the copy fits into the buffer that is there.
        let own = unsafe { self.data.model_mut() };
        unsafe { mj_copyModel(own.ffi_mut(), model.ffi()) };
        prepare(own, settings);
        Ok(())
    }

    /// Puts everything where `qpos` says.
    pub(super) fn pose(&mut self, qpos: &[f64]) -> Result<()> {
        let own = self.data.qpos_mut();
        if own.len() != qpos.len() {
            let expected = format!("the model has {}", own.len());
            return Err(Error::Render { fact: format!("{} positions", qpos.len()), expected });
        }
        own.copy_from_slice(qpos);
        self.place();
        Ok(())
    }

    /// The part of the forward dynamics that pictures need.
    fn place(&mut self) {
        self.data.kinematics();
        self.data.com_pos();
        self.data.camlight();
        self.data.tendon_comp();
    }

    /// The camera as MuJoCo placed it.
    fn own_camera(&self) -> CameraFrame {
        CameraFrame { position: self.data.cam_xpos()[CAMERA], orientation: self.data.cam_xmat()[CAMERA] }
    }

    pub(super) fn fix_look_at(&mut self) {
        self.look_at = self.own_camera().point_ahead(self.data.subtree_com()[TRACKED]);
    }

    /// Moves the camera to `pose`, or leaves it where the model has it, and says where it is.
    pub(super) fn aim(&mut self, pose: Option<&CameraPose>) -> CameraFrame {
        let own = self.own_camera();
        let Some(pose) = pose else { return own };
        let center = self.data.subtree_com()[TRACKED];
        let look_at = if self.is_tracking { own.point_ahead(center) } else { self.look_at };
        let camera = CameraFrame::compose(pose, &anchor(self.is_tracking, center, look_at), self.keep_upright);
        self.data.cam_xpos_mut()[CAMERA] = camera.position;
        self.data.cam_xmat_mut()[CAMERA] = camera.orientation;
        camera
    }

    /// Colours the materials.
    pub(super) fn paint(&mut self, view: &View<'_>) -> Result<()> {
        let mut rgba = self.own_rgba.clone();
        if let Some(colors) = view.colors {
            if colors.len() != 3 * rgba.len() {
                let expected = format!("the model has {}", 3 * rgba.len());
                return Err(Error::Render { fact: format!("{} colour channels", colors.len()), expected });
            }
            for (material, color) in rgba.iter_mut().zip(colors.chunks_exact(3)) {
                material[..3].copy_from_slice(color);
            }
        }
        if let (Some(ground), true) = (self.ground, view.background.is_some()) {
            rgba[ground][3] = self.ground_alpha;
        }
        // SAFETY: colours are read when a scene is made and by nothing else.
        unsafe { self.data.model_mut() }.mat_rgba_mut().copy_from_slice(&rgba);
        Ok(())
    }

    /// The tangent of half the camera's field of view.
    pub(super) fn tangent(&self) -> f64 {
        (self.data.model().cam_fovy()[CAMERA].to_radians() / 2.0).tan()
    }
}

fn refused(error: impl std::fmt::Display) -> Error {
    Error::Render { fact: error.to_string(), expected: "one renderer draws one model".to_owned() }
}

/// A copy of the model, prepared.
fn prepared(model: &MjModel, settings: &RenderSettings) -> Box<MjModel> {
    let mut model = Box::new(model.clone());
    prepare(&mut model, settings);
    model
}

/// Gives a model buffers of the picture's size, and the look's quality.
fn prepare(model: &mut MjModel, settings: &RenderSettings) {
    let size = settings.size as i32;
    let visual = model.vis_mut();
    (visual.global.offwidth, visual.global.offheight) = (size, size);
    match settings.look {
        // Of the suite's 2048, which no small picture shows: a shadow's edge moves by less than a pixel.
        Look::Suite if settings.size <= 128 => visual.quality.shadowsize = 1024,
        Look::Suite => {}
        Look::Fast => {
            visual.quality.shadowsize = 256;
            visual.quality.numslices = 12;
            visual.quality.numstacks = 6;
        }
    }
}

/// What is drawn at all.
pub(super) fn set_flags(flags: &mut [u8], look: Look) {
    if look == Look::Fast {
        flags[MjtRndFlag::mjRND_REFLECTION as usize] = 0;
    }
}

fn is_tracking(model: &MjModel) -> Result<bool> {
    match model.cam_mode().first() {
        Some(MjtCamLight::mjCAMLIGHT_FIXED) => Ok(false),
        Some(MjtCamLight::mjCAMLIGHT_TRACKCOM) => Ok(true),
        other => Err(Error::Render {
            fact: format!("the model's first camera is {other:?}"),
            expected: "the suite's distractors move a camera that is fixed or tracks a centre of mass".to_owned(),
        }),
    }
}

/// Where a pose puts the camera, without drawing anything.
#[derive(Debug)]
pub struct CameraProbe(Stage);

impl CameraProbe {
    /// For a model and its task's scenery.
    ///
    /// # Errors
    /// When the model has no camera of the kinds the suite can move.
    pub fn new(scenery: Scenery, model: &MjModel) -> Result<Self> {
        Stage::new(model, &RenderSettings::default(), scenery).map(Self)
    }

    /// Starts an episode at its first row's positions.
    ///
    /// # Errors
    /// When `qpos` has another length than the model's.
    pub fn begin_episode(&mut self, qpos: &[f64]) -> Result<()> {
        self.0.pose(qpos)?;
        self.0.fix_look_at();
        Ok(())
    }

    /// The camera in the world.
    ///
    /// # Errors
    /// When `qpos` has another length than the model's.
    pub fn frame(&mut self, qpos: &[f64], pose: &CameraPose) -> Result<CameraFrame> {
        self.0.pose(qpos)?;
        Ok(self.0.aim(Some(pose)))
    }
}

/// Where the model's own camera stands in the distractors' coordinates.
///
/// # Errors
/// When the model has no camera of the kinds the suite can move.
pub fn camera_start(scenery: Scenery, model: &MjModel) -> Result<CameraStart> {
    let is_tracking = is_tracking(model)?;
    let mut data = MjData::try_new(model).map_err(refused)?;
    data.kinematics();
    data.com_pos();
    data.camlight();
    let (position, center) = (data.cam_xpos()[CAMERA], data.subtree_com()[TRACKED]);
    let relative = if is_tracking { std::array::from_fn(|i| position[i] - center[i]) } else { position };
    let [r, h, v] = cartesian_to_spherical(relative);
    Ok(CameraStart { pose: CameraPose { r, h, v, roll: 0.0 }, upper_quadrant: scenery.upper_quadrant })
}

/// What the distractors of a task start from: its model's camera and colours, and the videos' lengths.
///
/// # Errors
/// When the model has no camera of the kinds the suite can move.
pub fn undistracted(scenery: Scenery, model: &MjModel, videos: &VideoLibrary) -> Result<Undistracted> {
    Ok(Undistracted {
        camera: camera_start(scenery, model)?,
        colors: material_colors(model),
        video_frames: videos.frame_counts(),
    })
}

/// The model's own material colours, `[materials, 3]`.
pub fn material_colors(model: &MjModel) -> Vec<f32> {
    model.mat_rgba().iter().flat_map(|rgba| rgba[..3].to_vec()).collect()
}

/// The names of the materials, in the order of their colours.
pub fn material_names(model: &MjModel) -> Vec<String> {
    let name = |id| model.id_to_name(MjtObjBase::mjOBJ_MATERIAL, id).unwrap_or_default().to_owned();
    (0..model.mat_rgba().len()).map(name).collect()
}
