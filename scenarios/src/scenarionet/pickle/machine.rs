//! The operations of a pickle: a stack, marks on it, and a store of values by number (the "memo").

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::class::{Class, Made, built};
use super::input::{Input, text};
use super::problem::{PickleError, PickleProblem};
use super::value::{Object, Pickle, Place, Value};
use super::{MAX_DEPTH, MAX_OBJECTS, MAX_VALUES};

impl<'a> Pickle<'a> {
    /// What is in `bytes`. Bytes behind the end of the pickle are not looked at, as Python does.
    ///
    /// # Errors
    /// [`PickleError`] for damage, for a class that no scene needs, and for what would take too much memory.
    pub fn read(bytes: &'a [u8]) -> Result<Self, PickleError> {
        let mut machine = Machine::new(bytes);
        loop {
            if let Some(root) = machine.step()? {
                return Ok(Self { root, ..machine.pickle });
            }
        }
    }
}

/// What the outermost dict of the pickle that begins with `bytes` has under the text `id`, where that is its first entry, as it is in
/// every scene seen: for that no more than the first bytes are read.
pub(crate) fn first_id(bytes: &[u8]) -> Option<String> {
    let mut machine = Machine::new(bytes);
    while machine.stack.len() < 3 {
        if machine.step().ok()?.is_some() {
            return None;
        }
    }
    match (&machine.marks[..], &machine.stack[..]) {
        ([1], [outermost, key, id]) if machine.pickle.dict(*outermost).is_some() => {
            let is_id = machine.pickle.text(*key) == Some("id");
            machine.pickle.name(*id).filter(|_| is_id).map(Cow::into_owned)
        }
        _ => None,
    }
}

struct Machine<'a> {
    input: Input<'a>,
    stack: Vec<Value<'a>>,
    /// The heights of the stack at which marks were set.
    marks: Vec<usize>,
    memo: BTreeMap<u32, Value<'a>>,
    pickle: Pickle<'a>,
    /// How many values were pushed or copied.
    values: usize,
}

type Done = Result<(), PickleProblem>;

