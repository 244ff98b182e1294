//! Allowed function calls in every state, for every function and every FMU, in both interfaces of FMI 2.0 and 3.0.
//!
//! Reference: the tables "allowed function calls" in FMI 2.0.4, sections 3.2.3 and 4.2.4, and the lists for each state
//! in FMI 3.0.2, sections 2.3, 3.2 and 4.2, transcribed manually. [`DIFFERENCES`] lists where the FMUs differ, and why.
//! FMI 3.0 has no state Step Failed; after an error, the list for Terminated applies.

use fmu_import::c_api::{self, RawStatus, Reference};
use fmu_import::description::{Causality, FmiVersion, Interface};
use std::ffi::CString;
use tests::fuzz::{interfaces, state};
use tests::raw::{
    Arguments, DISCARD, DerivativeArrays, ERROR, EventArguments, OK, Raw, RawInstance, RawState,
    TYPES_WITHOUT_VARIABLES, Text, Truth, UpdateFlags, in_version,
};
use tests::{Fmu, all, all_of_fmi3, ok};

/// FMU states: the letter in the tables below, and the name in messages.
const STATES: [(char, &str); 7] = [
    ('i', "Instantiated"),
    ('n', "Initialization Mode"),
    ('e', "Event Mode"),
    ('c', "Continuous-Time Mode"),
    ('s', "Step Mode"),
    ('f', "Step Failed"),
    ('t', "Terminated"),
];

/// The states of co-simulation and model exchange in FMI 2.0, then in FMI 3.0: the columns of [`TABLE`].
const COLUMNS: [&str; 4] = ["insft", "inect", "inseft", "inect"];

/// Arguments of calls, in addition to the instance.
struct Subject<'a> {
    fmu: &'a Fmu,
    raw: &'a Raw,
    interface: Interface,
    column: usize,
    /// True if the FMU has Event Mode in co-simulation of FMI 3.0.
    has_event_mode: bool,
    /// Bytes of a state.
    bytes: Vec<u8>,
    /// Inputs with which a step fails.
    failing: Option<Vec<f64>>,
}

/// A call. The last argument is a state that was saved in Instantiated.
type Call = fn(&Subject<'_>, &RawInstance<'_>, RawState) -> RawStatus;

/// The function does not exist in the version.
const NO: &str = "-";
const NEVER: &str = "";

