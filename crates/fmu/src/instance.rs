//! One instance of an FMU, in safe Rust: modes, values, time, state. The C interface calls nothing else.

use std::ffi::{CStr, CString};
use std::path::PathBuf;
use std::sync::Arc;

use crate::calls::{Function, Mode};
use crate::clock::{self, Clock};
use crate::description::Description;
use crate::runner::{Kind as ModelKind, MOST_PARTS, Model, Step, StepError, are_finite};
use crate::variable::{Kind, Layout, Role, Variable};
use crate::variables::{Counts, Derived as _, Values, ValuesMut, Variables as _};

/// Why a call was not carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CallError {
    /// fmi2Error: what, where and the rule.
    Error(String),
    /// fmi2Discard: there is no such information.
    Discard(String),
}

impl From<String> for CallError {
    fn from(message: String) -> Self {
        Self::Error(message)
    }
}

/// What a call returns.
type CallResult<T = ()> = Result<T, CallError>;

/// The values of all variables, by type.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueStore {
    /// Reals.
    pub reals: Box<[f64]>,
    /// Integers and enumerations.
    pub integers: Box<[i32]>,
    /// Booleans.
    pub booleans: Box<[bool]>,
    /// Strings.
    pub strings: Box<[String]>,
}

impl ValueStore {
    /// The start values.
    #[must_use]
    pub fn start(layout: &Layout) -> Self {
        let mut reals = vec![0.0; layout.reals()];
        let (mut integers, mut booleans, mut strings) = (Vec::new(), Vec::new(), Vec::new());
        for variable in &layout.variables {
            match &variable.declaration.kind {
                Kind::Real(real) => reals[variable.index] = real.start,
                Kind::Integer { start, .. } => integers.push(*start),
                Kind::Boolean { start } => booleans.push(*start),
                Kind::String { start } => strings.push(start.clone()),
            }
        }
        Self { reals: reals.into(), integers: integers.into(), booleans: booleans.into(), strings: strings.into() }
    }

    /// To read from.
    #[inline]
    #[must_use]
    pub fn view(&self) -> Values<'_, f64> {
        Values { reals: &self.reals, integers: &self.integers, booleans: &self.booleans, strings: &self.strings }
    }

    /// To write to.
    #[inline]
    pub fn view_mut(&mut self) -> ValuesMut<'_, f64> {
        ValuesMut {
            reals: &mut self.reals,
            integers: &mut self.integers,
            booleans: &mut self.booleans,
            strings: &mut self.strings,
        }
    }

    /// All but the reals, for equations of another number type.
    pub(crate) fn others<T>(&self) -> Values<'_, T> {
        Values { reals: &[], integers: &self.integers, booleans: &self.booleans, strings: &self.strings }
    }

    /// Whether a variable has another value there.
    pub(crate) fn differs(&self, other: &Self, variable: &Variable) -> bool {
        let index = variable.index;
        match variable.declaration.kind {
            Kind::Real(_) => self.reals[index] != other.reals[index],
            Kind::Integer { .. } => self.integers[index] != other.integers[index],
            Kind::Boolean { .. } => self.booleans[index] != other.booleans[index],
            Kind::String { .. } => self.strings[index] != other.strings[index],
        }
    }

    pub(crate) fn parameters<M: Model>(&self) -> M::Parameters {
        M::Parameters::read(self.view(), Counts::ZERO)
    }
}

/// The whole state of an instance; what fmi2FMUstate points to.
pub struct Snapshot<M: Model> {
    pub(crate) mode: Mode,
    pub(crate) clock: Clock,
    pub(crate) values: ValueStore,
    pub(crate) memory: Option<M::Memory>,
    pub(crate) derived: Option<Arc<M::Derived>>,
}