impl<'a> Machine<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            input: Input::new(bytes),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: BTreeMap::new(),
            pickle: Pickle { objects: Vec::new(), root: Value::None },
            values: 0,
        }
    }

    /// Does one operation; at the last one answers the value that all was for.
    fn step(&mut self) -> Result<Option<Value<'a>>, PickleError> {
        let byte = self.input.at();
        let operation = |machine: &mut Self| {
            let operation = machine.input.byte()?;
            if operation == b'.' { machine.pop().map(Some) } else { machine.operate(operation).map(|()| None) }
        };
        operation(self).map_err(|problem| PickleError { byte, problem })
    }

    fn operate(&mut self, operation: u8) -> Done {
        match operation {
            0x80 => match self.input.byte()? {
                0..=5 => Ok(()),
                protocol => Err(PickleProblem::Protocol(protocol)),
            },
            0x95 => self.input.take(8).map(|_| ()), // how long the next part is: nothing hangs on it
            b'(' => self.mark(),
            b'0' => self.pop().map(|_| ()),
            b'1' => self.above_mark().map(|_| ()),
            b'2' => {
                let top = *self.stack.last().ok_or(PickleProblem::NoValue)?;
                self.push(top)
            }
            b'N' | 0x88 | 0x89 | b'I' | b'J' | b'K' | b'L' | b'M' | 0x8a | 0x8b | b'F' | b'G' => {
                let number = self.number(operation)?;
                self.push(number)
            }
            b'S' | b'T' | b'U' | b'V' | b'X' | 0x8c | 0x8d => self.text(operation),
            b'B' | b'C' | 0x8e | 0x96 => {
                let length = match operation {
                    b'B' => 4,
                    b'C' => 1,
                    _ => 8,
                };
                let bytes = self.input.counted(length)?;
                self.push(Value::Bytes(bytes))
            }
            b']' | b'l' | b')' | b't' | 0x85..=0x87 | b'}' | b'd' | 0x8f | 0x91 => self.container(operation),
            b'a' | b'e' | 0x90 => self.append(operation),
            b's' | b'u' => self.set_items(operation),
            b'p' | b'q' | b'r' | 0x94 => self.store(operation),
            b'g' | b'h' | b'j' => self.recall(operation),
            b'c' | 0x93 => self.class(operation),
            b'R' | 0x81 => self.call(operation),
            b'b' => self.build(),
            b'P' | b'Q' => Err(PickleProblem::Unwanted("references to what is kept elsewhere")),
            0x82..=0x84 => Err(PickleProblem::Unwanted("classes by registered numbers")),
            0x97 | 0x98 => Err(PickleProblem::Unwanted("buffers that are kept elsewhere")),
            b'i' | b'o' | 0x92 => Err(PickleProblem::Unwanted("objects of classes of its own")),
            other => Err(PickleProblem::Operation(other)),
        }
    }

    fn push(&mut self, value: Value<'a>) -> Done {
        self.spend(1)?;
        self.stack.push(value);
        Ok(())
    }

    fn spend(&mut self, values: usize) -> Done {
        self.values = self.values.saturating_add(values);
        if self.values > MAX_VALUES { Err(PickleProblem::TooManyValues) } else { Ok(()) }
    }

    fn push_object(&mut self, object: Object<'a>) -> Done {
        let place = self.pickle.objects.len();
        if place >= MAX_OBJECTS {
            return Err(PickleProblem::TooManyObjects);
        }
        self.pickle.objects.push(object);
        self.push(Value::Object(Place(place as u32)))
    }

    /// The topmost value; those below the last mark are out of reach.
    fn pop(&mut self) -> Result<Value<'a>, PickleProblem> {
        if self.marks.last().is_some_and(|mark| *mark >= self.stack.len()) {
            return Err(PickleProblem::NoValue);
        }
        self.stack.pop().ok_or(PickleProblem::NoValue)
    }

    fn mark(&mut self) -> Done {
        if self.marks.len() >= MAX_DEPTH {
            return Err(PickleProblem::TooDeep);
        }
        self.marks.push(self.stack.len());
        Ok(())
    }

    /// What lies above the last mark, which is taken away.
    fn above_mark(&mut self) -> Result<Vec<Value<'a>>, PickleProblem> {
        let mark = self.marks.pop().ok_or(PickleProblem::NoMark)?;
        Ok(self.stack.split_off(mark.min(self.stack.len())))
    }

    fn number(&mut self, operation: u8) -> Result<Value<'a>, PickleProblem> {
        Ok(match operation {
            b'N' => Value::None,
            0x88 => Value::Bool(true),
            0x89 => Value::Bool(false),
            b'J' => Value::Int(i64::from(i32::from_le_bytes(self.input.array()?))),
            b'K' => Value::Int(i64::from(self.input.byte()?)),
            b'M' => Value::Int(i64::from(self.input.two()?)),
            b'G' => Value::Float(f64::from_be_bytes(self.input.array()?)),
            b'F' => Value::Float(parsed(text(self.input.line()?)?)?),
            b'I' => match self.input.line()? {
                b"00" => Value::Bool(false),
                b"01" => Value::Bool(true),
                line => Value::Int(parsed(text(line)?)?),
            },
            b'L' => Value::Int(parsed(text(self.input.line()?)?.trim_end_matches('L'))?),
            0x8a => Value::Int(long(self.input.counted(1)?)?),
            _ => Value::Int(long(self.input.counted(4)?)?),
        })
    }

    fn text(&mut self, operation: u8) -> Done {
        let bytes = match operation {
            b'S' | b'V' => self.input.line()?,
            b'U' | 0x8c => self.input.counted(1)?,
            0x8d => self.input.counted(8)?,
            _ => self.input.counted(4)?,
        };
        match operation {
            // Escapes are those of Python's source. They are met with in names of things alone, and not there.
            b'S' => {
                let quoted = text(bytes)?.trim();
                let inner = quoted.strip_prefix(['\'', '"']).and_then(|rest| rest.strip_suffix(['\'', '"']));
                self.push(Value::Text(inner.filter(|inner| !inner.contains('\\')).ok_or(PickleProblem::Text)?))
            }
            b'V' if !bytes.is_ascii() || bytes.contains(&b'\\') => {
                self.spend(bytes.len() / size_of::<Value<'_>>())?;
                self.push_object(Object::Text(unescaped(bytes)?))
            }
            // Python 2's texts are bytes: they may be either.
            b'T' | b'U' => match std::str::from_utf8(bytes) {
                Ok(text) => self.push(Value::Text(text)),
                Err(_) => self.push(Value::Bytes(bytes)),
            },
            _ => self.push(Value::Text(text(bytes)?)),
        }
    }

    fn container(&mut self, operation: u8) -> Done {
        let object = match operation {
            b']' => Object::List(Vec::new()),
            b'l' => Object::List(self.above_mark()?),
            b')' => Object::Tuple(Vec::new()),
            b't' => Object::Tuple(self.above_mark()?),
            b'}' => Object::Dict(Vec::new()),
            b'd' => Object::Dict(pairs(&self.above_mark()?)?),
            0x8f => Object::Set(Vec::new()),
            0x91 => Object::Set(self.above_mark()?),
            _ => {
                let mut items = Vec::with_capacity(3);
                for _ in 0x85..=operation {
                    items.push(self.pop()?);
                }
                items.reverse();
                Object::Tuple(items)
            }
        };
        self.push_object(object)
    }

    fn top(&mut self) -> Result<&mut Object<'a>, PickleProblem> {
        match self.stack.last() {
            Some(Value::Object(place)) => self.pickle.objects.get_mut(place.0 as usize).ok_or(PickleProblem::NoValue),
            Some(_) => Err(PickleProblem::NoContainer("container")),
            None => Err(PickleProblem::NoValue),
        }
    }

    fn append(&mut self, operation: u8) -> Done {
        let items = if operation == b'a' { vec![self.pop()?] } else { self.above_mark()? };
        match (operation, self.top()?) {
            (b'a' | b'e', Object::List(list)) => list.extend(items),
            (0x90, Object::Set(set)) => set.extend(items),
            (0x90, _) => return Err(PickleProblem::NoContainer("set")),
            _ => return Err(PickleProblem::NoContainer("list")),
        }
        Ok(())
    }

    fn set_items(&mut self, operation: u8) -> Done {
        let items = if operation == b's' {
            let value = self.pop()?;
            vec![self.pop()?, value]
        } else {
            self.above_mark()?
        };
        let pairs = pairs(&items)?;
        match self.top()? {
            Object::Dict(dict) => dict.extend(pairs),
            _ => return Err(PickleProblem::NoContainer("dict")),
        }
        Ok(())
    }

    fn store(&mut self, operation: u8) -> Done {
        let number = match operation {
            b'p' => parsed(text(self.input.line()?)?)?,
            b'q' => u32::from(self.input.byte()?),
            b'r' => self.input.four()?,
            _ => self.memo.len() as u32, // at most MAX_VALUES
        };
        let top = *self.stack.last().ok_or(PickleProblem::NoValue)?;
        self.spend(1)?;
        self.memo.insert(number, top);
        Ok(())
    }

    fn recall(&mut self, operation: u8) -> Done {
        let number = match operation {
            b'g' => parsed(text(self.input.line()?)?)?,
            b'h' => u32::from(self.input.byte()?),
            _ => self.input.four()?,
        };
        let value = *self.memo.get(&number).ok_or(PickleProblem::Memo(number))?;
        self.push(value)
    }

    fn class(&mut self, operation: u8) -> Done {
        let (module, name) = if operation == b'c' {
            (text(self.input.line()?)?.to_owned(), text(self.input.line()?)?.to_owned())
        } else {
            let (name, module) = (self.pop()?, self.pop()?);
            let owned = |value| self.pickle.text(value).map(str::to_owned).ok_or(PickleProblem::NoClass);
            (owned(module)?, owned(name)?)
        };
        let class = Class::named(&module, &name).ok_or_else(|| {
            let short = |text: &str| text.chars().take(100).collect();
            PickleProblem::Refused { module: short(&module), name: short(&name) }
        })?;
        self.push(Value::Class(class))
    }

    fn call(&mut self, operation: u8) -> Done {
        let (arguments, class) = (self.pop()?, self.pop()?);
        let Value::Class(class) = class else { return Err(PickleProblem::NoClass) };
        let arguments = self.pickle.items(arguments).ok_or(PickleProblem::NoClass)?;
        if operation == 0x81 {
            let object = class.new_object(arguments)?;
            return self.push_object(object);
        }
        // What is copied out of an argument counts: one may be copied often. An array's bytes stay where they are.
        let content = |value: &Value<'a>| {
            let (items, pairs) = (self.pickle.items(*value), self.pickle.dict(*value));
            let bytes = self.pickle.bytes(*value).or_else(|| self.pickle.text(*value).map(str::as_bytes));
            let bytes = bytes.filter(|_| class != Class::FromBuffer).map_or(0, <[u8]>::len);
            items.map_or(0, <[_]>::len) + 2 * pairs.map_or(0, <[_]>::len) + bytes / size_of::<Value<'_>>()
        };
        let copied = arguments.iter().map(content).sum();
        let made = class.call(arguments, &self.pickle)?;
        self.spend(copied)?;
        match made {
            Made::Object(object) => self.push_object(object),
            Made::Value(value) => self.push(value),
        }
    }

    fn build(&mut self) -> Done {
        let state = self.pop()?;
        let Some(Value::Object(place)) = self.stack.last() else { return Err(PickleProblem::NoClass) };
        let place = place.0 as usize;
        let object = self.pickle.objects.get(place).ok_or(PickleProblem::NoValue)?;
        if let Some(object) = built(object, state, &self.pickle)? {
            self.pickle.objects[place] = object;
        }
        Ok(())
    }
}