/// Each row contains a function, by its name in FMI 2.0 if it has one; the FMU states in which it is allowed, for each
/// of [`COLUMNS`]; and a call.
const TABLE: &[(&str, [&str; 4], Call)] = &[
    ("fmi2SetDebugLogging", ["insft", "inect", "inseft", "inect"], |_, i, _| i.set_all_logging(1)),
    ("fmi2SetupExperiment", ["i", "i", NO, NO], |_, i, _| i.setup_experiment(0.0)),
    ("fmi2EnterInitializationMode", ["i"; 4], |s, i, _| enter_initialization(s, i)),
    ("fmi2ExitInitializationMode", ["n"; 4], |_, i, _| i.transition("fmi2ExitInitializationMode")),
    ("fmi2Terminate", ["sf", "ec", "se", "ec"], |_, i, _| i.transition("fmi2Terminate")),
    ("fmi2Reset", ["insft", "inect", "inseft", "inect"], |_, i, _| i.transition("fmi2Reset")),
    ("fmi2GetReal", ["nsft", "nect", "inseft", "inect"], |s, i, _| {
        let reals = s.reals();
        i.get(Some(&reals), reals.len(), Some(&mut vec![0.0; reals.len()]))
    }),
    ("fmi2GetInteger", ["nsft", "nect", "inseft", "inect"], |_, i, _| i.get::<i32>(Some(&[]), 0, Some(&mut []))),
    ("fmi3GetInt64", [NO, NO, "inseft", "inect"], |_, i, _| i.get::<i64>(Some(&[]), 0, Some(&mut []))),
    ("fmi2GetBoolean", ["nsft", "nect", "inseft", "inect"], |s, i, _| match s.raw.version() {
        FmiVersion::V2 => i.get::<Truth>(Some(&[]), 0, Some(&mut [])),
        FmiVersion::V3 => i.get::<u8>(Some(&[]), 0, Some(&mut [])),
    }),
    ("fmi2GetString", ["nsft", "nect", "inseft", "inect"], |_, i, _| i.get_texts(Some(&[]), 0, Some(0)).0),
    ("fmi2SetReal", ["ins", "inec", "inse", "inec"], |s, i, _| {
        let inputs = s.fmu.references(Causality::Input);
        i.set(Some(&inputs), inputs.len(), Some(&vec![1.0; inputs.len()]))
    }),
    // Not every FMU has inputs of these types. An empty array is accepted wherever the function is allowed.
    ("fmi2SetInteger", ["ins", "ine", "inse", "ine"], |_, i, _| i.set::<i32>(Some(&[]), 0, Some(&[]))),
    ("fmi3SetInt64", [NO, NO, "inse", "ine"], |_, i, _| i.set::<i64>(Some(&[]), 0, Some(&[]))),
    ("fmi2SetBoolean", ["ins", "ine", "inse", "ine"], |s, i, _| match s.raw.version() {
        FmiVersion::V2 => i.set::<Truth>(Some(&[]), 0, Some(&[])),
        FmiVersion::V3 => i.set::<u8>(Some(&[]), 0, Some(&[])),
    }),
    ("fmi2SetString", ["ins", "ine", "inse", "ine"], |_, i, _| i.set::<Text<'_>>(Some(&[]), 0, Some(&[]))),
    ("fmi2GetFMUstate", ["insft", "inect", "inseft", "inect"], |_, i, _| i.get_state(Some(&mut { RawState::NULL }))),
    ("fmi2SetFMUstate", ["insft", "inect", "inseft", "inect"], |_, i, saved| i.set_state(saved)),
    ("fmi2FreeFMUstate", ["insft", "inect", "inseft", "inect"], |_, i, mut saved| i.free_state(Some(&mut saved))),
    ("fmi2SerializedFMUstateSize", ["insft", "inect", "inseft", "inect"], |_, i, saved| {
        i.state_size(saved, Some(&mut 0))
    }),
    ("fmi2SerializeFMUstate", ["insft", "inect", "inseft", "inect"], |s, i, saved| {
        // The state, which was saved before the start, is at most as large as the subject's state.
        let size = 2 * s.bytes.len();
        i.serialize(saved, Some(&mut vec![0; size]), size)
    }),
    ("fmi2DeSerializeFMUstate", ["insft", "inect", "inseft", "inect"], |s, i, _| {
        i.deserialize(Some(&s.bytes), s.bytes.len(), Some(&mut { RawState::NULL }))
    }),
    ("fmi2GetDirectionalDerivative", ["nsft", "nect", "nseft", "nect"], |s, i, _| derivative(s, i, DIRECTIONAL)),
    ("fmi3GetAdjointDerivative", [NO, NO, "nseft", "nect"], |s, i, _| derivative(s, i, "fmi3GetAdjointDerivative")),
    // Model exchange and events.
    ("fmi2EnterEventMode", [NEVER, "ec", "s", "c"], |_, i, _| i.transition("fmi2EnterEventMode")),
    ("fmi2NewDiscreteStates", [NEVER, "e", "e", "e"], |_, i, _| i.update(Some(&mut { UPDATE }))),
    ("fmi3EvaluateDiscreteStates", [NO, NO, "e", "e"], |_, i, _| i.transition("fmi3EvaluateDiscreteStates")),
    ("fmi2EnterContinuousTimeMode", [NEVER, "e", NEVER, "e"], |_, i, _| i.transition("fmi2EnterContinuousTimeMode")),
    ("fmi2CompletedIntegratorStep", [NEVER, "c", NEVER, "c"], |_, i, _| i.completed_integrator_step(Some(&mut [0; 2]))),
    // FMI 2.0 allows this function in Event Mode only for models without continuous states; these FMUs accept it for
    // all models.
    ("fmi2SetTime", [NEVER, "ec", NEVER, "c"], |_, i, _| i.set_time(0.0)),
    ("fmi2SetContinuousStates", [NEVER, "c", NEVER, "c"], |s, i, _| {
        let states = vec![0.0; s.fmu.states().len()];
        i.set_continuous_states(Some(&states), states.len())
    }),
    ("fmi2GetDerivatives", [NEVER, "nect", NEVER, "nect"], |s, i, _| of_states(s, i, "fmi2GetDerivatives")),
    ("fmi2GetEventIndicators", [NEVER, "nect", NEVER, "nect"], |s, i, _| {
        let count = s.fmu.description.number_of_event_indicators;
        i.numbers("fmi2GetEventIndicators", Some(&mut vec![0.0; count]), count)
    }),
    ("fmi2GetContinuousStates", [NEVER, "nect", NEVER, "nect"], |s, i, _| of_states(s, i, "fmi2GetContinuousStates")),
    ("fmi2GetNominalsOfContinuousStates", [NEVER, "inect", NEVER, "nect"], |s, i, _| {
        of_states(s, i, "fmi2GetNominalsOfContinuousStates")
    }),
    ("fmi3GetNumberOfEventIndicators", [NO, NO, NEVER, "ie"], |_, i, _| {
        i.number_of("fmi3GetNumberOfEventIndicators", Some(&mut 0))
    }),
    ("fmi3GetNumberOfContinuousStates", [NO, NO, NEVER, "ie"], |_, i, _| {
        i.number_of("fmi3GetNumberOfContinuousStates", Some(&mut 0))
    }),
    // Co-simulation.
    ("fmi2SetRealInputDerivatives", ["ins", NEVER, NO, NO], |_, i, _| {
        i.set_input_derivatives(Some(&[]), 0, Some(&[]), Some(&[]))
    }),
    ("fmi2GetRealOutputDerivatives", ["sft", NEVER, "st", NEVER], |s, i, _| match s.raw.version() {
        FmiVersion::V2 => i.get_output_derivatives(Some(&[]), 0, Some(&[]), Some(&mut [])),
        FmiVersion::V3 => i.output_derivatives(&[], &[], &mut []),
    }),
    ("fmi3EnterStepMode", [NO, NO, "e", NEVER], |_, i, _| i.transition("fmi3EnterStepMode")),
    ("fmi2DoStep", ["s", NEVER, "s", NEVER], |s, i, _| do_step(s, i, 0.001)),
    // This function is allowed only while a step is pending, but no step of these FMUs is ever pending.
    ("fmi2CancelStep", [NEVER, NEVER, NO, NO], |_, i, _| i.transition("fmi2CancelStep")),
    ("fmi2GetStatus", ["sft", NEVER, NO, NO], |_, i, _| i.status(0)),
    ("fmi2GetRealStatus", ["sft", NEVER, NO, NO], |_, i, _| i.real_status(2, Some(&mut 0.0))),
    ("fmi2GetIntegerStatus", ["sft", NEVER, NO, NO], |_, i, _| i.integer_status(0, Some(&mut 0))),
    ("fmi2GetBooleanStatus", ["sft", NEVER, NO, NO], |_, i, _| i.boolean_status(3, Some(&mut 0))),
    ("fmi2GetStringStatus", ["sft", NEVER, NO, NO], |_, i, _| i.string_status(1)),
    ("fmi3GetNumberOfVariableDependencies", [NO, NO, "inseft", "inect"], |_, i, _| {
        i.number_of_dependencies(0, Some(&mut 0))
    }),
    ("fmi3GetVariableDependencies", [NO, NO, "inseft", "inect"], |_, i, _| i.dependencies(0, 0).0),
    ("fmi3EnterConfigurationMode", [NO, NO, "is", "ie"], |_, i, _| i.transition("fmi3EnterConfigurationMode")),
    ("fmi3ExitConfigurationMode", [NO, NO, NEVER, NEVER], |_, i, _| i.transition("fmi3ExitConfigurationMode")),
];

/// Getters and setters of [`TYPES_WITHOUT_VARIABLES`] in FMI 3.0.
fn columns_of_type(function: &str) -> [&'static str; 4] {
    let [co_simulation, model_exchange] = match function.strip_prefix("fmi3").expect("a function of FMI 3.0") {
        "GetClock" | "SetClock" => ["e", "e"],
        name if name.contains("Interval") => ["ne", "ne"],
        name if name.contains("Shift") => ["n", "n"],
        name if name.starts_with("Get") => ["inseft", "inect"],
        // Variables of this type can be continuous, so setting them is also allowed in Continuous-Time Mode.
        "SetFloat32" => ["inse", "inec"],
        _ => ["inse", "ine"],
    };
    [NO, NO, co_simulation, model_exchange]
}

/// Functions that return fmi2Discard where they are allowed, because no step is pending and no status of these types
/// exists.
const DISCARDED: [&str; 3] = ["fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"];

/// Rejected in every state, because no FMU has structural parameters.
const NOT_PROVIDED: &str = "fmi3EnterConfigurationMode";

/// Differences between the FMUs and the standard: the function, the column, the FMU states, and whether the FMUs accept
/// the call.
const DIFFERENCES: &[(&str, usize, &str, bool)] = &[
    // After a failed step, the FMUs do not save their state (ARCHITECTURE.md, "Status").
    ("fmi2GetFMUstate", 0, "f", false),
    ("fmi2GetFMUstate", 2, "f", false),
    // No FMU supports output derivatives; the function in FMI 3.0 accepts an empty array.
    ("fmi2GetRealOutputDerivatives", 0, "sft", false),
    // As in FMI 2.0, an importer can terminate after a failed step.
    ("fmi2Terminate", 2, "f", true),
    // Accepted as in FMI 2.0, where the call has no effect.
    ("fmi2EnterEventMode", 3, "e", true),
    // Accepted as in FMI 2.0, because some importers set the time of an event after entering Event Mode.
    ("fmi2SetTime", 3, "e", true),
    // The nominal values never change.
    ("fmi2GetNominalsOfContinuousStates", 3, "i", true),
    ("fmi3GetNumberOfEventIndicators", 3, "nct", true),
    ("fmi3GetNumberOfContinuousStates", 3, "nct", true),
];

const DIRECTIONAL: &str = "fmi2GetDirectionalDerivative";
const UPDATE: UpdateFlags = UpdateFlags { flags: [0; 5], next_event_time: 0.0 };

impl<'a> Subject<'a> {
    fn new(fmu: &'a Fmu, raw: &'a Raw, interface: Interface) -> Self {
        let column =
            2 * usize::from(raw.version() == FmiVersion::V3) + usize::from(interface == Interface::ModelExchange);
        let failing = if interface == Interface::CoSimulation { fmu.failing_inputs() } else { None };
        let has_event_mode = fmu.description.co_simulation.as_ref().is_some_and(|unit| unit.has_event_mode);
        Self { fmu, raw, interface, column, has_event_mode, bytes: state(raw, interface), failing }
    }

    /// The real variables, without the event indicators, which can be infinite.
    fn reals(&self) -> Vec<Reference> {
        let variables = &self.fmu.description.variables;
        let time = variables.iter().find(|variable| variable.causality == Causality::Independent);
        let end = time.filter(|_| self.raw.version() == FmiVersion::V3).map_or(Reference::MAX, |time| time.reference);
        self.fmu.reals().into_iter().filter(|reference| *reference < end).collect()
    }

    fn instance(&self) -> RawInstance<'_> {
        self.instance_with(None)
    }

    /// An instance with these required variables and a callback, if they are given.
    fn instance_with(&self, updates: Option<&[Reference]>) -> RawInstance<'_> {
        let guid = CString::new(self.raw.guid()).expect("no zeros");
        let kind = match self.interface {
            Interface::CoSimulation => c_api::CO_SIMULATION,
            _ => c_api::MODEL_EXCHANGE,
        };
        let events = EventArguments { mode_used: self.has_event_mode, updates, ..EventArguments::default() };
        let (name, guid) = (Some(c"order"), Some(guid.as_c_str()));
        let arguments = Arguments { name, kind, guid, resources: None, callbacks: true, events };
        self.raw.instantiate_logging(arguments, 0).expect("an instance")
    }

    /// A new instance in an FMU state, with a state that it has saved. `None` if the FMU cannot reach this FMU state,
    /// because no input makes a step fail or the FMU has no Event Mode.
    fn bring(&self, letter: char) -> Option<(RawInstance<'_>, RawState)> {
        if (self.column, letter, self.has_event_mode) == (2, 'e', false) {
            return None;
        }
        let instance = self.instance();
        let mut saved = RawState::NULL;
        assert_eq!(instance.get_state(Some(&mut saved)), OK);
        if letter == 'f' {
            let inputs = self.fmu.references(Causality::Input);
            let failing = self.failing.as_deref()?;
            assert_eq!(instance.set(Some(&inputs), inputs.len(), Some(failing)), OK);
        }
        let to_step: &[&str] = if self.has_event_mode { &["fmi3EnterStepMode"] } else { &[] };
        let transitions: &[&[&str]] = match letter {
            'i' => &[],
            'n' => &[&["enter"]],
            'e' => &[&["enter", "fmi2ExitInitializationMode"]],
            'c' => &[&["enter", "fmi2ExitInitializationMode", "fmi2EnterContinuousTimeMode"]],
            't' => &[&["enter", "fmi2ExitInitializationMode", "fmi2Terminate"]],
            _ => &[&["enter", "fmi2ExitInitializationMode"], to_step],
        };
        for function in transitions.iter().copied().flatten() {
            let status = match *function {
                "enter" => enter_initialization(self, &instance),
                function => instance.transition(function),
            };
            assert_eq!(status, OK, "{function}: {:?}", instance.take_log());
        }
        if letter == 'f' {
            assert_eq!(do_step(self, &instance, Fmu::FAILING_STEP), ERROR);
        }
        let _ = instance.take_log();
        assert_eq!(self.letter(&instance), letter, "{}", self.fmu.name);
        Some((instance, saved))
    }

    /// The FMU state of an instance, from the message of a call that is always rejected.
    fn letter(&self, instance: &RawInstance<'_>) -> char {
        let (function, own, status) = match self.column {
            0 => ("fmi2CancelStep", 's', instance.transition("fmi2CancelStep")),
            2 => ("fmi3DoStep", 's', instance.step_with_events(0.0, 0.0, None, None)),
            _ => {
                let function = in_version(self.raw.version(), "fmi2CompletedIntegratorStep");
                (function, 'c', instance.completed_integrator_step(None))
            }
        };
        assert_eq!(status, ERROR);
        let text = message(instance);
        if text.starts_with(&format!("{function}: ")) {
            return own;
        }
        let found = STATES.iter().find(|(_, name)| text.starts_with(&format!("{function} called in {name},")));
        found.unwrap_or_else(|| panic!("no state in: {text}")).0
    }

    /// Returns true if a call must be accepted in an FMU state.
    fn is_accepted(&self, function: &str, columns: [&str; 4], letter: char) -> bool {
        let difference = DIFFERENCES
            .iter()
            .find(|(name, column, states, _)| *name == function && *column == self.column && states.contains(letter));
        let is_derivative = matches!(function, DIRECTIONAL | "fmi3GetAdjointDerivative");
        let is_provided = function != NOT_PROVIDED && (!is_derivative || self.fmu.is_plant());
        let interpolates = self.fmu.description.co_simulation.as_ref().is_some_and(|unit| unit.can_interpolate_inputs);
        let is_provided = is_provided && (interpolates || function != "fmi2SetRealInputDerivatives");
        let is_without_events = self.column == 2 && !self.has_event_mode;
        let is_provided = is_provided && !(is_without_events && function == "fmi2EnterEventMode");
        is_provided && difference.map_or(columns[self.column].contains(letter), |(.., is_accepted)| *is_accepted)
    }

    /// The FMU state after an accepted call.
    fn next(&self, function: &str, letter: char) -> char {
        match function {
            "fmi2EnterInitializationMode" => 'n',
            "fmi2ExitInitializationMode" if self.column == 0 || (self.column == 2 && !self.has_event_mode) => 's',
            "fmi2ExitInitializationMode" | "fmi2EnterEventMode" => 'e',
            "fmi2EnterContinuousTimeMode" => 'c',
            "fmi3EnterStepMode" => 's',
            "fmi2Terminate" => 't',
            "fmi2Reset" | "fmi2SetFMUstate" => 'i',
            _ => letter,
        }
    }

    /// Calls a function in an FMU state, and checks the response.
    fn check(
        &self,
        function: &str,
        columns: [&str; 4],
        letter: char,
        call: impl FnOnce(&RawInstance<'_>, RawState) -> RawStatus,
    ) {
        let Some((instance, saved)) = self.bring(letter) else { return };
        let is_accepted = self.is_accepted(function, columns, letter);
        let before = self.content(&instance, letter);
        let status = call(&instance, saved);
        let name = in_version(self.raw.version(), function);
        let place =
            format!("{} as {}, FMI {}: {name} in {letter}", self.fmu.name, self.interface, self.fmu.description.fmi);
        let expected = match (is_accepted, DISCARDED.contains(&function)) {
            (true, true) => DISCARD,
            (true, false) => OK,
            (false, _) => ERROR,
        };
        let text = message(&instance);
        assert_eq!(status, expected, "{place}: {text}");
        if !is_accepted {
            assert!(text.starts_with(name), "{place}: the message does not name the function: {text}");
            assert!(self.content(&instance, letter) == before, "{place}: a rejected call changed something");
        }
        let next = if is_accepted { self.next(function, letter) } else { letter };
        assert_eq!(self.letter(&instance), next, "{place}: the state after the call");
    }

    /// Calls a function in the first intermediate update of a step. Returns the status, the message and the bytes of the
    /// state after the step.
    fn in_update(&self, call: &mut dyn FnMut(&RawInstance<'_>, RawState) -> RawStatus) -> (RawStatus, String, Vec<u8>) {
        let instance = self.instance_with(Some(&self.fmu.references(Causality::Output)));
        let mut saved = RawState::NULL;
        assert_eq!(instance.get_state(Some(&mut saved)), OK);
        assert_eq!(enter_initialization(self, &instance), OK);
        assert_eq!(instance.transition("fmi2ExitInitializationMode"), OK);
        if self.has_event_mode {
            assert_eq!(instance.transition("fmi3EnterStepMode"), OK);
        }
        let mut result = None;
        let mut importer = || {
            if result.is_none() {
                let status = call(&instance, saved);
                result = Some((status, message(&instance)));
            }
            None
        };
        let (mut flags, mut last) = ([0; 3], 0.0);
        let status = instance.step_with_updates((0.0, 0.001), Some(&mut flags), Some(&mut last), &mut importer);
        assert_eq!(status, OK, "{}", message(&instance));
        let (status, text) = result.expect("a step has an update");
        assert_eq!(self.letter(&instance), 's', "{}: the state after the step", self.fmu.name);
        (status, text, self.content(&instance, 's'))
    }

    /// The bytes of an instance's state, or its values if the state cannot be saved.
    fn content(&self, instance: &RawInstance<'_>, letter: char) -> Vec<u8> {
        let reals = self.reals();
        let mut values = vec![0.0; reals.len()];
        let _ = instance.get(Some(&reals), reals.len(), Some(&mut values));
        let (mut saved, mut size) = (RawState::NULL, 0);
        let bytes = if letter == 'f' {
            values.into_iter().flat_map(f64::to_le_bytes).collect()
        } else {
            let statuses = [instance.get_state(Some(&mut saved)), instance.state_size(saved, Some(&mut size))];
            let mut bytes = vec![0; size];
            assert_eq!((statuses, instance.serialize(saved, Some(&mut bytes), size)), ([OK; 2], OK));
            assert_eq!(instance.free_state(Some(&mut saved)), OK);
            bytes
        };
        let _ = instance.take_log();
        bytes
    }
}

/// The messages since the last call.
fn message(instance: &RawInstance<'_>) -> String {
    let texts = instance.take_log().into_iter().map(|entry| String::from_utf8_lossy(&entry.format).into_owned());
    texts.collect::<Vec<_>>().join("\n")
}

fn enter_initialization(subject: &Subject<'_>, instance: &RawInstance<'_>) -> RawStatus {
    match subject.raw.version() {
        FmiVersion::V2 => instance.transition("fmi2EnterInitializationMode"),
        FmiVersion::V3 => instance.enter_initialization((false, 0.0), 0.0, (false, 0.0)),
    }
}

fn do_step(subject: &Subject<'_>, instance: &RawInstance<'_>, step: f64) -> RawStatus {
    match subject.raw.version() {
        FmiVersion::V2 => instance.do_step(0.0, step),
        FmiVersion::V3 => instance.step_with_events(0.0, step, Some(&mut [0; 3]), Some(&mut 0.0)),
    }
}

fn of_states(subject: &Subject<'_>, instance: &RawInstance<'_>, function: &str) -> RawStatus {
    let count = subject.fmu.states().len();
    instance.numbers(function, Some(&mut vec![0.0; count]), count)
}

/// Calls for the derivative of the first output with respect to the first input.
fn derivative(subject: &Subject<'_>, instance: &RawInstance<'_>, function: &str) -> RawStatus {
    let first = |causality| subject.fmu.references(causality).into_iter().take(1).collect::<Vec<_>>();
    let (unknowns, knowns) = (first(Causality::Output), first(Causality::Input));
    let (seed, mut result) = ([1.0], [0.0]);
    if subject.raw.version() == FmiVersion::V2 {
        let [one, other] = [&unknowns, &knowns].map(|list| (Some(list.as_slice()), list.len()));
        return instance.directional_derivatives(one, other, Some(&seed), Some(&mut result));
    }
    let is_adjoint = function != DIRECTIONAL;
    let (seeds, results) = if is_adjoint { (unknowns.len(), knowns.len()) } else { (knowns.len(), unknowns.len()) };
    let arrays = DerivativeArrays {
        unknowns: (Some(&unknowns), unknowns.len()),
        knowns: (Some(&knowns), knowns.len()),
        seed: (Some(&seed), seeds),
        result: (Some(&mut result), results),
    };
    instance.derivative(function, arrays)
}

/// Calls every function in every FMU state; returns the names of the FMUs that reached Step Failed.
fn every_function_in_every_state(fmus: &[Fmu]) -> Vec<String> {
    let mut failed = Vec::new();
    for fmu in fmus {
        let raw = Raw::load(fmu);
        for interface in interfaces(fmu) {
            let subject = Subject::new(fmu, &raw, interface);
            failed.extend(subject.failing.as_ref().map(|_| fmu.name.clone()));
            for letter in COLUMNS[subject.column].chars() {
                // In FMI 2.0, a library contains only the functions of the interfaces that it provides.
                let has_all = subject.column >= 2 || interfaces(fmu).len() == 2;
                let is_there = |columns: &[&str; 4]| match columns[subject.column] {
                    NO => false,
                    NEVER => has_all,
                    _ => true,
                };
                for (function, columns, call) in TABLE.iter().filter(|(_, columns, _)| is_there(columns)) {
                    subject.check(function, *columns, letter, |instance, saved| call(&subject, instance, saved));
                }
                for (function, shape) in TYPES_WITHOUT_VARIABLES.into_iter().filter(|_| subject.column >= 2) {
                    subject.check(function, columns_of_type(function), letter, |instance, _| {
                        instance.without_variables((function, shape), Some(&[]), 0, &mut [], 0)
                    });
                }
            }
        }
    }
    failed
}

#[test]
fn every_function_in_every_state_of_fmi_2() {
    let failed = every_function_in_every_state(&all());
    // A step can fail because values of a plant overflow. Without such an FMU, Step Failed would not be tested.
    assert!(failed.iter().any(|name| name == "RescueVehicle"), "no failed step of RescueVehicle, only of {failed:?}");
}

#[test]
fn every_function_in_every_state_of_fmi_3() {
    let mut fmus = all_of_fmi3();
    // The test compares serialized states; DcMotorDrive cannot serialize its state.
    fmus.retain(|fmu| fmu.description.co_simulation.as_ref().is_some_and(|unit| unit.can_serialize_fmu_state));
    // A step past the tick of a clock is an error; crates/fmu tests the functions of clocks in each mode.
    fmus.retain(|fmu| fmu.description.clocks.is_empty());
    let has_event_mode = |fmu: &Fmu| fmu.description.co_simulation.as_ref().is_some_and(|unit| unit.has_event_mode);
    assert!(fmus.iter().any(|fmu| fmu.name == "BouncingBall" && has_event_mode(fmu)), "no FMU has Event Mode");
    let failed = every_function_in_every_state(&fmus);
    assert!(failed.iter().any(|name| name == "RescueVehicle"), "no failed step of RescueVehicle, only of {failed:?}");
}

/// Reference: the list for Intermediate Update Mode in FMI 3.0.2, section 4.2.1. Getters and setters come without
/// variables, except that the required ones are read. A call does not change the step.
#[test]
fn every_function_in_an_intermediate_update() {
    let is_of_variables = |name: &str| {
        let rest = name.strip_prefix("fmi3Get").or_else(|| name.strip_prefix("fmi3Set"));
        rest.is_some_and(|rest| {
            let rest = rest.trim_start_matches('U');
            ["Float", "Int8", "Int16", "Int32", "Int64", "Boolean", "String", "Binary"]
                .iter()
                .any(|kind| rest.starts_with(kind))
        })
    };
    let mut fmus = all_of_fmi3();
    fmus.retain(Fmu::is_plant);
    for fmu in &fmus {
        let raw = Raw::load(fmu);
        let subject = Subject::new(fmu, &raw, Interface::CoSimulation);
        let (.., undisturbed) = subject.in_update(&mut |_, _| OK);
        let check = |function: &str, call: &mut dyn FnMut(&RawInstance<'_>, RawState) -> RawStatus| {
            let name = in_version(FmiVersion::V3, function);
            let (status, text, content) = subject.in_update(call);
            let others =
                ["fmi3GetOutputDerivatives", "fmi3GetNumberOfVariableDependencies", "fmi3GetVariableDependencies"];
            let is_accepted = is_of_variables(name) || others.contains(&name);
            let place = format!("{}: {name} in an intermediate update: {text}", fmu.name);
            assert_eq!(status, if is_accepted { OK } else { ERROR }, "{place}");
            assert!(is_accepted || text.starts_with(name), "{place}: the message does not name the function");
            assert!(content == undisturbed, "{place}: the call changed the step");
        };
        for (function, _, call) in TABLE.iter().filter(|(_, columns, _)| columns[2] != NO) {
            check(function, &mut |instance, saved| match *function {
                "fmi2GetReal" => {
                    let outputs = fmu.references(Causality::Output);
                    instance.get(Some(&outputs), outputs.len(), Some(&mut vec![0.0; outputs.len()]))
                }
                "fmi2SetReal" => instance.set::<f64>(Some(&[]), 0, Some(&[])),
                _ => call(&subject, instance, saved),
            });
        }
        for (function, shape) in TYPES_WITHOUT_VARIABLES {
            check(function, &mut |instance, _| instance.without_variables((function, shape), Some(&[]), 0, &mut [], 0));
        }
    }
}

#[test]
fn a_message_says_where_a_call_was_made_and_where_it_may_be() {
    for fmu in all() {
        let mut instance = fmu.instance();
        assert_eq!(
            tests::rejected(instance.do_step(0.0, 0.001)),
            "fmi2DoStep called in Instantiated, allowed in Step Mode",
            "{}",
            fmu.name
        );
    }
}

#[test]
fn the_start_may_be_left_out() {
    // fmi2SetupExperiment is optional; the default is a start at 0 and no stop time.
    for fmu in all() {
        let mut instance = fmu.instance();
        ok(instance.enter_initialization_mode());
        ok(instance.exit_initialization_mode());
        ok(instance.do_step(0.0, 0.001));
        assert_eq!(ok(instance.last_successful_time()), 0.001, "{}", fmu.name);
    }
}