/// An instance of the model `M`.
pub struct Instance<M: Model> {
    description: Arc<Description>,
    resources: PathBuf,
    mode: Mode,
    clock: Clock,
    values: ValueStore,
    parameters: M::Parameters,
    /// Computed when they are first needed after a fixed parameter changed.
    derived: Option<Arc<M::Derived>>,
    /// Made with the derived parameters. Not restored when a step fails: in Step Failed nothing reads it, and a saved state or
    /// a reset replaces it.
    memory: Option<M::Memory>,
    outputs_are_old: bool,
    derivatives_are_old: bool,
    /// Whether an output or derivative that is up to date is not finite; everything else always is.
    has_not_finite: bool,
    /// Strings handed out by fmi2GetString; they live until the value changes.
    texts: Box<[CString]>,
}

impl<M: Model> std::fmt::Debug for Instance<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance").field("model", &M::INFO.name).field("mode", &self.mode).finish_non_exhaustive()
    }
}

impl<M: Model> Instance<M> {
    /// A new instance in Instantiated. `resources` is the resources folder of the unpacked FMU.
    pub fn new(description: Arc<Description>, resources: PathBuf) -> Self {
        let values = ValueStore::start(&description.layout);
        let parameters = values.parameters::<M>();
        let texts = texts(&values.strings);
        Self {
            description,
            resources,
            mode: Mode::Instantiated,
            clock: Clock::ZERO,
            parameters,
            derived: None,
            memory: None,
            outputs_are_old: true,
            derivatives_are_old: true,
            has_not_finite: false,
            texts,
            values,
        }
    }

    /// Where the instance stands.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Rejects a call out of order.
    ///
    /// # Errors
    /// "called in X, allowed in Y".
    pub fn check(&self, function: Function) -> CallResult {
        Ok(function.check(self.mode)?)
    }

    /// After a panic nothing but reset and free is trusted.
    pub(crate) fn mark_broken(&mut self) {
        self.mode = Mode::Broken;
    }

    fn layout(&self) -> &Layout {
        &self.description.layout
    }

    /// Whether the real `index` is a state whose start value waits for the derived parameters.
    fn is_calculated_state(&self, index: usize) -> bool {
        let layout = self.layout();
        self.derived.is_none() && layout.states.reals().contains(&index) && layout.real(index).declaration.calculated
    }

    /// fmi2SetupExperiment.
    ///
    /// # Errors
    /// On a start time that is not finite, or a stop time that is not a number after it.
    pub fn setup_experiment(&mut self, start: f64, stop: Option<f64>) -> CallResult {
        self.check(Function::SetupExperiment)?;
        if !start.is_finite() {
            return Err(format!("fmi2SetupExperiment: startTime must be finite, got {start}").into());
        }
        if let Some(stop) = stop
            && (stop.is_nan() || stop < start)
        {
            return Err(
                format!("fmi2SetupExperiment: stopTime must not be before startTime = {start}, got {stop}").into()
            );
        }
        self.clock = Clock { start, stop, time: start, sample: 0 };
        Ok(())
    }

    /// fmi2EnterInitializationMode.
    ///
    /// # Errors
    /// Out of order.
    pub fn enter_initialization(&mut self) -> CallResult {
        self.check(Function::EnterInitializationMode)?;
        self.mode = Mode::Initialization;
        Ok(())
    }

    /// fmi2ExitInitializationMode: computes the derived parameters, which checks the parameters together.
    ///
    /// # Errors
    /// When the parameters do not suit each other; the mode is kept.
    pub fn exit_initialization(&mut self) -> CallResult {
        self.check(Function::ExitInitializationMode)?;
        // Tunable parameters may have changed since the memory was made.
        self.memory = None;
        self.derive()?;
        let memory = self.memory.as_ref().expect("made with the derived parameters");
        if let Some((name, value)) = M::not_finite(memory) {
            return Err(format!(
                "{}: start of '{name}' must be finite, got {value}; check the parameters",
                M::INFO.name
            )
            .into());
        }
        if M::SOURCE.is_some() || M::KIND == ModelKind::Stateful {
            self.outputs_are_old = true;
            self.refresh(false, true, false)?;
            let outputs = self.layout().outputs.reals();
            if let Some(index) = outputs.into_iter().find(|&index| !self.values.reals[index].is_finite()) {
                return Err(format!(
                    "{}: '{}' must be finite at the start, got {}; check the parameters",
                    M::INFO.name,
                    self.layout().real_name(index),
                    self.values.reals[index]
                )
                .into());
            }
        }
        self.mode = Mode::Step;
        Ok(())
    }

