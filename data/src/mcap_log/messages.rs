//! The Protobuf messages of an episode's MCAP log, and the descriptor that lets any reader decode them.

use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, OneofDescriptorProto,
};

/// One row's state, action and reward.
#[derive(Clone, PartialEq, prost::Message)]
pub(super) struct Step {
    #[prost(uint32, tag = "1")]
    pub(super) episode: u32,
    #[prost(uint32, tag = "2")]
    pub(super) step: u32,
    #[prost(uint32, optional, tag = "3")]
    pub(super) state: Option<u32>,
    #[prost(uint32, optional, tag = "4")]
    pub(super) distractor: Option<u32>,
    #[prost(bool, tag = "5")]
    pub(super) is_first: bool,
    #[prost(bool, tag = "6")]
    pub(super) is_last: bool,
    #[prost(bool, tag = "7")]
    pub(super) is_terminal: bool,
    #[prost(float, repeated, tag = "8")]
    pub(super) action: Vec<f32>,
    #[prost(float, optional, tag = "9")]
    pub(super) reward: Option<f32>,
    #[prost(float, optional, tag = "10")]
    pub(super) discount: Option<f32>,
    #[prost(float, repeated, tag = "11")]
    pub(super) observation: Vec<f32>,
    #[prost(double, repeated, tag = "12")]
    pub(super) qpos: Vec<f64>,
    #[prost(double, repeated, tag = "13")]
    pub(super) qvel: Vec<f64>,
    #[prost(uint32, optional, tag = "14")]
    pub(super) acting_distractor: Option<u32>,
}

/// One row's distractors, as parameters.
#[derive(Clone, PartialEq, prost::Message)]
pub(super) struct Distractor {
    #[prost(double, tag = "1")]
    pub(super) r: f64,
    #[prost(double, tag = "2")]
    pub(super) h: f64,
    #[prost(double, tag = "3")]
    pub(super) v: f64,
    #[prost(double, tag = "4")]
    pub(super) roll: f64,
    #[prost(uint32, optional, tag = "5")]
    pub(super) video: Option<u32>,
    #[prost(uint32, optional, tag = "6")]
    pub(super) frame: Option<u32>,
    #[prost(float, repeated, tag = "7")]
    pub(super) colors: Vec<f32>,
}

/// How a field of the messages above is declared.
enum Kind {
    Plain,
    Optional,
    Repeated,
}

/// The descriptors of both messages, in one file.
pub(super) fn file_descriptor_set() -> FileDescriptorSet {
    use Kind::{Optional, Plain, Repeated};
    let step = [
        ("episode", Type::Uint32, Plain),
        ("step", Type::Uint32, Plain),
        ("state", Type::Uint32, Optional),
        ("distractor", Type::Uint32, Optional),
        ("is_first", Type::Bool, Plain),
        ("is_last", Type::Bool, Plain),
        ("is_terminal", Type::Bool, Plain),
        ("action", Type::Float, Repeated),
        ("reward", Type::Float, Optional),
        ("discount", Type::Float, Optional),
        ("observation", Type::Float, Repeated),
        ("qpos", Type::Double, Repeated),
        ("qvel", Type::Double, Repeated),
        ("acting_distractor", Type::Uint32, Optional),
    ];
    let distractor = [
        ("r", Type::Double, Plain),
        ("h", Type::Double, Plain),
        ("v", Type::Double, Plain),
        ("roll", Type::Double, Plain),
        ("video", Type::Uint32, Optional),
        ("frame", Type::Uint32, Optional),
        ("colors", Type::Float, Repeated),
    ];
    let file = FileDescriptorProto {
        name: Some("vibes.proto".into()),
        package: Some("vibes".into()),
        syntax: Some("proto3".into()),
        message_type: vec![message("Step", &step), message("Distractor", &distractor)],
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }
}

/// Fields are numbered in order, from 1, as in the structs. A proto3 optional is declared by a one-of of its own.
fn message(name: &str, fields: &[(&str, Type, Kind)]) -> DescriptorProto {
    let mut oneofs = Vec::new();
    let mut field = Vec::new();
    for (number, (name, of, kind)) in fields.iter().enumerate() {
        let optional = matches!(kind, Kind::Optional);
        let label = if matches!(kind, Kind::Repeated) { Label::Repeated } else { Label::Optional };
        field.push(FieldDescriptorProto {
            name: Some((*name).into()),
            number: Some(number as i32 + 1),
            label: Some(label as i32),
            r#type: Some(*of as i32),
            oneof_index: optional.then_some(oneofs.len() as i32),
            proto3_optional: optional.then_some(true),
            ..FieldDescriptorProto::default()
        });
        if optional {
            oneofs.push(OneofDescriptorProto { name: Some(format!("_{name}")), ..OneofDescriptorProto::default() });
        }
    }
    DescriptorProto { name: Some(name.into()), field, oneof_decl: oneofs, ..DescriptorProto::default() }
}
