//! Changes to a model that belong to an episode: a target's position, a damping, a colour. By field and object name, as `dm_control` names
//! them: `{"geom_pos": {"target": [0.1, 0.1, 0.01]}}`. They are part of an episode's state and stored in its manifest.

use std::collections::BTreeMap;

use mujoco_rs::prelude::{MjModel, MjtObjBase};
use serde::{Deserialize, Serialize};

use super::Physics;
use crate::{Error, Result};

/// Field → object → value; a single number may stand for a list of one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ModelOverrides(BTreeMap<String, BTreeMap<String, Value>>);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
enum Value {
    One(f64),
    Many(Vec<f64>),
}

impl Value {
    fn numbers(&self) -> &[f64] {
        match self {
            Self::One(number) => std::slice::from_ref(number),
            Self::Many(numbers) => numbers,
        }
    }
}

impl ModelOverrides {
    /// Whether nothing is changed.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sets one object's value of one field, replacing an earlier one.
    pub fn set(&mut self, field: &str, object: &str, numbers: &[f64]) {
        let value = Value::Many(numbers.to_vec());
        self.0.entry(field.to_owned()).or_default().insert(object.to_owned(), value);
    }

    /// The value of one object's field, if it is changed.
    pub fn get(&self, field: &str, object: &str) -> Option<&[f64]> {
        self.0.get(field)?.get(object).map(Value::numbers)
    }

    /// These overrides with `later` ones on top.
    #[must_use]
    pub fn with(mut self, later: &Self) -> Self {
        for (field, object, numbers) in later.iter() {
            self.set(field, object, numbers);
        }
        self
    }

    /// Every change, in the order of the names.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str, &[f64])> {
        self.0.iter().flat_map(|(field, objects)| {
            objects.iter().map(|(object, value)| (field.as_str(), object.as_str(), value.numbers()))
        })
    }
}

/// A field that can be overridden: its name, what its objects are, and how one object's numbers are reached.
struct Field {
    name: &'static str,
    kind: &'static str,
    object: MjtObjBase,
    numbers: fn(&mut MjModel, usize) -> Numbers<'_>,
}

/// MuJoCo keeps colours in single precision.
enum Numbers<'a> {
    Double(&'a mut [f64]),
    Single(&'a mut [f32]),
}

impl Numbers<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Double(slots) => slots.len(),
            Self::Single(slots) => slots.len(),
        }
    }

    /// Writes `numbers` and returns what was there.
    fn replace(&mut self, numbers: &[f64]) -> Vec<f64> {
        match self {
            Self::Double(slots) => {
                let old = slots.to_vec();
                slots.copy_from_slice(numbers);
                old
            }
            Self::Single(slots) => {
                let old = slots.iter().map(|&slot| f64::from(slot)).collect();
                for (slot, &number) in slots.iter_mut().zip(numbers) {
                    *slot = number as f32;
                }
                old
            }
        }
    }
}

macro_rules! field {
    ($name:literal, $kind:literal, $object:ident, $width:ident, $slots:ident) => {
        Field {
            name: $name,
            kind: $kind,
            object: MjtObjBase::$object,
            numbers: |model, id| Numbers::$width(&mut model.$slots()[id]),
        }
    };
}

const FIELDS: [Field; 13] = [
    field!("body_pos", "body", mjOBJ_BODY, Double, body_pos_mut),
    field!("cam_pos", "camera", mjOBJ_CAMERA, Double, cam_pos_mut),
    Field {
        name: "dof_damping",
        kind: "joint",
        object: MjtObjBase::mjOBJ_JOINT,
        numbers: |model, joint| {
            let dofs = joint_dofs(model, joint);
            Numbers::Double(&mut model.dof_damping_mut()[dofs])
        },
    },
    Field {
        name: "dof_frictionloss",
        kind: "joint",
        object: MjtObjBase::mjOBJ_JOINT,
        numbers: |model, joint| {
            let dofs = joint_dofs(model, joint);
            Numbers::Double(&mut model.dof_frictionloss_mut()[dofs])
        },
    },
    field!("geom_friction", "geom", mjOBJ_GEOM, Double, geom_friction_mut),
    field!("geom_pos", "geom", mjOBJ_GEOM, Double, geom_pos_mut),
    field!("geom_rgba", "geom", mjOBJ_GEOM, Single, geom_rgba_mut),
    field!("geom_size", "geom", mjOBJ_GEOM, Double, geom_size_mut),
    field!("light_pos", "light", mjOBJ_LIGHT, Double, light_pos_mut),
    field!("mat_rgba", "material", mjOBJ_MATERIAL, Single, mat_rgba_mut),
    field!("site_pos", "site", mjOBJ_SITE, Double, site_pos_mut),
    field!("site_rgba", "site", mjOBJ_SITE, Single, site_rgba_mut),
    field!("site_size", "site", mjOBJ_SITE, Double, site_size_mut),
];

/// The degrees of freedom of a joint: one for hinges and slides.
fn joint_dofs(model: &MjModel, joint: usize) -> std::ops::Range<usize> {
    let starts = model.jnt_dofadr();
    let start = usize::try_from(starts[joint]).unwrap_or(0);
    let end = starts.get(joint + 1).map_or(model.dof_damping().len(), |&next| usize::try_from(next).unwrap_or(0));
    start..end
}

impl Physics {
    /// Puts the model back as it was compiled, then applies `overrides`; with an error nothing is left half applied.
    pub fn set_overrides(&mut self, overrides: &ModelOverrides) -> Result<()> {
        let originals = std::mem::take(&mut self.originals);
        for (field, object, numbers) in originals.iter() {
            self.apply(field, object, numbers)?;
        }
        for (field, object, numbers) in overrides.iter() {
            match self.apply(field, object, numbers) {
                Ok(old) => self.originals.set(field, object, &old),
                Err(error) => {
                    self.set_overrides(&ModelOverrides::default())?;
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    /// Writes one object's numbers and returns those they replace.
    fn apply(&mut self, field: &str, object: &str, numbers: &[f64]) -> Result<Vec<f64>> {
        let refused = |fact: String, expected: String| Error::Override { field: field.to_owned(), fact, expected };
        let Some(known) = FIELDS.iter().find(|known| known.name == field) else {
            let names: Vec<&str> = FIELDS.iter().map(|field| field.name).collect();
            return Err(refused("no such field".to_owned(), format!("the fields are {}", names.join(", "))));
        };
        let id = self.find(known.kind, known.object, object)?;
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(refused(
                format!("{object} has a value that is not finite"),
                "it takes finite numbers".to_owned(),
            ));
        }
        let mut slots = (known.numbers)(self.model_mut(), id);
        if slots.len() != numbers.len() {
            let expected = format!("it takes {}", slots.len());
            return Err(refused(format!("{object} has {} numbers", numbers.len()), expected));
        }
        Ok(slots.replace(numbers))
    }

    fn model_mut(&mut self) -> &mut MjModel {
        // SAFETY: callers in this module write positions, sizes, colours and dampings only; no size, index or address table is changed.
        #[allow(unsafe_code, reason = "the wrapper cannot know that only plain values are written")]
        unsafe {
            self.data.model_mut()
        }
    }
}