    /// fmi2Terminate.
    ///
    /// # Errors
    /// Out of order.
    pub fn terminate(&mut self) -> CallResult {
        self.check(Function::Terminate)?;
        self.mode = Mode::Terminated;
        Ok(())
    }

    /// fmi2Reset: as after instantiation.
    ///
    /// # Errors
    /// Never; every mode allows it.
    pub fn reset(&mut self) -> CallResult {
        self.check(Function::Reset)?;
        *self = Self::new(Arc::clone(&self.description), self.resources.clone());
        Ok(())
    }

    /// The derived parameters and the memory for the present parameters; made if a fixed parameter has changed.
    fn derive(&mut self) -> CallResult<Arc<M::Derived>> {
        let named = |e: String| format!("{}: {e}", M::INFO.name);
        if let (Some(derived), Some(_)) = (&self.derived, &self.memory) {
            return Ok(Arc::clone(derived));
        }
        if let Some(derived) = &self.derived {
            let (layout, start) = (&self.description.layout, self.clock.start);
            let memory = M::begin(&self.parameters, derived, &self.resources, layout, &self.values, start);
            self.memory = Some(memory.map_err(named)?);
            return Ok(Arc::clone(derived));
        }
        let derived = Arc::new(M::load(&self.parameters, &self.resources).map_err(named)?);
        let layout = &self.description.layout;
        let mut values = self.values.clone();
        derived.write(&mut values.view_mut(), layout.derived.at);
        M::initialize(&self.parameters, &derived, layout, &mut values);
        for index in layout.derived.reals().chain(layout.states.reals()) {
            let (what, value) =
                (if index < layout.states.at.reals { "calculated parameter" } else { "start of" }, values.reals[index]);
            if !value.is_finite() {
                return Err(format!(
                    "{}: {what} '{}' must be finite, got {value}; check the parameters",
                    M::INFO.name,
                    layout.real_name(index)
                )
                .into());
            }
        }
        let memory = M::begin(&self.parameters, &derived, &self.resources, layout, &values, self.clock.start);
        let memory = memory.map_err(named)?;
        self.values = values;
        self.memory = Some(memory);
        self.derived = Some(Arc::clone(&derived));
        Ok(derived)
    }

    /// After parameters, inputs or states were set.
    #[inline]
    fn values_changed(&mut self) {
        if M::KIND == ModelKind::Continuous && self.mode != Mode::Step {
            // The discrete state at the start follows from them.
            self.memory = None;
        }
        self.forget_results();
    }

    /// Outputs and derivatives are computed again when they are read.
    #[inline]
    fn forget_results(&mut self) {
        self.outputs_are_old = true;
        self.derivatives_are_old = true;
        self.has_not_finite = false;
    }

    /// Whether outputs have to be computed before they are read.
    #[inline]
    fn outputs_are_due(&self) -> bool {
        // Those of a source are computed up to the start and held from then on; those of a stateful model with each step.
        let are_computed = M::KIND == ModelKind::Continuous
            || (M::CALCULATES_OUTPUTS && matches!(self.mode, Mode::Instantiated | Mode::Initialization));
        are_computed && self.outputs_are_old
    }

    /// Brings outputs, derivatives and calculated parameters up to date as far as a caller asks for them.
    #[inline]
    fn refresh(&mut self, calculated: bool, outputs: bool, derivatives: bool) -> CallResult {
        let outputs = outputs && self.outputs_are_due();
        let derivatives = derivatives && self.derivatives_are_old;
        if !(calculated || outputs || derivatives) {
            return Ok(());
        }
        if self.memory.is_none() {
            self.derive()?;
        }
        let layout = &self.description.layout;
        let (Some(derived), Some(memory)) = (self.derived.as_deref(), &self.memory) else {
            unreachable!("made above");
        };
        let values = &mut self.values;
        if outputs {
            // A source takes its first sample, which is due at the start.
            M::outputs(&self.parameters, derived, memory, layout, values, self.clock.time);
            self.outputs_are_old = false;
            self.has_not_finite |= !are_finite(&values.reals[layout.outputs.reals()]);
        }
        if derivatives {
            M::derivatives(&self.parameters, derived, memory, layout, values, self.clock.time);
            self.derivatives_are_old = false;
            self.has_not_finite |= !are_finite(&values.reals[layout.derivatives.reals()]);
        }
        Ok(())
    }

