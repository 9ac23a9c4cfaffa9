//! The classes that a pickle may name, and what becomes of calling them. Nothing is run: each is made here, as what it stands for.

use super::array::{Array, NumberType};
use super::problem::PickleProblem;
use super::value::{Object, Pickle, Value};

/// A class or function that is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "Python's and NumPy's names")]
pub enum Class {
    Reconstruct,
    NdArray,
    DType,
    Scalar,
    FromBuffer,
    Dict,
    List,
    Tuple,
    Set,
    Bytes,
    Encode,
    /// `int`, `float`, `bool`, `str`: what a `defaultdict` would make.
    Factory,
    AgentType,
    RoadLineType,
    RoadEdgeType,
}

impl Class {
    /// The class of this name, or none.
    pub(super) fn named(module: &str, name: &str) -> Option<Self> {
        Some(match (module, name) {
            ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => Self::Reconstruct,
            ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Self::Scalar,
            ("numpy.core.numeric" | "numpy._core.numeric", "_frombuffer") => Self::FromBuffer,
            ("numpy", "ndarray") => Self::NdArray,
            ("numpy", "dtype") => Self::DType,
            ("builtins" | "__builtin__", "dict") | ("collections", "defaultdict" | "OrderedDict") => Self::Dict,
            ("builtins" | "__builtin__", "list") => Self::List,
            ("builtins" | "__builtin__", "tuple") => Self::Tuple,
            ("builtins" | "__builtin__", "set" | "frozenset") => Self::Set,
            ("builtins" | "__builtin__", "bytes" | "bytearray") => Self::Bytes,
            ("builtins" | "__builtin__", "int" | "long" | "float" | "bool" | "str") => Self::Factory,
            ("_codecs", "encode") => Self::Encode,
            // A dict with methods, by which scenes were written for a time.
            ("metadrive.scenario.scenario_description" | "metadrive.scenario", "ScenarioDescription") => Self::Dict,
            // Enumerations of the oldest converters, which were scripts.
            ("__main__", "AgentType") => Self::AgentType,
            ("__main__", "RoadLineType") => Self::RoadLineType,
            ("__main__", "RoadEdgeType") => Self::RoadEdgeType,
            ("utils.typedef" | "trafficgen.utils.typedef", "AgentType") => Self::AgentType,
            ("utils.typedef" | "trafficgen.utils.typedef", "RoadLineType") => Self::RoadLineType,
            ("utils.typedef" | "trafficgen.utils.typedef", "RoadEdgeType") => Self::RoadEdgeType,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Reconstruct => "numpy.core.multiarray._reconstruct",
            Self::NdArray => "numpy.ndarray",
            Self::DType => "numpy.dtype",
            Self::Scalar => "numpy.core.multiarray.scalar",
            Self::FromBuffer => "numpy.core.numeric._frombuffer",
            Self::Dict => "dict",
            Self::List => "list",
            Self::Tuple => "tuple",
            Self::Set => "set",
            Self::Bytes => "bytes",
            Self::Encode => "_codecs.encode",
            Self::Factory => "int",
            Self::AgentType => "AgentType",
            Self::RoadLineType => "RoadLineType",
            Self::RoadEdgeType => "RoadEdgeType",
        }
    }

    fn refusal(self) -> PickleProblem {
        PickleProblem::Call { class: self.name() }
    }

    /// What calling it makes.
    pub(super) fn call<'a>(self, arguments: &[Value<'a>], pickle: &Pickle<'a>) -> Result<Made<'a>, PickleProblem> {
        let items = |value| pickle.items(value).map(<[Value]>::to_vec).ok_or_else(|| self.refusal());
        Ok(Made::Object(match (self, arguments) {
            (Self::Reconstruct, [Value::Class(Self::NdArray), ..]) => Object::Array(Array::empty()),
            (Self::DType, [name, ..]) => {
                Object::Type(NumberType::named(pickle.text(*name).ok_or_else(|| self.refusal())?)?)
            }
            (Self::Scalar, [number, bytes]) => {
                let (number, bytes) = (self.number_type(*number, pickle)?, pickle.bytes(*bytes));
                return number.scalar(bytes.ok_or_else(|| self.refusal())?).map(Made::Value);
            }
            (Self::FromBuffer, [data, number, shape, order]) => {
                let number = self.number_type(*number, pickle)?;
                let bytes = pickle.bytes(*data).map(<[u8]>::len);
                let fortran = pickle.text(*order) == Some("F");
                Object::Array(Array::new(self.shape(*shape, pickle)?, number, fortran, *data, bytes)?)
            }
            (Self::Dict, [] | [Value::Class(_) | Value::None]) => Object::Dict(Vec::new()),
            (Self::Dict, [content] | [Value::Class(_) | Value::None, content]) => match pickle.dict(*content) {
                Some(pairs) => Object::Dict(pairs.to_vec()),
                None => {
                    let pair = |pair: &Value<'a>| match pickle.items(*pair) {
                        Some([key, value]) => Ok((*key, *value)),
                        _ => Err(self.refusal()),
                    };
                    Object::Dict(items(*content)?.iter().map(pair).collect::<Result<_, _>>()?)
                }
            },
            (Self::List, []) => Object::List(Vec::new()),
            (Self::List, [content]) => Object::List(items(*content)?),
            (Self::Tuple, []) => Object::Tuple(Vec::new()),
            (Self::Tuple, [content]) => Object::Tuple(items(*content)?),
            (Self::Set, []) => Object::Set(Vec::new()),
            (Self::Set, [content]) => Object::Set(items(*content)?),
            (Self::Bytes, []) => Object::Bytes(Vec::new()),
            (Self::Bytes, [content]) => Object::Bytes(pickle.bytes(*content).ok_or_else(|| self.refusal())?.to_vec()),
            // Bytes as protocols before 3 have them: a text whose characters stand for them.
            (Self::Encode | Self::Bytes, [text, codec])
                if matches!(pickle.text(*codec), Some("latin1" | "latin-1")) =>
            {
                let text = pickle.text(*text).ok_or_else(|| self.refusal())?;
                let bytes = text.chars().map(|c| u8::try_from(u32::from(c)).map_err(|_| self.refusal()));
                Object::Bytes(bytes.collect::<Result<_, _>>()?)
            }
            (Self::AgentType | Self::RoadLineType | Self::RoadEdgeType, [Value::Int(number)]) => {
                Object::Member(self, *number)
            }
            _ => return Err(self.refusal()),
        }))
    }

    /// A new one without arguments to its making, of those classes that are made so.
    pub(super) fn new_object<'a>(self, arguments: &[Value<'a>]) -> Result<Object<'a>, PickleProblem> {
        match (self, arguments) {
            (Self::Dict, []) => Ok(Object::Dict(Vec::new())),
            _ => Err(self.refusal()),
        }
    }

    fn number_type(self, value: Value<'_>, pickle: &Pickle<'_>) -> Result<NumberType, PickleProblem> {
        let Value::Object(place) = value else { return Err(self.refusal()) };
        match pickle.objects.get(place.0 as usize) {
            Some(Object::Type(number)) => Ok(*number),
            _ => Err(self.refusal()),
        }
    }

    /// The lengths along each axis; NumPy has 64 axes at most.
    fn shape(self, value: Value<'_>, pickle: &Pickle<'_>) -> Result<Vec<usize>, PickleProblem> {
        let length = |length: &Value<'_>| match length {
            Value::Int(length) => usize::try_from(*length).map_err(|_| self.refusal()),
            _ => Err(self.refusal()),
        };
        match pickle.items(value) {
            Some(lengths) if lengths.len() <= 64 => lengths.iter().map(length).collect(),
            _ => Err(self.refusal()),
        }
    }
}

