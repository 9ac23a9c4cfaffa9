//! Parameters of families: numbers that a user may narrow down, each a range that every scene draws from.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{self, Deserialize, Deserializer, SeqAccess, Visitor};
use serde::ser::{Serialize, Serializer};
use thiserror::Error;

use super::Family;

/// A number of a family that differs from scene to scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, in lower case.
    pub name: &'static str,
    /// What it is, with its unit.
    pub about: &'static str,
    /// The range that a scene draws from where nothing is given: low, high.
    pub default: [f64; 2],
    /// The range within which a given one must lie: low, high.
    pub limits: [f64; 2],
}

/// What every family has; [`Family::parameters`] come after them.
pub const COMMON: &[Parameter] = &[
    Parameter { name: "traffic", about: "how dense traffic is; 1 is usual", default: [0.5, 1.5], limits: [0.0, 3.0] },
    Parameter { name: "parked", about: "share of the bays that are taken", default: [0.3, 0.95], limits: [0.0, 1.0] },
    Parameter { name: "people", about: "how many are on foot; 1 is usual", default: [0.0, 1.4], limits: [0.0, 5.0] },
    Parameter {
        name: "violators",
        about: "share of drivers who mind neither lights nor signs",
        default: [0.0, 0.02],
        limits: [0.0, 1.0],
    },
    Parameter {
        name: "clarity",
        about: "how well the sensors see; 1 is usual, more loses less",
        default: [0.8, 1.2],
        limits: [0.2, 10.0],
    },
];

/// Given parameters: a range for each name, in order of names. Nothing given by default.
///
/// ```
/// # use scenarios::generated::Parameters;
/// let given = Parameters::read(&["traffic=0.5..1.5", "gap=4"]).unwrap();
/// assert_eq!(given.to_string(), "gap=4, traffic=0.5..1.5");
/// assert_eq!(given.range("gap"), Some([4.0, 4.0]));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters(BTreeMap<String, Range>);

/// Low and high; both are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Range([f64; 2]);

/// No number in it is NaN: none is taken in.
impl Eq for Parameters {}

/// Why parameters are of no use.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ParameterError {
    #[error("{text:?} is no parameter")]
    Malformed { text: String },
    #[error("the parameter {name} is given twice")]
    Twice { name: String },
    #[error("{family} has no parameter {name}; it has {}", if names.is_empty() { "none".to_owned() } else { names.join(", ") })]
    Unknown { family: &'static str, name: String, names: Vec<&'static str> },
    #[error("{name} of {family} is {}, but lies within {}..{}", Range(*given), limits[0], limits[1])]
    OutOfLimits { family: &'static str, name: &'static str, given: [f64; 2], limits: [f64; 2] },
    #[error("{name} of {family} goes from {} down to {}; it lies within {}..{}", given[0], given[1], limits[0], limits[1])]
    Reversed { family: &'static str, name: &'static str, given: [f64; 2], limits: [f64; 2] },
}

impl ParameterError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Malformed { .. } => "write name=4 for a number, name=4..7 for a range that each scene draws from",
            Self::Twice { .. } => "give it once; name=4..7 is a range",
            Self::Unknown { .. } | Self::OutOfLimits { .. } => "`scenarios families NAME` shows a family's parameters",
            Self::Reversed { .. } => "the lower number comes first",
        }
    }
}

impl Parameters {
    /// The parameters that `texts` say, `name=4` or `name=4..7` each.
    ///
    /// # Errors
    /// [`ParameterError::Malformed`], [`ParameterError::Twice`]; what families have is [`Parameters::check`]'s affair.
    pub fn read<T: AsRef<str>>(texts: &[T]) -> Result<Self, ParameterError> {
        let mut parameters = BTreeMap::new();
        for text in texts.iter().map(AsRef::as_ref) {
            let (name, range) = one(text).ok_or_else(|| ParameterError::Malformed { text: text.to_owned() })?;
            if parameters.insert(name.to_owned(), range).is_some() {
                return Err(ParameterError::Twice { name: name.to_owned() });
            }
        }
        Ok(Self(parameters))
    }

    /// Whether `family` can be made with them.
    ///
    /// # Errors
    /// [`ParameterError`], for the first name that it does not have, or the first range that is none or beyond its limits.
    pub fn check(&self, family: &Family) -> Result<(), ParameterError> {
        self.0.iter().try_for_each(|(name, Range(given))| {
            let Some(parameter) = family.all_parameters().find(|parameter| parameter.name == name) else {
                let names = family.all_parameters().map(|parameter| parameter.name).collect();
                return Err(ParameterError::Unknown { family: family.name, name: name.clone(), names });
            };
            let (family, name, given, limits) = (family.name, parameter.name, *given, parameter.limits);
            match given {
                [low, high] if low > high => Err(ParameterError::Reversed { family, name, given, limits }),
                [low, high] if low < limits[0] || high > limits[1] => {
                    Err(ParameterError::OutOfLimits { family, name, given, limits })
                }
                _ => Ok(()),
            }
        })
    }

    /// The range given for `name`: low, high.
    #[must_use]
    pub fn range(&self, name: &str) -> Option<[f64; 2]> {
        self.0.get(name).map(|Range(range)| *range)
    }

    /// As [`Parameters::read`] takes them, in order of names.
    pub fn texts(&self) -> impl Iterator<Item = String> {
        self.0.iter().map(|(name, range)| format!("{name}={range}"))
    }