    #[cold]
    fn unknown_reference(&self, function: Function, reference: u32, expected: &str) -> CallError {
        let what = match self.layout().by_reference(reference) {
            Some(variable) => {
                format!("'{}' of type {}", variable.declaration.name, variable.declaration.kind.type_name())
            }
            None => "no variable".to_owned(),
        };
        CallError::Error(format!(
            "{}: value reference {reference} must be a variable of type {expected}, it is {what}",
            function.name()
        ))
    }

    /// fmi2GetReal.
    ///
    /// # Errors
    /// On an unknown reference, a design without solution, or a result that is not finite; `values` is kept then.
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> CallResult {
        self.check(Function::GetReal)?;
        let layout = self.layout();
        let last = references.iter().fold(0, |last, &reference| last.max(reference));
        if last as usize >= layout.reals() {
            return Err(self.unknown_reference(Function::GetReal, last, "Real"));
        }
        let waits = |index| layout.derived.reals().contains(&index) || self.is_calculated_state(index);
        let calculated = self.derived.is_none() && references.iter().any(|&reference| waits(reference as usize));
        let (first, count) = (layout.outputs.at.reals as u32, layout.outputs.counts.reals as u32);
        let is_output = |&reference: &u32| reference.wrapping_sub(first) < count;
        let outputs = self.outputs_are_due() && references.iter().any(is_output);
        self.refresh(calculated, outputs, last as usize >= layout.derivatives.at.reals)?;
        let reals = &self.values.reals;
        if self.has_not_finite
            && let Some(&reference) = references.iter().find(|&&reference| !reals[reference as usize].is_finite())
        {
            return Err(self.not_finite(reference as usize));
        }
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = reals[reference as usize];
        }
        Ok(())
    }

    #[cold]
    fn not_finite(&self, index: usize) -> CallError {
        CallError::Error(format!(
            "fmi2GetReal: '{}' = {} at time {} s, not a finite number",
            self.layout().real_name(index),
            self.values.reals[index],
            self.clock.time
        ))
    }

    /// Index of a value that is not a real number.
    fn other(&self, function: Function, reference: u32, first: u32, end: u32, expected: &str) -> CallResult<usize> {
        if (first..end).contains(&reference) {
            Ok((reference - first) as usize)
        } else {
            Err(self.unknown_reference(function, reference, expected))
        }
    }

    fn integer(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, self.layout().first_integer, self.layout().first_boolean, "Integer")
    }

    fn boolean(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, self.layout().first_boolean, self.layout().first_string, "Boolean")
    }

    fn string(&self, function: Function, reference: u32) -> CallResult<usize> {
        self.other(function, reference, self.layout().first_string, self.layout().end, "String")
    }

    /// fmi2GetInteger.
    ///
    /// # Errors
    /// On an unknown reference.
    pub fn get_integer(&mut self, reference: u32) -> CallResult<i32> {
        self.check(Function::GetInteger)?;
        let index = self.integer(Function::GetInteger, reference)?;
        self.refresh_others()?;
        Ok(self.values.integers[index])
    }

    /// fmi2GetBoolean.
    ///
    /// # Errors
    /// On an unknown reference.
    pub fn get_boolean(&mut self, reference: u32) -> CallResult<bool> {
        self.check(Function::GetBoolean)?;
        let index = self.boolean(Function::GetBoolean, reference)?;
        self.refresh_others()?;
        Ok(self.values.booleans[index])
    }

    /// fmi2GetString. The text stays where it is until the value changes, a string is set or a state is restored.
    ///
    /// # Errors
    /// On an unknown reference.
    pub fn get_string(&mut self, reference: u32) -> CallResult<&CStr> {
        self.check(Function::GetString)?;
        let index = self.string(Function::GetString, reference)?;
        self.refresh_others()?;
        if self.texts[index].to_bytes() != self.values.strings[index].as_bytes() {
            self.texts[index] = text(&self.values.strings[index]);
        }
        Ok(&self.texts[index])
    }

    /// Brings outputs and calculated parameters that are not real up to date.
    fn refresh_others(&mut self) -> CallResult {
        let layout = self.layout();
        let (calculated, outputs) =
            (layout.derived.has_others() && self.derived.is_none(), layout.outputs.has_others());
        self.refresh(calculated, outputs, false)
    }

    /// Rejects what may not be set now.
    fn settable(&self, function: Function, reference: u32) -> CallResult<&Variable> {
        let Some(variable) = self.layout().by_reference(reference) else {
            return Err(self.unknown_reference(function, reference, &function.name()["fmi2Set".len()..]));
        };
        let before_start = matches!(self.mode, Mode::Instantiated | Mode::Initialization);
        let (allowed, what) = match variable.role {
            Role::Input => (true, ""),
            Role::Parameter if variable.declaration.tunable => (true, ""),
            Role::Parameter => (before_start, "a fixed parameter"),
            Role::State if variable.declaration.calculated => {
                (false, "a state whose start value follows from the parameters")
            }
            Role::State => (before_start, "a continuous state"),
            // What has an exact start value may be set before the start (standard, section 2.1.7).
            Role::Output if !M::CALCULATES_OUTPUTS => (before_start, "an output with a start value"),
            Role::Output => (false, "an output"),
            Role::Calculated => (false, "a calculated parameter"),
            Role::Derivative => (false, "the derivative of a state"),
        };
        if allowed {
            return Ok(variable);
        }
        let when = match variable.role {
            Role::Calculated | Role::Derivative => "never settable",
            Role::Output if M::CALCULATES_OUTPUTS => "never settable",
            Role::State if variable.declaration.calculated => "never settable",
            _ => "settable only in Instantiated and Initialization Mode",
        };
        Err(format!(
            "{}: '{}' is {what}, {when}; the instance is in {}",
            function.name(),
            variable.declaration.name,
            self.mode.name()
        )
        .into())
    }

    /// After a parameter was set: the typed parameters, and the design if a fixed one changed.
    fn parameters_changed(&mut self, fixed: bool) {
        self.parameters = self.values.parameters::<M>();
        if fixed {
            self.derived = None;
        }
        if self.mode != Mode::Step {
            self.memory = None;
        }
    }

    /// fmi2SetReal. Nothing is set unless all values are accepted.
    ///
    /// # Errors
    /// On an unknown reference, a variable that may not be set now, a number that is not finite or outside its limits.
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> CallResult {
        self.check(Function::SetReal)?;
        let layout = self.layout();
        let inputs = layout.inputs.reals();
        // The usual case, inputs and finite numbers, without branches; inputs carry no limits.
        let (first, count) = (layout.inputs.at.reals as u32, layout.inputs.counts.reals as u32);
        let are_inputs = references.iter().fold(true, |all, reference| all & (reference.wrapping_sub(first) < count));
        // 0 times a number that is not finite is not 0, whose bits are zeros after the sign.
        let not_zero = values.iter().fold(0, |bits, value| bits | (value * 0.0).to_bits());
        if are_inputs && not_zero << 1 == 0 {
            for (&reference, &value) in references.iter().zip(values) {
                self.values.reals[reference as usize] = value;
            }
            self.values_changed();
            return Ok(());
        }
        let (mut parameter, mut fixed) = (false, false);
        for (&reference, &value) in references.iter().zip(values) {
            let index = reference as usize;
            if index >= layout.reals() {
                return Err(self.unknown_reference(Function::SetReal, reference, "Real"));
            }
            if !value.is_finite() {
                return Err(format!("fmi2SetReal: '{}' must be finite, got {value}", layout.real_name(index)).into());
            }
            if inputs.contains(&index) {
                continue;
            }
            let variable = self.settable(Function::SetReal, reference)?;
            let Kind::Real(real) = &variable.declaration.kind else { unreachable!("reals come first") };
            let (min, max) = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
            if !(min..=max).contains(&value) {
                return Err(format!(
                    "fmi2SetReal: '{}' must be in [{min}, {max}], got {}",
                    variable.declaration.name,
                    real.unit.with(value)
                )
                .into());
            }
            if variable.role == Role::Parameter {
                parameter = true;
                fixed |= !variable.declaration.tunable;
            }
        }
        for (&reference, &value) in references.iter().zip(values) {
            self.values.reals[reference as usize] = value;
        }
        if parameter {
            self.parameters_changed(fixed);
        }
        self.values_changed();
        Ok(())
    }

    /// fmi2SetInteger. Nothing is set unless all values are accepted.
    ///
    /// # Errors
    /// On an unknown reference, a parameter that may not be set now, or a value outside its limits.
    pub fn set_integer(&mut self, references: &[u32], values: &[i32]) -> CallResult {
        self.check(Function::SetInteger)?;
        for (&reference, &value) in references.iter().zip(values) {
            self.integer(Function::SetInteger, reference)?;
            let variable = self.settable(Function::SetInteger, reference)?;
            let Kind::Integer { min, max, items, .. } = &variable.declaration.kind else {
                unreachable!("the reference is one of an integer")
            };
            let known = items.is_empty() || items.iter().any(|item| item.value == value);
            if !(*min..=*max).contains(&value) || !known {
                let names: Vec<_> = items.iter().map(|c| format!("{} ({})", c.value, c.name)).collect();
                let expected = if names.is_empty() { format!("in [{min}, {max}]") } else { names.join(" or ") };
                return Err(
                    format!("fmi2SetInteger: '{}' must be {expected}, got {value}", variable.declaration.name).into()
                );
            }
        }
        for (&reference, &value) in references.iter().zip(values) {
            let index = self.integer(Function::SetInteger, reference)?;
            self.values.integers[index] = value;
        }
        self.others_changed(references);
        Ok(())
    }

    /// fmi2SetBoolean. Nothing is set unless all references are accepted.
    ///
    /// # Errors
    /// On an unknown reference or a parameter that may not be set now.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> CallResult {
        self.check(Function::SetBoolean)?;
        for &reference in references {
            self.boolean(Function::SetBoolean, reference)?;
            self.settable(Function::SetBoolean, reference)?;
        }
        for (&reference, &value) in references.iter().zip(values) {
            let index = self.boolean(Function::SetBoolean, reference)?;
            self.values.booleans[index] = value;
        }
        self.others_changed(references);
        Ok(())
    }

    /// fmi2SetString. Nothing is set unless all references are accepted.
    ///
    /// # Errors
    /// On an unknown reference, a parameter that may not be set now, or a text with a zero byte.
    pub fn set_string(&mut self, references: &[u32], values: &[String]) -> CallResult {
        self.check(Function::SetString)?;
        for (&reference, value) in references.iter().zip(values) {
            self.string(Function::SetString, reference)?;
            let variable = self.settable(Function::SetString, reference)?;
            if value.contains('\0') {
                return Err(
                    format!("fmi2SetString: '{}' must not contain a zero byte", variable.declaration.name).into()
                );
            }
        }
        for (&reference, value) in references.iter().zip(values) {
            let index = self.string(Function::SetString, reference)?;
            self.values.strings[index].clone_from(value);
        }
        self.texts = texts(&self.values.strings);
        self.others_changed(references);
        Ok(())
    }

    fn others_changed(&mut self, references: &[u32]) {
        let parameters = || references.iter().filter_map(|&reference| self.layout().by_reference(reference));
        let mut parameters = parameters().filter(|variable| variable.role == Role::Parameter).peekable();
        if parameters.peek().is_some() {
            let fixed = parameters.any(|variable| !variable.declaration.tunable);
            self.parameters_changed(fixed);
        }
        self.values_changed();
    }

    /// fmi2DoStep.
    ///
    /// # Errors
    /// A rejected step (time, step size, stop time) changes nothing; a step with a result that is not finite restores
    /// what was before it and leaves the instance in Step Failed.
    pub fn do_step(&mut self, time: f64, step: f64) -> CallResult {
        self.check(Function::DoStep)?;
        let rejected = |message: String| Err(CallError::Error(format!("fmi2DoStep: {message}")));
        let is_length = step > 0.0 && step <= f64::MAX;
        if !is_length {
            return rejected(format!("communicationStepSize must be finite and above 0, got {step} s"));
        }
        let is_on_time = clock::is_within_tolerance((time - self.clock.time).abs(), time, step);
        if !is_on_time {
            return rejected(format!(
                "currentCommunicationPoint = {time} s, but the instance is at {} s; the difference must not exceed 1e-6 \
                 of the step or 4 units in the last place of the time",
                self.clock.time
            ));
        }
        let end = time + step;
        let advances = end > time && end > self.clock.time && end <= f64::MAX;
        if !advances {
            return rejected(format!("a step of {step} s at {time} s does not advance the time"));
        }
        if let Some(stop) = self.clock.stop
            && !clock::is_within_tolerance(end - stop, end, step)
        {
            return rejected(format!("the step from {time} s to {end} s goes past stopTime = {stop} s"));
        }
        let span = Step { start: self.clock.start, reached: self.clock.time, time, step, sample: self.clock.sample };
        let parts = M::parts(&self.description.layout, &self.values, span);
        if parts.is_nan() || parts > MOST_PARTS {
            return rejected(format!(
                "a step of {step} s needs {parts} integration steps or samples; at most {MOST_PARTS} are possible"
            ));
        }
        let parts = u64::from(parts as u32); // quicker than to u64, and the limit is below 2^32
        let layout = &self.description.layout;
        let (Some(derived), Some(memory)) = (self.derived.as_deref(), &mut self.memory) else {
            unreachable!("made at the end of initialization and kept since");
        };
        let result = M::step(&self.parameters, derived, memory, layout, &mut self.values, span, parts);
        self.forget_results();
        if let Err(error) = result {
            self.mode = Mode::StepFailed;
            let what = match error {
                StepError::NotFinite { index, value, time } => {
                    format!("'{}' became {value} at {time} s", self.layout().real_name(index))
                }
                StepError::StateNotFinite { name, value, time } => format!("'{name}' became {value} at {time} s"),
                StepError::Rejected(message) => message,
            };
            return rejected(format!("{what}; the state at {time} s was restored and the instance cannot step on"));
        }
        self.clock.time = end;
        if M::KIND == ModelKind::Discrete {
            self.clock.sample += parts;
        }
        Ok(())
    }

    /// Time of the last successful step in s.
    pub fn time(&self) -> f64 {
        self.clock.time
    }

    /// fmi2GetDirectionalDerivative: exact, by dual numbers.
    ///
    /// # Errors
    /// For a discrete-time model, whose outputs are held; on a reference that is no output or state derivative (unknown) or
    /// no input or state (known), or a seed or result that is not finite.
    pub fn directional_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> CallResult {
        self.check(Function::GetDirectionalDerivative)?;
        let rejected = |message: String| Err(CallError::Error(format!("fmi2GetDirectionalDerivative: {message}")));
        if M::KIND != ModelKind::Continuous {
            return rejected("not provided: only continuous-time models have derivatives".to_owned());
        }
        let layout = self.layout();
        let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
        let (outputs, derivatives) = (layout.outputs.reals(), layout.derivatives.reals());
        let mut direction = vec![0.0; inputs.len() + states.len()];
        for (&reference, &slope) in known.iter().zip(seed) {
            let index = reference as usize;
            let position = if inputs.contains(&index) {
                index - inputs.start
            } else if states.contains(&index) {
                inputs.len() + index - states.start
            } else {
                return rejected(format!("value reference {reference} is neither a real input nor a state (known)"));
            };
            if !slope.is_finite() {
                return rejected(format!("seed of '{}' must be finite, got {slope}", layout.real_name(index)));
            }
            direction[position] += slope;
        }
        let mut positions = Vec::with_capacity(unknown.len());
        for &reference in unknown {
            let index = reference as usize;
            positions.push(if outputs.contains(&index) {
                Ok(index - outputs.start)
            } else if derivatives.contains(&index) {
                Ok(outputs.len() + index - derivatives.start)
            } else if states.contains(&index) {
                Err(inputs.len() + index - states.start) // an output that is a state
            } else {
                return rejected(format!(
                    "value reference {reference} is neither a real output nor the derivative of a state (unknown)"
                ));
            });
        }
        let derived = self.derive()?;
        let layout = self.layout();
        let mut slopes = vec![0.0; outputs.len() + states.len()];
        let memory = self.memory.as_ref().expect("made with the derived parameters");
        let time = self.clock.time;
        M::directional(&self.parameters, &derived, memory, layout, &self.values, time, &direction, &mut slopes);
        let slope = |position: &Result<usize, usize>| position.map_or_else(|own| direction[own], |other| slopes[other]);
        if let Some(at) = positions.iter().position(|position| !slope(position).is_finite()) {
            let name = layout.real_name(unknown[at] as usize);
            return rejected(format!("the derivative of '{name}' is not finite at this point"));
        }
        for (value, position) in result.iter_mut().zip(&positions) {
            *value = slope(position);
        }
        Ok(())
    }

    /// fmi2GetFMUstate: a copy of everything.
    ///
    /// # Errors
    /// Out of order.
    pub fn snapshot(&self) -> CallResult<Snapshot<M>> {
        self.check(Function::GetFMUstate)?;
        Ok(Snapshot {
            mode: self.mode,
            clock: self.clock,
            values: self.values.clone(),
            memory: self.memory.clone(),
            derived: self.derived.clone(),
        })
    }

    /// fmi2SetFMUstate. The instance continues as the one the snapshot was taken of.
    ///
    /// # Errors
    /// Out of order.
    pub fn restore(&mut self, snapshot: &Snapshot<M>) -> CallResult {
        self.check(Function::SetFMUstate)?;
        self.mode = snapshot.mode;
        self.clock = snapshot.clock;
        self.values.clone_from(&snapshot.values);
        self.memory.clone_from(&snapshot.memory);
        self.derived.clone_from(&snapshot.derived);
        self.parameters = self.values.parameters::<M>();
        self.texts = texts(&self.values.strings);
        self.forget_results();
        Ok(())
    }

    /// Bytes of a snapshot, valid in any process with the same FMU.
    ///
    /// # Errors
    /// Out of order.
    pub fn serialize(&self, snapshot: &Snapshot<M>) -> CallResult<Vec<u8>> {
        self.check(Function::SerializeFMUstate)?;
        crate::state_bytes::write(&self.description.guid, snapshot)
            .map_err(|message| CallError::Error(format!("fmi2SerializeFMUstate: {message}")))
    }

    /// A snapshot from bytes.
    ///
    /// # Errors
    /// On bytes that are damaged, of another format or FMU, or whose files have changed.
    pub fn deserialize(&self, bytes: &[u8]) -> CallResult<Snapshot<M>> {
        self.check(Function::DeSerializeFMUstate)?;
        crate::state_bytes::read::<M>(&self.description.guid, self.layout(), &self.resources, bytes)
            .map_err(|message| CallError::Error(format!("fmi2DeSerializeFMUstate: {message}")))
    }
}

/// A string to hand out.
fn text(string: &str) -> CString {
    // A model may make one with a zero byte, which C cannot read.
    CString::new(string).unwrap_or_else(|_| CString::new(string.replace('\0', " ")).unwrap_or_default())
}

fn texts(strings: &[String]) -> Box<[CString]> {
    strings.iter().map(|string| text(string)).collect()
}