/// What a call makes.
pub(super) enum Made<'a> {
    Object(Object<'a>),
    Value(Value<'a>),
}

/// What `object` becomes by its state: types and arrays are written as an empty one first.
pub(super) fn built<'a>(
    object: &Object<'a>,
    state: Value<'a>,
    pickle: &Pickle<'a>,
) -> Result<Option<Object<'a>>, PickleProblem> {
    match (object, pickle.items(state)) {
        (Object::Type(number), Some([_, order, ..])) => {
            let order = pickle.text(*order).ok_or_else(|| Class::DType.refusal())?;
            Ok(Some(Object::Type(number.ordered(order))))
        }
        (Object::Array(_), Some([_, shape, number, fortran, data])) => {
            let class = Class::NdArray;
            let (shape, number) = (class.shape(*shape, pickle)?, class.number_type(*number, pickle)?);
            let fortran = *fortran == Value::Bool(true) || *fortran == Value::Int(1);
            let bytes = pickle.bytes(*data).map(<[u8]>::len);
            Ok(Some(Object::Array(Array::new(shape, number, fortran, *data, bytes)?)))
        }
        (Object::Array(_), _) => Err(Class::NdArray.refusal()),
        (Object::Type(_), _) => Err(Class::DType.refusal()),
        // What a dict with methods or a member of an enumeration has beside its content says nothing of the scene.
        (Object::Dict(_) | Object::Member(..), _) => Ok(None),
        _ => Err(PickleProblem::NoClass),
    }
}
