//! What the derives call to declare variables; not needed in a model file.

use crate::block::{Block, Field, Mode, ParameterReader, Parameters, StartValues};
use crate::scalar::Scalar;
use crate::signal::{LEAST_POSITIVE, Quantity, Range, Signal};
use crate::unit::Unit;
use crate::variable::{Declaration, Kind, Real};

/// A real variable, or a family of them, under construction.
#[derive(Debug)]
pub struct Spec {
    name: &'static str,
    description: &'static str,
    doc: &'static str,
    unit: Unit,
    display: Option<&'static str>,
    start: Start,
    min: Option<f64>,
    max: Option<f64>,
    nominal: Option<f64>,
    tunable: bool,
    local: bool,
}

#[derive(Debug)]
enum Start {
    All(f64),
    Each(Vec<f64>),
}

impl Spec {
    fn new(name: &'static str, description: &'static str, unit: Unit, display: Option<&'static str>) -> Self {
        Self {
            name,
            description,
            doc: "",
            unit,
            display,
            start: Start::All(0.0),
            min: None,
            max: None,
            nominal: None,
            tunable: false,
            local: false,
        }
    }
    /// A variable with a name of its own.
    pub fn named(name: &'static str, unit: Unit) -> Self {
        Self::new(name, "", unit, None)
    }
    /// A parameter of a catalogue.
    pub fn quantity(entry: &Quantity) -> Self {
        let spec = Self::new(entry.name, entry.description, entry.unit, entry.display);
        match entry.range {
            Range::Any => spec,
            Range::NonNegative => spec.min(0.0),
            Range::Positive => spec.positive(),
            Range::AtLeast(min) => spec.min(min),
        }
    }
    /// A signal of a catalogue.
    pub fn signal(entry: &Signal) -> Self {
        Self::new(entry.name, entry.description, entry.unit, entry.display).nominal(entry.nominal)
    }
    /// The doc comment.
    pub fn doc(self, doc: &'static str) -> Self {
        Self { doc, ..self }
    }
    /// One start value, or one per place.
    pub fn start(self, start: impl StartValues) -> Self {
        let start = start.start_values();
        Self { start: if let [one] = start[..] { Start::All(one) } else { Start::Each(start) }, ..self }
    }
    /// Least value.
    pub fn min(self, min: f64) -> Self {
        Self { min: Some(min), ..self }
    }
    /// Greatest value.
    pub fn max(self, max: f64) -> Self {
        Self { max: Some(max), ..self }
    }
    /// Usual magnitude.
    pub fn nominal(self, nominal: f64) -> Self {
        Self { nominal: Some(nominal), ..self }
    }
    /// Unit to display in.
    pub fn display(self, display: &'static str) -> Self {
        Self { display: Some(display), ..self }
    }
    /// More than zero. A greater least value stays.
    pub fn positive(self) -> Self {
        Self { min: Some(self.min.map_or(LEAST_POSITIVE, |min| min.max(LEAST_POSITIVE))), ..self }
    }
    /// May change between steps.
    pub fn tunable(self) -> Self {
        Self { tunable: true, ..self }
    }
    /// Not meant for other units.
    pub fn local(self) -> Self {
        Self { local: true, ..self }
    }

    /// Declares one variable per place of the field `F`.
    ///
    /// # Panics
    /// When there are several start values but not one per place.
    pub fn declare<T, F: Field<T>>(self, all: &mut Vec<Declaration>) {
        let places = F::places();
        if let Start::Each(values) = &self.start {
            assert_eq!(values.len(), places.len(), "'{}' needs one start value, or one per place", self.name);
        }
        for (i, (suffix, words)) in places.into_iter().enumerate() {
            let description = match (self.description, self.doc) {
                ("", doc) => doc.to_owned(),
                (description, "") => description.to_owned(),
                (description, doc) => format!("{description}; {doc}"),
            };
            let description = if words.is_empty() || description.contains("{}") {
                description.replace("{}", &words)
            } else {
                format!("{description}, {words}")
            };
            all.push(Declaration {
                name: if suffix.is_empty() { self.name.to_owned() } else { format!("{}.{suffix}", self.name) },
                description,
                tunable: self.tunable,
                local: self.local,
                calculated: false,
                kind: Kind::Real(Real {
                    unit: self.unit,
                    display: self.display,
                    start: match &self.start {
                        Start::All(value) => *value,
                        Start::Each(values) => values[i],
                    },
                    min: self.min,
                    max: self.max,
                    nominal: self.nominal,
                }),
            });
        }
    }
}

/// Declares a parameter that is not a real number.
pub fn other(all: &mut Vec<Declaration>, name: &str, description: &str, tunable: bool, kind: Kind) {
    let mut description = description.to_owned();
    if let Kind::Integer { choices, .. } = &kind
        && !choices.is_empty()
    {
        let values: Vec<_> = choices.iter().map(|c| format!("{} {}", c.value, c.name)).collect();
        description = format!("{description} ({})", values.join(", "));
    }
    all.push(Declaration { name: name.to_owned(), description, tunable, local: false, calculated: false, kind });
}

/// The kind of a mode.
pub fn mode<M: Mode>(start: M) -> Kind {
    let (first, last) = (M::CHOICES.first(), M::CHOICES.last());
    Kind::Integer {
        start: start.value(),
        min: first.map_or(0, |choice| choice.value),
        max: last.map_or(0, |choice| choice.value),
        type_name: M::NAME,
        choices: M::CHOICES,
    }
}

/// The parameters with their start values.
pub fn start_parameters<P: Parameters>() -> P {
    let (mut reals, mut integers, mut booleans, mut strings) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for declaration in P::declare() {
        match declaration.kind {
            Kind::Real(real) => reals.push(real.start),
            Kind::Integer { start, .. } => integers.push(start),
            Kind::Boolean { start } => booleans.push(start),
            Kind::String { start } => strings.push(start),
        }
    }
    P::read(&mut ParameterReader::new(&reals, &integers, &booleans, &strings))
}

/// A block with its start values.
pub fn start_block<T: Scalar, B: Block<T>>() -> B {
    let starts: Vec<_> = B::declare()
        .into_iter()
        .map(|declaration| match declaration.kind {
            Kind::Real(real) => T::from(real.start),
            _ => unreachable!("blocks hold real numbers"),
        })
        .collect();
    B::read(&starts)
}
