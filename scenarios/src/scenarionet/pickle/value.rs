//! What a pickle holds.
//!
//! Values are small and copied; what can be shared or hold itself lies in one list of objects, so that a circle does no harm.

use std::borrow::Cow;

use super::array::{Array, NumberType, Numbers};
use super::class::Class;

/// Names are copied, and one may be named often.
const LONGEST_NAME: usize = 256;

/// A value. Texts and bytes are those of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "Python's words")]
pub enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(&'a [u8]),
    Class(Class),
    Object(Place),
}

/// Where an object lies in a pickle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place(pub(super) u32);

#[derive(Clone, Debug)]
pub(super) enum Object<'a> {
    List(Vec<Value<'a>>),
    Tuple(Vec<Value<'a>>),
    Set(Vec<Value<'a>>),
    /// Keys and values as they came; of a key that is there twice the last counts.
    Dict(Vec<(Value<'a>, Value<'a>)>),
    /// A text that is not in the file as it is.
    Text(String),
    /// Bytes that are not in the file as they are.
    Bytes(Vec<u8>),
    Type(NumberType),
    Array(Array<'a>),
    /// A member of an enumeration of the oldest scenes, which is a number of WOMD's.
    Member(Class, i64),
}

/// What was read from a pickle.
#[derive(Clone, Debug)]
pub struct Pickle<'a> {
    pub(super) objects: Vec<Object<'a>>,
    pub(super) root: Value<'a>,
}

impl<'a> Pickle<'a> {
    /// The value that all others are in.
    #[must_use]
    pub fn root(&self) -> Value<'a> {
        self.root
    }

    fn object(&self, value: Value<'a>) -> Option<&Object<'a>> {
        match value {
            Value::Object(place) => self.objects.get(place.0 as usize),
            _ => None,
        }
    }

    /// The text, if it is one.
    #[must_use]
    pub fn text(&self, value: Value<'a>) -> Option<&str> {
        match (value, self.object(value)) {
            (Value::Text(text), _) => Some(text),
            (_, Some(Object::Text(text))) => Some(text),
            _ => None,
        }
    }

    /// The text or the integer as text: keys are both, for the same thing. Texts of more than 256 bytes are no names.
    #[must_use]
    pub fn name(&self, value: Value<'a>) -> Option<Cow<'_, str>> {
        match value {
            Value::Int(number) => Some(number.to_string().into()),
            _ => self.text(value).filter(|text| text.len() <= LONGEST_NAME).map(Cow::Borrowed),
        }
    }

    /// The integer, also as text; of a member of an enumeration its number.
    #[must_use]
    pub fn int(&self, value: Value<'a>) -> Option<i64> {
        match (value, self.object(value)) {
            (Value::Int(number), _) => Some(number),
            (Value::Bool(truth), _) => Some(i64::from(truth)),
            // Every integer that a scene has is far below 2^53.
            (Value::Float(number), _) if number.fract() == 0.0 && number.abs() < 9e15 => Some(number as i64),
            (_, Some(Object::Member(_, number))) => Some(*number),
            _ => self.text(value)?.parse().ok(),
        }
    }

    /// The number.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "integers of scenes are small")]
    pub fn float(&self, value: Value<'a>) -> Option<f64> {
        match value {
            Value::Float(number) => Some(number),
            Value::Int(number) => Some(number as f64),
            Value::Bool(truth) => Some(f64::from(u8::from(truth))),
            _ => None,
        }
    }

    /// The bytes. Python 2 writes them as texts.
    #[must_use]
    pub fn bytes(&self, value: Value<'a>) -> Option<&[u8]> {
        match (value, self.object(value)) {
            (Value::Bytes(bytes), _) => Some(bytes),
            (Value::Text(text), _) => Some(text.as_bytes()),
            (_, Some(Object::Bytes(bytes))) => Some(bytes),
            _ => None,
        }
    }

    /// The members of a list, a tuple or a set.
    #[must_use]
    pub fn items(&self, value: Value<'a>) -> Option<&[Value<'a>]> {
        match self.object(value)? {
            Object::List(items) | Object::Tuple(items) | Object::Set(items) => Some(items),
            _ => None,
        }
    }

    /// Keys and values of a dict, in its order.
    #[must_use]
    pub fn dict(&self, value: Value<'a>) -> Option<&[(Value<'a>, Value<'a>)]> {
        match self.object(value)? {
            Object::Dict(pairs) => Some(pairs),
            _ => None,
        }
    }

    /// What a dict has under the text `key`.
    #[must_use]
    pub fn get(&self, dict: Value<'a>, key: &str) -> Option<Value<'a>> {
        self.dict(dict)?.iter().rev().find(|(name, _)| self.text(*name) == Some(key)).map(|(_, value)| *value)
    }

    /// The numbers of an array.
    #[must_use]
    pub fn numbers(&self, value: Value<'a>) -> Option<Numbers<'_>> {
        match self.object(value)? {
            Object::Array(array) => array.numbers(self),
            _ => None,
        }
    }

    /// The class and number of a member of an enumeration.
    pub(crate) fn member(&self, value: Value<'a>) -> Option<(Class, i64)> {
        match self.object(value)? {
            Object::Member(class, number) => Some((*class, *number)),
            _ => None,
        }
    }

    /// What kind of value it is, for messages.
    #[must_use]
    pub fn kind(&self, value: Value<'a>) -> &'static str {
        match (value, self.object(value)) {
            (Value::None, _) => "None",
            (Value::Bool(_), _) => "a bool",
            (Value::Int(_), _) => "an int",
            (Value::Float(_), _) => "a float",
            (Value::Text(_), _) | (_, Some(Object::Text(_))) => "a text",
            (Value::Bytes(_), _) | (_, Some(Object::Bytes(_))) => "bytes",
            (_, Some(Object::List(_))) => "a list",
            (_, Some(Object::Tuple(_))) => "a tuple",
            (_, Some(Object::Set(_))) => "a set",
            (_, Some(Object::Dict(_))) => "a dict",
            (_, Some(Object::Array(_))) => "an array",
            (_, Some(Object::Member(..))) => "a member of an enumeration",
            _ => "a class",
        }
    }
}
