//! The sky's texture: a cube map all of whose faces show the same video frame, as in the suite.
//!
//! In: frames with their mipmap levels, and the camera. Out: an OpenGL texture that MuJoCo draws the sky with. The suite uploads six faces of 800×800
//! and has the driver make their mipmaps at every step. A small picture never shows the finest levels, and a
//! camera sees one or two faces: only those levels, ready made, and those faces are uploaded, and only when the frame changed.
#![allow(unsafe_code, reason = "calls of OpenGL functions by their C signatures")]

use std::ffi::{c_int, c_uint, c_void};

use vibes_data::BackgroundFrame;

use super::egl::EglContext;
use crate::distractors::view::CameraFrame;
use crate::error::Result;
use crate::videos::{LEVELS, VideoLibrary};

type Enum = c_uint;

const TEXTURE0: Enum = 0x84C0;
const TEXTURE_CUBE_MAP: Enum = 0x8513;
const TEXTURE_CUBE_MAP_POSITIVE_X: Enum = 0x8515;
const TEXTURE_MAG_FILTER: Enum = 0x2800;
const TEXTURE_MIN_FILTER: Enum = 0x2801;
const TEXTURE_WRAP_S: Enum = 0x2802;
const TEXTURE_WRAP_T: Enum = 0x2803;
const TEXTURE_WRAP_R: Enum = 0x8072;
const TEXTURE_MAX_LEVEL: Enum = 0x813D;
const LINEAR: c_int = 0x2601;
const LINEAR_MIPMAP_LINEAR: c_int = 0x2703;
const CLAMP_TO_EDGE: c_int = 0x812F;
const RGB: Enum = 0x1907;
const UNSIGNED_BYTE: Enum = 0x1401;

const FACES: usize = 6;
/// How far beyond the picture's edge, as a share of it, faces count as seen: texture filters reach over a face's edge.
const MARGIN: f64 = 1.1;
/// The picture is probed for faces at this many points each way; faces are far larger than the gaps.
const PROBES: i32 = 9;

macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*);)*) => {
        /// The OpenGL functions used here.
        struct Functions { $($field: unsafe extern "system" fn($($argument),*),)* }

        impl Functions {
            fn load(gl: &EglContext) -> Result<Self> {
                $(
                    let address = gl.function($name)?;
                    // SAFETY: this is the function's signature in the OpenGL specification.
                    let $field = unsafe { std::mem::transmute::<*const c_void, unsafe extern "system" fn($($argument),*)>(address) };
                )*
                Ok(Self { $($field,)* })
            }
        }
    };
}

functions! {
    active_texture = "glActiveTexture": fn(Enum);
    bind_texture = "glBindTexture": fn(Enum, c_uint);
    delete_textures = "glDeleteTextures": fn(c_int, *const c_uint);
    gen_textures = "glGenTextures": fn(c_int, *mut c_uint);
    tex_image_2d = "glTexImage2D": fn(Enum, c_int, c_int, c_int, c_int, c_int, Enum, Enum, *const c_void);
    tex_parameter_i = "glTexParameteri": fn(Enum, Enum, c_int);
    tex_sub_image_2d = "glTexSubImage2D": fn(Enum, c_int, c_int, c_int, c_int, c_int, Enum, Enum, *const c_void);
}

/// A cube texture and what is in it.
pub(super) struct Sky {
    functions: Functions,
    texture: c_uint,
    side: usize,
    shown: Option<BackgroundFrame>,
    /// Which faces hold `shown`.
    uploaded: [bool; FACES],
    bytes: Vec<u8>,
}

impl std::fmt::Debug for Sky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sky").field("side", &self.side).field("shown", &self.shown).finish_non_exhaustive()
    }
}

