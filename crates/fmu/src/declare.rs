//! Functions that code from the derive macros calls to declare variables; model files do not need them.

use crate::definition::{Definition, LEAST_POSITIVE, Range};
use crate::enumeration::Enumeration;
use crate::number::{Number, Size};
use crate::unit::{DisplayUnit, Unit};
use crate::variable::{Alias, ArrayElement, Declaration, Details, Kind, Real, Terminal};

/// One element of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Element {
    /// Part of the name of the variable after the dot, for example `fl`.
    pub name: &'static str,
    /// Text for descriptions, for example `front left wheel`.
    pub description: &'static str,
}

/// A variable, or an array of variables, under construction.
#[derive(Clone, Debug, Default)]
pub struct Spec {
    pub(crate) name: String,
    pub(crate) description: &'static str,
    /// The doc comment.
    pub doc: &'static str,
    /// Description of the element of an array.
    pub(crate) words: String,
    /// Unit of measure, or one per element.
    pub units: Units,
    /// Display unit.
    pub display: Option<DisplayUnit>,
    /// Name of one of the unit's display units.
    pub display_name: Option<&'static str>,
    /// Least value.
    pub min: Option<f64>,
    /// Greatest value.
    pub max: Option<f64>,
    /// Least value of an integer.
    pub whole_min: Option<i128>,
    /// Greatest value of an integer.
    pub whole_max: Option<i128>,
    /// Usual magnitude.
    pub nominal: Option<f64>,
    /// Names of the elements of an array.
    pub elements: &'static [&'static str],
    /// Descriptions of the elements of an array.
    pub descriptions: &'static [&'static str],
    /// May change between steps.
    pub tunable: bool,
    /// Not an output.
    pub local: bool,
    /// The start value follows from the parameters.
    pub calculated: bool,
    /// An FMI Enumeration.
    pub enumeration: bool,
    /// Type of the data of a Binary.
    pub mime: &'static str,
    /// Other names.
    pub aliases: Vec<Alias>,
    /// Attributes that few variables have.
    pub details: Details,
    pub(crate) array: Option<ArrayElement>,
}

/// Units of an array: none, one for all elements, or one for each.
#[derive(Clone, Debug, Default)]
pub struct Units(Vec<Unit>);

impl From<Unit> for Units {
    fn from(unit: Unit) -> Self {
        Self(vec![unit])
    }
}

impl<const N: usize> From<[Unit; N]> for Units {
    fn from(units: [Unit; N]) -> Self {
        Self(units.to_vec())
    }
}

impl Spec {
    /// A variable with this name.
    pub fn named(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }
    /// A variable with the name and attributes of a definition.
    pub fn defined(definition: &Definition) -> Self {
        let mut spec = Self {
            description: definition.description,
            units: definition.unit.into(),
            display_name: definition.display,
            nominal: definition.nominal,
            ..Self::named(definition.name)
        };
        match definition.range {
            Range::Any => {}
            Range::NonNegative => spec.min = Some(0.0),
            Range::Positive => spec.make_positive(),
            Range::AtLeast(min) => spec.min = Some(min),
        }
        spec
    }
    /// Requires values above zero. A greater minimum is kept.
    pub fn make_positive(&mut self) {
        self.min = Some(self.min.map_or(LEAST_POSITIVE, |min| min.max(LEAST_POSITIVE)));
    }

    /// An element of an array with named elements.
    pub fn element(&self, index: usize, element: &Element) -> Self {
        self.part(index, &format!(".{}", element.name), element.description, element.name)
    }

    /// An element of an array `[T; N]`. In names, indices start at 1: `x[1]`, `x[1,2]`.
    pub fn indexed(&self, index: usize) -> Self {
        if let Some(name) = self.elements.get(index) {
            return self.part(index, &format!(".{name}"), name, name);
        }
        let number = (index + 1).to_string();
        let part = self.part(index, "", &format!("element {number}"), "");
        let name = match part.name.strip_suffix(']') {
            Some(outer) => format!("{outer},{number}]"),
            None => format!("{}[{number}]", part.name),
        };
        Self { name, ..part }
    }

