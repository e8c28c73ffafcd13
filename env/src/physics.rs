//! A thin, safe wrapper over MuJoCo: one model with its state, stepped and reset in the order `dm_control` does it, so that numbers agree.
//!
//! In: a model's XML, states, controls and model overrides by object name. Out: positions, sensors, and snapshots that restore exactly.
//! Objects are looked up by name once ([`Physics::body`], [`Physics::geom`], …) and then read by index.

mod models;
mod overrides;
mod snapshot;
mod start;

use std::sync::Once;

use mujoco_rs::mujoco_c::{mjtDisableBit, mjtIntegrator, mjtWarning};
use mujoco_rs::prelude::{MjData, MjLogMessage, MjModel, MjtLogLevel, MjtObjBase, set_log_handler};

pub(crate) use models::suite_xml;
pub use overrides::ModelOverrides;
pub use snapshot::PhysicsSnapshot;
pub use start::Start;

use crate::{Error, Result};

/// A compiled model and its state.
#[derive(Debug)]
pub struct Physics {
    data: MjData<Box<MjModel>>,
    is_runge_kutta: bool,
    /// What the applied overrides replaced, to be put back before the next ones.
    originals: ModelOverrides,
}

impl Physics {
    /// Compiles a model from XML, which may include the suite's `./common/*.xml`; `name` is for messages.
    pub fn from_xml(name: &str, xml: &str) -> Result<Self> {
        quieten();
        let model = Box::new(models::compile(name, xml)?);
        let is_runge_kutta = model.opt().integrator == mjtIntegrator::mjINT_RK4 as i32;
        let data =
            MjData::try_new(model).map_err(|error| Error::Model { name: name.to_owned(), fact: error.to_string() })?;
        Ok(Self { data, is_runge_kutta, originals: ModelOverrides::default() })
    }

    /// The compiled model, with the overrides applied.
    pub fn model(&self) -> &MjModel {
        self.data.model()
    }

    /// MuJoCo's state and everything computed from it.
    pub fn data(&self) -> &MjData<Box<MjModel>> {
        &self.data
    }

    /// Seconds of one physics step.
    pub fn timestep(&self) -> f64 {
        self.model().opt().timestep
    }

    /// Simulated seconds.
    pub fn time(&self) -> f64 {
        self.data.time()
    }

    /// Generalised positions `[nq]`.
    pub fn qpos(&self) -> &[f64] {
        self.data.qpos()
    }

    /// Generalised velocities `[nv]`.
    pub fn qvel(&self) -> &[f64] {
        self.data.qvel()
    }

    /// The control that the last step used `[nu]`.
    pub fn control(&self) -> &[f64] {
        self.data.ctrl()
    }

    /// Number of contacts.
    pub fn contacts(&self) -> usize {
        usize::try_from(self.data.ncon()).unwrap_or(0)
    }

    /// Back to the model's default state, as `dm_control`'s `Physics.reset`: every derived quantity is computed, without actuation.
    pub fn reset(&mut self) {
        self.data.reset();
        self.forward_without_actuation();
    }

    /// Sets the state alone; [`Self::forward_without_actuation`] computes what follows from it.
    pub fn set_state(&mut self, qpos: &[f64], qvel: &[f64], act: &[f64], time: f64) {
        self.data.qpos_mut().copy_from_slice(qpos);
        self.data.qvel_mut().copy_from_slice(qvel);
        self.data.act_mut().copy_from_slice(act);
        self.data.set_time(time);
    }

    /// Generalised positions, to be changed before [`Self::forward_without_actuation`].
    pub fn qpos_mut(&mut self) -> &mut [f64] {
        self.data.qpos_mut()
    }

    /// Generalised velocities, to be changed before [`Self::forward_without_actuation`].
    pub fn qvel_mut(&mut self) -> &mut [f64] {
        self.data.qvel_mut()
    }

    /// Sets the clock alone.
    pub fn set_time(&mut self, seconds: f64) {
        self.data.set_time(seconds);
    }

    /// `mj_forward` with actuation disabled: what `dm_control` does after every reset, when no control has been chosen yet.
    pub fn forward_without_actuation(&mut self) {
        let actuation = mjtDisableBit::mjDSBL_ACTUATION as i32;
        let flags = self.data.model_opt().disableflags;
        self.data.model_opt_mut().disableflags = flags | actuation;
        self.data.forward();
        self.data.model_opt_mut().disableflags = flags;
    }

