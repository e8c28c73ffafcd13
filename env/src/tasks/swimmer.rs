//! `swimmer-N`: a snake of N links in a viscous fluid brings its nose to a target (`dm_control/suite/swimmer.py`; N = 100 in the VIBES paper).
//!
//! The model is the suite's `swimmer.xml`, which has the head, with N − 1 more links, joints, motors and sensors. An action is the four
//! parameters of a travelling wave of torques ([`Sinusoid`]), or with raw torques one number per joint.

use std::fmt::Write;
use std::ops::RangeInclusive;

use rand::{Rng, RngCore};
use vibes_data::{Formula, ObservationPart, Quantity};

use super::random_joints::randomize_joints;
use super::{Actuation, Loaded, PlannerSettings, Registered, Sigmoid, Sinusoid, Task, Tolerance, part, quantity};
use crate::Result;
use crate::distractors::Scenery;
use crate::physics::{ModelOverrides, Physics, suite_xml};

/// Links a swimmer can have. Every link lies within the one before it, and the reader of XML that MuJoCo is built with takes fewer than 500 elements within each other:
/// at 497 links it says `XML_ELEMENT_DEPTH_EXCEEDED`.
const LINKS: RangeInclusive<usize> = 3..=496;

/// Physics steps of 2 ms in a control step of 30 ms.
const PHYSICS_STEPS: usize = 15;
/// Control steps an action is held, as in the paper.
const ACTION_REPEAT: u32 = 10;
/// Numbers of the four sensors of places and axes that come before the two of every link, three numbers each.
const FRAME_SENSORS: usize = 12;

/// The registry's entry.
pub(super) const TASK: Registered = Registered {
    name: "swimmer-N",
    note: "N is the number of links, 3 to 496",
    examples: &["swimmer-5", "swimmer-6", "swimmer-15", "swimmer-100"],
    action_repeat: ACTION_REPEAT,
    is_of_the_suite: false,
    is_symmetric: false,
    load: |name| links_of(name).map(load),
};

/// The number of links in a name: `swimmer-6`, or the suite's own `swimmer-swimmer6`.
fn links_of(name: &str) -> Option<usize> {
    let rest = name.strip_prefix("swimmer-")?;
    let links = rest.strip_prefix("swimmer").unwrap_or(rest).parse().ok()?;
    LINKS.contains(&links).then_some(links)
}

/// Loads the model and the task.
fn load(links: usize) -> Result<Loaded> {
    let name = format!("swimmer-{links}");
    let physics = Physics::from_xml(&name, &xml(links)?)?;
    let task = Swimmer {
        head: physics.body("head")?,
        nose: physics.geom("nose")?,
        target: physics.geom("target")?,
        target_light: physics.light("target_light")?,
    };
    Ok(Loaded {
        name,
        physics,
        task: Box::new(task),
        actuation: Actuation::Sinusoid(Sinusoid::of_swimmers()),
        physics_steps: PHYSICS_STEPS,
        planner: PlannerSettings::DEFAULT,
        scenery: Scenery::DEFAULT,
    })
}