    fn part(&self, index: usize, suffix: &str, words: &str, element: &str) -> Self {
        let mut part = self.clone();
        let array = part.array.get_or_insert_with(|| ArrayElement {
            name: self.name.clone(),
            description: self.text().replace("{}", "elements"),
            element: String::new(),
            dimensions: Vec::new(),
        });
        if array.element.is_empty() {
            element.clone_into(&mut array.element);
        }
        part.name.push_str(suffix);
        part.words = if self.words.is_empty() { words.to_owned() } else { format!("{}, {words}", self.words) };
        if let Some(description) = self.descriptions.get(index) {
            (part.doc, part.description, part.words) = (description, "", String::new());
        }
        if let Some(unit) = self.units.0.get(index).filter(|_| self.units.0.len() > 1) {
            part.units = Units(vec![*unit]);
        }
        (part.elements, part.descriptions) = (&[], &[]);
        part
    }

    fn text(&self) -> String {
        let text = match (self.description, self.doc) {
            ("", doc) => doc.to_owned(),
            (description, "") => description.to_owned(),
            (description, doc) => format!("{description}; {doc}"),
        };
        if self.words.is_empty() || text.contains("{}") {
            text.replace("{}", &self.words)
        } else {
            format!("{text}, {}", self.words)
        }
    }

    fn add(&self, description: String, kind: Kind, all: &mut Vec<Declaration>) {
        let mut aliases = self.aliases.clone();
        for alias in &mut aliases {
            if alias.description.is_empty() {
                alias.description.clone_from(&description);
            }
            if let Some(display) = alias.display.as_mut().filter(|display| display.factor.is_nan()) {
                *display = display_unit(display.name, self.unit());
            }
        }
        all.push(Declaration {
            name: self.name.clone(),
            description,
            tunable: self.tunable,
            local: self.local,
            calculated: self.calculated,
            kind,
            array: self.array.clone(),
            aliases,
            terminals: Vec::new(),
            details: self.details,
        });
    }

    fn unit(&self) -> Unit {
        self.units.0.first().copied().unwrap_or(Unit::NONE)
    }

    pub(crate) fn declare_real(&self, start: Option<f64>, all: &mut Vec<Declaration>) {
        self.add(self.text(), Kind::Real(self.real(start)), all);
    }

    pub(crate) fn declare_float32(&self, start: Option<f32>, all: &mut Vec<Declaration>) {
        let mut real = self.real(start.map(f64::from));
        for limit in [&mut real.min, &mut real.max] {
            *limit = limit.map(|limit| f64::from(limit as f32));
        }
        self.add(self.text(), Kind::Float32(real), all);
    }

    fn real(&self, start: Option<f64>) -> Real {
        let unit = self.unit();
        let display = self.display.or_else(|| self.display_name.map(|name| display_unit(name, unit)));
        Real { unit, display, start: start.unwrap_or(0.0), min: self.min, max: self.max, nominal: self.nominal }
    }

    pub(crate) fn declare_integer(&self, size: Size, start: Option<i128>, all: &mut Vec<Declaration>) {
        let range = size.range();
        let kind = Kind::Integer {
            size,
            start: start.unwrap_or(0),
            min: self.whole_min.or(self.min.map(|min| min.ceil() as i128)).unwrap_or(*range.start()),
            max: self.whole_max.or(self.max.map(|max| max.floor() as i128)).unwrap_or(*range.end()),
            type_name: "",
            items: &[],
            is_enumeration: false,
        };
        self.add(self.text(), kind, all);
    }

    #[doc(hidden)]
    pub fn declare_enumeration<E: Enumeration>(&self, start: Option<E>, all: &mut Vec<Declaration>) {
        let values: Vec<_> = E::ITEMS.iter().map(|item| format!("{} {}", item.value, item.name)).collect();
        let description =
            if self.enumeration { self.text() } else { format!("{} ({})", self.text(), values.join(", ")) };
        let kind = Kind::Integer {
            size: E::SIZE,
            start: start.unwrap_or_else(E::first).value().into(),
            min: E::ITEMS.first().map_or(0, |item| item.value.into()),
            max: E::ITEMS.last().map_or(0, |item| item.value.into()),
            type_name: E::NAME,
            items: E::ITEMS,
            is_enumeration: self.enumeration,
        };
        self.add(description, kind, all);
    }

    pub(crate) fn declare_boolean(&self, start: Option<bool>, all: &mut Vec<Declaration>) {
        self.add(self.text(), Kind::Boolean { start: start.unwrap_or(false) }, all);
    }