fn pairs<'a>(items: &[Value<'a>]) -> Result<Vec<(Value<'a>, Value<'a>)>, PickleProblem> {
    let (pairs, rest) = items.as_chunks::<2>();
    if rest.is_empty() {
        Ok(pairs.iter().map(|[key, value]| (*key, *value)).collect())
    } else {
        Err(PickleProblem::NoValue)
    }
}

fn parsed<T: std::str::FromStr>(text: &str) -> Result<T, PickleProblem> {
    text.trim().parse().map_err(|_| PickleProblem::Text)
}

/// An integer of any number of bytes, little endian, negative if its highest bit is set.
fn long(bytes: &[u8]) -> Result<i64, PickleProblem> {
    if bytes.len() > 8 {
        // One more byte than needed holds the sign alone, as Python writes 2^63.
        return Err(PickleProblem::LargeInteger);
    }
    let fill = if bytes.last().is_some_and(|byte| byte & 0x80 != 0) { 0xff } else { 0 };
    let mut all = [fill; 8];
    all[..bytes.len()].copy_from_slice(bytes);
    Ok(i64::from_le_bytes(all))
}

/// A text of protocol 0: Latin-1, with other characters as `\u1234` or `\U00012345`.
fn unescaped(bytes: &[u8]) -> Result<String, PickleProblem> {
    let mut rest = bytes;
    let mut out = String::with_capacity(bytes.len());
    while let [first, after @ ..] = rest {
        rest = after;
        let digits = match (first, after) {
            (b'\\', [b'u', ..]) => 4,
            (b'\\', [b'U', ..]) => 8,
            _ => {
                out.push(char::from(*first));
                continue;
            }
        };
        let hex = after.get(1..=digits).and_then(|hex| std::str::from_utf8(hex).ok());
        let number = hex.and_then(|hex| u32::from_str_radix(hex, 16).ok());
        out.push(number.and_then(char::from_u32).ok_or(PickleProblem::Text)?);
        rest = &after[1 + digits..];
    }
    Ok(out)
}