impl Sky {
    /// An empty cube of `side` pixels. The context must be current.
    pub(super) fn new(gl: &EglContext, side: usize) -> Result<Self> {
        let functions = Functions::load(gl)?;
        let mut texture = 0;
        // SAFETY: the context is current; one name is written; the texture's levels are allocated without data.
        unsafe {
            (functions.gen_textures)(1, &raw mut texture);
            (functions.active_texture)(TEXTURE0);
            (functions.bind_texture)(TEXTURE_CUBE_MAP, texture);
            for wrap in [TEXTURE_WRAP_S, TEXTURE_WRAP_T, TEXTURE_WRAP_R] {
                (functions.tex_parameter_i)(TEXTURE_CUBE_MAP, wrap, CLAMP_TO_EDGE);
            }
            (functions.tex_parameter_i)(TEXTURE_CUBE_MAP, TEXTURE_MAG_FILTER, LINEAR);
            (functions.tex_parameter_i)(TEXTURE_CUBE_MAP, TEXTURE_MIN_FILTER, LINEAR_MIPMAP_LINEAR);
            (functions.tex_parameter_i)(TEXTURE_CUBE_MAP, TEXTURE_MAX_LEVEL, LEVELS as c_int - 1);
            for (face, level) in (0..FACES).flat_map(|face| (0..LEVELS).map(move |level| (face, level))) {
                let (target, side) = (TEXTURE_CUBE_MAP_POSITIVE_X + face as Enum, (side >> level) as c_int);
                (functions.tex_image_2d)(
                    target,
                    level as c_int,
                    RGB as c_int,
                    side,
                    side,
                    0,
                    RGB,
                    UNSIGNED_BYTE,
                    std::ptr::null(),
                );
            }
        }
        Ok(Self { functions, texture, side, shown: None, uploaded: [false; FACES], bytes: Vec::new() })
    }

    /// The texture's name.
    pub(super) fn texture(&self) -> c_uint {
        self.texture
    }

    /// Brings `frame` to all faces that a camera of this field of view (the tangent of half of it) sees.
    pub(super) fn show(
        &mut self,
        frame: BackgroundFrame,
        videos: &VideoLibrary,
        camera: &CameraFrame,
        tangent: f64,
    ) -> Result<()> {
        if self.shown != Some(frame) {
            self.shown = None;
            videos.read(frame, &mut self.bytes)?;
            self.uploaded = [false; FACES];
            self.shown = Some(frame);
        }
        for (face, seen) in faces_seen(camera, tangent).into_iter().enumerate() {
            if seen && !self.uploaded[face] {
                self.upload(face);
                self.uploaded[face] = true;
            }
        }
        Ok(())
    }

    fn upload(&self, face: usize) {
        let mut start = 0;
        // SAFETY: the context is current; `bytes` holds all levels of a frame of this side, one after the other, tightly packed (MuJoCo
        // sets the unpack alignment to 1).
        unsafe {
            (self.functions.active_texture)(TEXTURE0);
            (self.functions.bind_texture)(TEXTURE_CUBE_MAP, self.texture);
            for level in 0..LEVELS {
                let side = self.side >> level;
                let pixels = self.bytes[start..start + 3 * side * side].as_ptr().cast();
                let target = TEXTURE_CUBE_MAP_POSITIVE_X + face as Enum;
                (self.functions.tex_sub_image_2d)(
                    target,
                    level as c_int,
                    0,
                    0,
                    side as c_int,
                    side as c_int,
                    RGB,
                    UNSIGNED_BYTE,
                    pixels,
                );
                start += 3 * side * side;
            }
        }
    }

    /// Gives the texture back. The context must be current.
    pub(super) fn delete(&mut self) {
        // SAFETY: the context is current and the name is this texture's.
        unsafe { (self.functions.delete_textures)(1, &raw const self.texture) };
    }
}

/// Which faces of the cube, in OpenGL's order, a camera sees.
fn faces_seen(camera: &CameraFrame, tangent: f64) -> [bool; FACES] {
    let mut seen = [false; FACES];
    for (i, j) in (0..PROBES).flat_map(|i| (0..PROBES).map(move |j| (i, j))) {
        let at = |index: i32| (f64::from(2 * index) / f64::from(PROBES - 1) - 1.0) * tangent * MARGIN;
        seen[face(camera, [at(i), at(j), -1.0])] = true;
    }
    seen
}

/// The face hit by a ray in camera coordinates. MuJoCo turns the sky by 90° about x, so that the cube's y is up.
fn face(camera: &CameraFrame, ray: [f64; 3]) -> usize {
    let world: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| camera.orientation[3 * i + k] * ray[k]).sum());
    let cube = [world[0], world[2], -world[1]];
    let axis = (0..3).fold(0, |best, axis| if cube[axis].abs() > cube[best].abs() { axis } else { best });
    2 * axis + usize::from(cube[axis] < 0.0)
}