    pub(crate) fn declare_clock(&self, all: &mut Vec<Declaration>) {
        self.add(self.text(), Kind::Clock(None), all);
    }

    pub(crate) fn declare_string(&self, start: Option<&'static str>, all: &mut Vec<Declaration>) {
        self.add(self.text(), Kind::String { start: start.unwrap_or("").to_owned() }, all);
    }

    pub(crate) fn declare_binary(&self, most: usize, start: Option<Vec<u8>>, all: &mut Vec<Declaration>) {
        let kind = Kind::Binary { start: start.unwrap_or_default(), most, mime: self.mime };
        self.add(self.text(), kind, all);
    }
}

/// A display unit that is given by its name only: its factor is not a number.
pub const fn named_display_unit(name: &'static str) -> DisplayUnit {
    DisplayUnit { name, factor: f64::NAN, offset: 0.0 }
}

/// The display unit with this name. An unknown name is reported when the description is generated.
fn display_unit(name: &'static str, unit: Unit) -> DisplayUnit {
    unit.display_unit(name).unwrap_or(named_display_unit(name))
}

/// Converts a start value to the type of the variable.
pub fn start<S>(start: impl Into<S>) -> S {
    start.into()
}

/// A number as the start value of a variable of type `S`.
#[doc(hidden)]
#[diagnostic::on_unimplemented(
    message = "a number is not a start value for a variable of type `{S}`",
    label = "expected a value of type `{S}`"
)]
pub trait NumberFor<S> {
    /// The start value.
    fn start_value(self) -> S;
}

impl NumberFor<f64> for i32 {
    fn start_value(self) -> f64 {
        self.into()
    }
}

impl NumberFor<f32> for i32 {
    fn start_value(self) -> f32 {
        self as f32
    }
}

macro_rules! number_for_itself {
    ($($type:ty)*) => {$(
        impl NumberFor<$type> for $type {
            fn start_value(self) -> $type {
                self
            }
        }
    )*};
}
number_for_itself! { f64 f32 i8 u8 i16 u16 i32 u32 i64 u64 }

/// Converts a literal number to the start value of an enumeration or of a type alias.
pub fn number<S>(start: impl NumberFor<S>) -> S {
    start.start_value()
}

/// Converts a limit to `f64`.
pub fn limit(limit: impl Into<f64>) -> f64 {
    limit.into()
}

/// Converts a limit of an integer variable of type `V`.
pub fn whole_limit<V: Number + Into<i128>>(limit: V) -> i128 {
    limit.into()
}

/// Declares the variables of a nested struct; their names start with the prefix.
pub fn nested(prefix: &str, declare: fn(&mut Vec<Declaration>), all: &mut Vec<Declaration>) {
    let first = all.len();
    declare(all);
    if !prefix.is_empty() {
        self::prefix(prefix, &mut all[first..]);
    }
}

/// Lets the names of variables start with a prefix.
pub(crate) fn prefix(prefix: &str, declarations: &mut [Declaration]) {
    for declaration in declarations {
        declaration.name = format!("{prefix}.{}", declaration.name);
        for alias in &mut declaration.aliases {
            alias.name = format!("{prefix}.{}", alias.name);
        }
        if let Some(array) = &mut declaration.array {
            array.name = format!("{prefix}.{}", array.name);
        }
        declaration.terminals.iter_mut().for_each(|terminal| terminal.member += prefix.len() + 1);
    }
}

/// Declares the variables of a nested struct, which are the members of a terminal.
pub fn terminal(terminal: Terminal, prefix: &str, declare: fn(&mut Vec<Declaration>), all: &mut Vec<Declaration>) {
    let first = all.len();
    nested(prefix, declare, all);
    let member = if prefix.is_empty() { 0 } else { prefix.len() + 1 };
    for declaration in &mut all[first..] {
        declaration.terminals.insert(0, Terminal { member, ..terminal });
    }
}

/// The name of a field, used at compile time to find names that occur in two structs.
#[derive(Clone, Copy, Debug)]
pub struct Name {
    text: &'static str,
    /// [`hash`] of the text.
    hash: u64,
    /// [`Self::BASE`] to the power of the length. The hash of a prefix times this, plus `hash`, is the hash of the
    /// prefix followed by the text.
    power: u64,
    is_array: bool,
    /// Names of a nested struct.
    fields: Option<&'static [Self]>,
}