    /// Whether nothing is given.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

fn one(text: &str) -> Option<(&str, Range)> {
    let (name, value) = text.split_once('=')?;
    let (low, high) = value.split_once("..").unwrap_or((value, value));
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    let name = Some(name.trim()).filter(|name| !name.is_empty())?;
    Some((name, Range([number(low)?, number(high)?])))
}

/// As [`Parameters::read`] takes them, in order of names: `gap=4, traffic=0.5..1.5`.
impl fmt::Display for Parameters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().enumerate().try_for_each(|(index, (name, range))| {
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}{name}={range}")
        })
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [low, high] if low == high => write!(f, "{low}"),
            [low, high] => write!(f, "{low}..{high}"),
        }
    }
}

/// A table of numbers and pairs: `{ gap = 4.0, traffic = [0.5, 1.5] }`.
impl<'de> Deserialize<'de> for Parameters {
    fn deserialize<D: Deserializer<'de>>(source: D) -> Result<Self, D::Error> {
        BTreeMap::deserialize(source).map(Self)
    }
}

impl Serialize for Parameters {
    fn serialize<S: Serializer>(&self, target: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(target)
    }
}

impl<'de> Deserialize<'de> for Range {
    fn deserialize<D: Deserializer<'de>>(source: D) -> Result<Self, D::Error> {
        source.deserialize_any(RangeVisitor)
    }
}

impl Serialize for Range {
    fn serialize<S: Serializer>(&self, target: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            [low, high] if low == high => low.serialize(target),
            pair => pair.serialize(target),
        }
    }
}

/// Takes a number or a pair of them.
struct RangeVisitor;

impl<'de> Visitor<'de> for RangeVisitor {
    type Value = Range;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or two as in [0.5, 1.5]")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Range, E> {
        if number.is_finite() {
            Ok(Range([number; 2]))
        } else {
            Err(E::invalid_value(de::Unexpected::Float(number), &self))
        }
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<Range, E> {
        Ok(Range([number as f64; 2]))
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<Range, E> {
        Ok(Range([number as f64; 2]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut numbers: A) -> Result<Range, A::Error> {
        let mut next = |index| numbers.next_element::<f64>()?.ok_or_else(|| de::Error::invalid_length(index, &self));
        let pair = [next(0)?, next(1)?];
        if numbers.next_element::<de::IgnoredAny>()?.is_some() {
            return Err(de::Error::invalid_length(3, &self));
        }
        match pair.iter().find(|number| !number.is_finite()) {
            Some(number) => Err(de::Error::invalid_value(de::Unexpected::Float(*number), &self)),
            None => Ok(Range(pair)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generated::FAMILIES;

    const FAMILY: Family = Family {
        name: "overtaking",
        about: "",
        parameters: &[
            Parameter { name: "gap", about: "", default: [2.0, 4.0], limits: [1.0, 9.0] },
            Parameter { name: "speed", about: "", default: [8.0, 12.0], limits: [0.0, 30.0] },
        ],
        place: |draw| super::super::towns::winding(&[vec![]], super::super::towns::small(draw), draw),
        act: |_| {},
    };

    #[test]
    fn text_and_toml_say_the_same_and_what_is_shown_is_read_again() {
        let text = Parameters::read(&["speed=8..9.5", " gap = 4 "]).unwrap();
        let toml: Parameters = toml::from_str("gap = 4\nspeed = [8, 9.5]").unwrap();
        assert_eq!(text, toml);
        let shown = text.to_string();
        assert_eq!(shown, "gap=4, speed=8..9.5");
        assert_eq!(Parameters::read(&shown.split(", ").collect::<Vec<_>>()).unwrap(), text);
        assert_eq!(toml::from_str::<Parameters>(&toml::to_string(&text).unwrap()).unwrap(), text);
    }

    #[test]
    fn what_is_no_parameter_is_refused() {
        for text in ["", "gap", "gap=", "=4", "gap=four", "gap=4..", "gap=..4", "gap=nan", "gap=1..inf", "gap=1..2..3"]
        {
            assert!(matches!(Parameters::read(&[text]), Err(ParameterError::Malformed { .. })), "{text}");
        }
        for text in ["gap = nan", "gap = 'four'", "gap = [1]", "gap = [1, 2, 3]", "gap = [1, inf]", "gap = {}"] {
            assert!(toml::from_str::<Parameters>(text).is_err(), "{text}");
        }
        assert!(matches!(Parameters::read(&["gap=1", "gap=1"]), Err(ParameterError::Twice { .. })));
    }

    #[test]
    fn errors_say_names_and_limits() {
        let error = |text: &str| Parameters::read(&[text]).unwrap().check(&FAMILY).unwrap_err().to_string();
        assert!(error("gab=4").ends_with("gap, speed"), "{}", error("gab=4"));
        assert!(error("gab=4").starts_with("overtaking has no parameter gab; it has traffic, "), "{}", error("gab=4"));
        assert_eq!(error("gap=0.5..2"), "gap of overtaking is 0.5..2, but lies within 1..9");
        assert_eq!(error("gap=10"), "gap of overtaking is 10, but lies within 1..9");
        assert_eq!(error("gap=4..2"), "gap of overtaking goes from 4 down to 2; it lies within 1..9");
        assert_eq!(Parameters::read(&["gap=1..9", "speed=0"]).unwrap().check(&FAMILY), Ok(()));
    }

    #[test]
    fn each_familys_parameters_have_names_of_their_own_and_defaults_within_limits() {
        for family in FAMILIES {
            let mut names = std::collections::BTreeSet::new();
            for Parameter { name, about, default: [low, high], limits } in family.all_parameters() {
                assert!(names.insert(*name), "{}: {name} is there twice", family.name);
                let plain = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
                assert!(plain && !about.is_empty(), "{}: {name}", family.name);
                assert!(limits[0] <= *low && low <= high && *high <= limits[1], "{}: {name}", family.name);
            }
        }
    }
}