    /// One control step of `count` physics steps, in `dm_control`'s order: write the control, finish the step that the last `mj_step1` began,
    /// take the others, and begin the next one, so that everything that depends on position and velocity is up to date afterwards.
    ///
    /// Returns false when MuJoCo warned that the state left the finite numbers (see [`Self::warnings`]).
    pub fn step(&mut self, control: &[f64], count: usize) -> bool {
        self.data.ctrl_mut().copy_from_slice(control);
        // A state that is bad MuJoCo resets, its counters too, and then counts one warning: after a second time they stand as they did before it.
        self.data.warning_mut().iter_mut().for_each(|warning| warning.number = 0);
        if self.is_runge_kutta {
            self.data.step();
        } else {
            self.data.step2();
        }
        for _ in 1..count {
            self.data.step();
        }
        self.data.step1();
        self.data.warning().iter().all(|warning| warning.number == 0)
    }

    /// The names of the warnings MuJoCo has raised in the last control step.
    pub fn warnings(&self) -> String {
        let names = [
            (mjtWarning::mjWARN_INERTIA, "bad inertia"),
            (mjtWarning::mjWARN_CONTACTFULL, "too many contacts"),
            (mjtWarning::mjWARN_CNSTRFULL, "too many constraints"),
            (mjtWarning::mjWARN_BADQPOS, "bad qpos"),
            (mjtWarning::mjWARN_BADQVEL, "bad qvel"),
            (mjtWarning::mjWARN_BADQACC, "bad qacc"),
            (mjtWarning::mjWARN_BADCTRL, "bad ctrl"),
        ];
        let raised = names.iter().filter(|(warning, _)| self.data.warning()[*warning as usize].number > 0);
        raised.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
    }
}

/// Lookups by name: an index that stays valid for the model's life.
impl Physics {
    /// The body of that name.
    pub fn body(&self, name: &str) -> Result<usize> {
        self.find("body", MjtObjBase::mjOBJ_BODY, name)
    }

    /// The geom of that name.
    pub fn geom(&self, name: &str) -> Result<usize> {
        self.find("geom", MjtObjBase::mjOBJ_GEOM, name)
    }

    /// The site of that name.
    pub fn site(&self, name: &str) -> Result<usize> {
        self.find("site", MjtObjBase::mjOBJ_SITE, name)
    }

    /// The light of that name.
    pub fn light(&self, name: &str) -> Result<usize> {
        self.find("light", MjtObjBase::mjOBJ_LIGHT, name)
    }

    /// Where the one position of the slide or hinge joint of that name is in `qpos`.
    pub fn joint_qpos(&self, name: &str) -> Result<usize> {
        let joint = self.find("joint", MjtObjBase::mjOBJ_JOINT, name)?;
        Ok(usize::try_from(self.model().jnt_qposadr()[joint]).unwrap_or(0))
    }

    /// Where the numbers of the sensor of that name begin in `sensordata`.
    pub fn sensor(&self, name: &str) -> Result<usize> {
        let sensor = self.find("sensor", MjtObjBase::mjOBJ_SENSOR, name)?;
        Ok(usize::try_from(self.model().sensor_adr()[sensor]).unwrap_or(0))
    }

    /// The index of an object, or an error that lists the objects of its kind.
    pub(crate) fn find(&self, kind: &'static str, object: MjtObjBase, name: &str) -> Result<usize> {
        let found = if name.contains('\0') { None } else { self.model().name_to_id(object, name) };
        found.ok_or_else(|| {
            let names = (0..).map_while(|id| self.model().id_to_name(object, id));
            let known: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
            Error::UnknownObject {
                kind,
                name: name.to_owned(),
                known: if known.is_empty() { "none".to_owned() } else { known.join(", ") },
            }
        })
    }
}

/// Keeps MuJoCo from writing a log file into the working folder and notes to the terminal. What matters comes back as errors: compile errors
/// from [`models::compile`], instabilities from [`Physics::step`].
fn quieten() {
    static ONCE: Once = Once::new();
    // SAFETY: every use of MuJoCo begins with a compiled model, and no model is compiled before this, so no other thread is in MuJoCo yet.
    #[allow(
        unsafe_code,
        reason = "MuJoCo's log handler is a global; the Once holds all other threads back while it is set"
    )]
    ONCE.call_once(|| unsafe { set_log_handler(last_word) });
}

/// MuJoCo ends the process right after an error, so this is the only chance to say what it was.
#[allow(clippy::print_stderr, reason = "the process ends right after this call")]
fn last_word(message: &MjLogMessage) {
    if message.level() == MjtLogLevel::mjLOG_ERROR {
        eprintln!("MuJoCo cannot go on: {}", message.subject());
    }
}