impl Name {
    const BASE: u64 = 0x9e37_79b9_7f4a_7c15;

    /// A variable, or an array of variables.
    pub const fn of(text: &'static str, is_array: bool) -> Self {
        let (mut power, mut i) = (1_u64, 0);
        while i < text.len() {
            power = power.wrapping_mul(Self::BASE);
            i += 1;
        }
        Self { text, hash: hash(text), power, is_array, fields: None }
    }

    /// A nested struct; the prefix may be empty.
    pub const fn nested(prefix: &'static str, fields: &'static [Self]) -> Self {
        Self { fields: Some(fields), ..Self::of(prefix, false) }
    }

    /// The hash of a prefix followed by this text; `prefix` is the hash of the prefix.
    const fn behind(&self, prefix: u64) -> u64 {
        prefix.wrapping_mul(self.power).wrapping_add(self.hash)
    }

    /// The hash of the prefix of the names in this nested struct; `outer` is the hash of the prefix of the struct
    /// itself.
    const fn prefix(&self, outer: u64) -> u64 {
        match self.text.len() {
            0 => outer,
            _ => Self::of(".", false).behind(self.behind(outer)),
        }
    }
}

/// Polynomial hash of the bytes of a text, modulo 2^64.
pub const fn hash(name: &str) -> u64 {
    let (mut hash, mut i) = (0_u64, 0);
    while i < name.len() {
        hash = hash.wrapping_mul(Name::BASE).wrapping_add(name.as_bytes()[i] as u64 + 1);
        i += 1;
    }
    hash
}

/// A text built at compile time.
pub struct Text {
    bytes: [u8; 256],
    length: usize,
}

impl Text {
    const fn new() -> Self {
        Self { bytes: [0; 256], length: 0 }
    }

    const fn push(mut self, text: &str) -> Self {
        let mut i = 0;
        while i < text.len() && self.length < self.bytes.len() {
            self.bytes[self.length] = text.as_bytes()[i];
            self.length += 1;
            i += 1;
        }
        self
    }

    /// The text.
    pub const fn as_str(&self) -> &str {
        match std::str::from_utf8(self.bytes.split_at(self.length).0) {
            Ok(text) => text,
            // The text was too long and was cut within a character.
            Err(_) => "two variables have the same name",
        }
    }
}

/// Returns an error message if a name occurs twice in `names`, or also in an earlier struct.
pub const fn shared_name(earlier: &[&[Name]], names: &[Name]) -> Option<Text> {
    shared(earlier, names, names, 0, &[])
}

const fn shared(earlier: &[&[Name]], whole: &[Name], names: &[Name], prefix: u64, outer: &[&str]) -> Option<Text> {
    let mut i = 0;
    while i < names.len() {
        let name = &names[i];
        match name.fields {
            Some(fields) => {
                // In nested structs, the message contains only the last prefix.
                let found = shared(earlier, whole, fields, name.prefix(prefix), &[name.text]);
                if found.is_some() {
                    return found;
                }
            }
            None => {
                let hash = name.behind(prefix);
                let mut count = occurrences(whole, 0, hash, name.is_array) - 1;
                let mut k = 0;
                while k < earlier.len() {
                    count += occurrences(earlier[k], 0, hash, name.is_array);
                    k += 1;
                }
                if count > 0 {
                    let mut text = Text::new().push("two variables of the model are named `");
                    if let [outer] = outer
                        && !outer.is_empty()
                    {
                        text = text.push(outer).push(".");
                    }
                    return Some(
                        text.push(name.text).push("`: give one of them another name, as in `#[var(\"other_name\")]`"),
                    );
                }
            }
        }
        i += 1;
    }
    None
}

const fn occurrences(names: &[Name], prefix: u64, hash: u64, is_array: bool) -> usize {
    let (mut count, mut i) = (0, 0);
    while i < names.len() {
        let name = &names[i];
        match name.fields {
            Some(fields) => count += occurrences(fields, name.prefix(prefix), hash, is_array),
            None if name.behind(prefix) == hash && name.is_array == is_array => count += 1,
            None => {}
        }
        i += 1;
    }
    count
}