/// The model of that many links.
fn xml(links: usize) -> Result<String> {
    let suite = suite_xml("swimmer.xml")?;
    let limit = 360.0 / links as f64;
    let (mut bodies, mut motors, mut sensors) = (String::new(), String::new(), String::new());
    for link in 0..links - 1 {
        // Writing to a string cannot fail.
        let _ = write!(
            bodies,
            r#"<body name="segment_{link}" pos="0 .1 0"><geom class="visual" name="visual_{link}"/><geom class="inertial" name="inertial_{link}"/><site name="site_{link}"/><joint name="joint_{link}" range="{} {limit}"/>"#,
            -limit
        );
        let _ = write!(motors, r#"<motor name="motor_{link}" joint="joint_{link}"/>"#);
        let _ = write!(
            sensors,
            r#"<velocimeter name="velocimeter_{link}" site="site_{link}"/><gyro name="gyro_{link}" site="site_{link}"/>"#
        );
    }
    bodies.push_str(&"</body>".repeat(links - 1));
    // The head is the only body of the suite's XML, so the first closing tag is its own.
    let with_links = suite.replacen("</body>", &format!("{bodies}</body>"), 1);
    let ending = format!("<actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>");
    Ok(move_cameras_back(&with_links.replacen("</mujoco>", &ending, 1), links as f64 / 6.0))
}

/// Multiplies the position of every tracking camera, so that a longer swimmer stays in the picture.
fn move_cameras_back(xml: &str, factor: f64) -> String {
    let tags = xml.split_inclusive('>').map(|tag| {
        let is_tracking = tag.contains("<camera") && tag.contains(r#"mode="trackcom""#);
        let position =
            tag.split_once("pos=\"").and_then(|(_, rest)| rest.split_once('"')).map(|(position, _)| position);
        match position {
            Some(old) if is_tracking => {
                let moved = old.split_whitespace().filter_map(|number| number.parse::<f64>().ok());
                let new: Vec<String> = moved.map(|number| (number * factor).to_string()).collect();
                tag.replace(&format!("pos=\"{old}\""), &format!("pos=\"{}\"", new.join(" ")))
            }
            _ => tag.to_owned(),
        }
    });
    tags.collect()
}

#[derive(Debug)]
struct Swimmer {
    head: usize,
    nose: usize,
    target: usize,
    target_light: usize,
}

impl Swimmer {
    /// The vector from the nose to the target in the head's frame, the plane alone.
    fn to_target(&self, physics: &Physics) -> [f64; 2] {
        let places = physics.data().geom_xpos();
        let world = [0, 1, 2].map(|axis| places[self.target][axis] - places[self.nose][axis]);
        let head = physics.data().xmat()[self.head];
        [0, 1].map(|axis| (0..3).map(|row| world[row] * head[3 * row + axis]).sum())
    }
}

impl Task for Swimmer {
    fn observation(&self, physics: &Physics) -> Vec<ObservationPart> {
        let links = (physics.data().sensordata().len() - FRAME_SENSORS) / 6;
        vec![part("joints", links - 1), part("to_target", 2), part("body_velocities", 3 * links)]
    }

    /// The target as the head sees it, the head's velocity, and the bends of the first, the middle and the last joint: a long body has too many to list.
    fn quantities(&self, physics: &Physics) -> Vec<Quantity> {
        let joints = physics.qpos().len() - 3;
        let (to_target, head) = ([joints, joints + 1], joints + 2);
        let seen = |name: &str, at: usize| quantity(name, Formula::Observation(at));
        vec![
            quantity("distance to the target", Formula::Length(to_target.to_vec())),
            seen("target in the head's frame, first axis", to_target[0]),
            seen("target in the head's frame, second axis", to_target[1]),
            seen("head velocity, first axis", head),
            seen("head velocity, second axis", head + 1),
            seen("head angular velocity", head + 2),
            seen("first joint's angle", 0),
            seen("middle joint's angle", joints / 2),
            seen("last joint's angle", joints - 1),
        ]
    }

    /// Any heading and bend; the target in a square of 4 m, in one episode of five of 0.6 m.
    fn start(&self, physics: &mut Physics, rng: &mut dyn RngCore) -> Result<ModelOverrides> {
        randomize_joints(physics, rng);
        let reach = if rng.random::<f64>() < 0.2 { 0.3 } else { 2.0 };
        let [x, y] = [(); 2].map(|()| rng.random_range(-reach..reach));
        let target_height = physics.model().geom_pos()[self.target][2];
        let light_height = physics.model().light_pos()[self.target_light][2];
        let mut changed = ModelOverrides::default();
        changed.set("geom_pos", "target", &[x, y, target_height]);
        changed.set("light_pos", "target_light", &[x, y, light_height]);
        Ok(changed)
    }

    /// Joint angles, the way to the target, and each link's velocity in its own frame (forwards, sideways, turning).
    fn observe(&self, physics: &Physics, observation: &mut Vec<f64>) {
        observation.extend_from_slice(&physics.qpos()[3..]);
        observation.extend(self.to_target(physics));
        let links = physics.data().sensordata()[FRAME_SENSORS..].chunks_exact(6);
        observation.extend(links.flat_map(|link| [link[0], link[1], link[5]]));
    }

    fn reward(&self, physics: &Physics) -> f64 {
        let [x, y] = self.to_target(physics);
        let radius = physics.model().geom_size()[self.target][0];
        let near = Tolerance::within(0.0, radius).margin(5.0 * radius).falling(Sigmoid::LongTail, 0.1);
        near.value((x * x + y * y).sqrt())
    }
}
