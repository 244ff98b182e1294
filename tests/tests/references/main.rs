//! Compares runs with reference data from an independent implementation of the same equations
//! (`tests/references/README.md`).

mod assessment;
mod driving;
mod esp_car;
mod heavy_vehicle;
mod hydro_pneumatic;
mod loops;
mod nominal;
mod rescue_vehicle;
mod sources;
mod table;

use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, Variable};
use fmu_import::loader::Instance;
use std::collections::HashMap;
use table::Table;
use tests::state_bytes::checksum;
use tests::{Fmu, ok};

/// Step of a file in s, unless its case states a different one.
const STEP: f64 = 0.001;

/// Call of an FMU for a row of a file.
#[derive(Clone, Copy, Debug)]
enum Call {
    /// Set the inputs that are on the bus.
    Set(&'static str),
    /// Read the outputs onto the bus.
    Read(&'static str),
    /// Step over one row.
    Step(&'static str),
    /// Set, step and read, like a controller.
    Run(&'static str),
}

impl Call {
    fn component(self) -> &'static str {
        let (Self::Set(name) | Self::Read(name) | Self::Step(name) | Self::Run(name)) = self;
        name
    }
}

/// A comparison.
struct Case {
    file: &'static str,
    /// Time from one row to the next in s.
    step: f64,
    /// Columns that are inputs; a `*` at the end stands for any text.
    inputs: &'static [&'static str],
    /// Constant signals, which the file does not contain.
    constants: &'static [(&'static str, f64)],
    /// Inputs that are connected to a signal with another name: FMU, input, signal.
    wires: &'static [(&'static str, &'static str, &'static str)],
    /// Columns that are not compared.
    ignored: &'static [&'static str],
    /// Columns whose signal has another name. If there are such columns, no other columns are compared.
    renamed: &'static [(&'static str, &'static str)],
    parameters: &'static [(&'static str, &'static str, f64)],
    /// String parameters that name a file in the folder of the reference data.
    files: &'static [(&'static str, &'static str, &'static str)],
    program: &'static [Call],
    /// Limits for the columns. If several limits with the same [`Rule`] and times list a column, the first of them
    /// applies.
    limits: &'static [Limit],
}

const NOTHING: Case = Case {
    file: "",
    step: STEP,
    inputs: &[],
    constants: &[],
    wires: &[],
    ignored: &[],
    renamed: &[],
    parameters: &[],
    files: &[],
    program: &[],
    limits: &[],
};

/// A limit on the errors in some columns.
#[derive(Clone, Copy, Debug)]
struct Limit {
    /// The columns; a `*` at the end stands for any text.
    columns: &'static [&'static str],
    /// Columns that are excluded, although `columns` matches them.
    except: &'static [&'static str],
    /// The rows with from <= time < to.
    from: f64,
    to: f64,
    rule: Rule,
}

/// Measure of the errors, and its limit. The peak is the peak of the reference column, or 1e-6 if that is greater:
/// columns that are zero except for rounding then pass.
#[derive(Clone, Copy, Debug)]
enum Rule {
    /// Largest |error|, divided by the peak.
    Peak(f64),
    /// Largest |error|.
    Absolute(f64),
    /// Relative difference of the root mean squares.
    Rms(f64),
    /// Share of the rows whose |error| exceeds `tolerance` times the peak.
    Mismatch { tolerance: f64, share: f64 },
}

/// A limit for all rows of all columns, as a fraction of their peaks.
const fn within(tolerance: f64) -> Limit {
    Limit { columns: &["*"], except: &[], from: 0.0, to: f64::INFINITY, rule: Rule::Peak(tolerance) }
}

const FLOOR: f64 = 1e-6;

impl Limit {
    /// Error in a column, divided by its limit; `None` if no row is in the time range.
    fn usage(&self, times: &[f64], expected: &[f64], found: &[f64]) -> Option<f64> {
        // Cells that were left out of the file are not compared. A result that is not a number counts as an infinite
        // error.
        let pairs: Vec<(f64, f64)> = times
            .iter()
            .zip(expected.iter().zip(found))
            .filter(|(time, (expected, _))| **time >= self.from && **time < self.to && !expected.is_nan())
            .map(|(_, (expected, found))| (*expected, if found.is_nan() { f64::INFINITY } else { *found }))
            .collect();
        if pairs.is_empty() {
            return None;
        }
        let peak = pairs.iter().fold(FLOOR, |peak, (expected, _)| peak.max(expected.abs()));
        let worst = pairs.iter().fold(0.0_f64, |worst, (expected, found)| worst.max((expected - found).abs()));
        let rms = |squares: f64| (squares / pairs.len() as f64).sqrt();
        Some(match self.rule {
            Rule::Peak(tolerance) => worst / peak / tolerance,
            Rule::Absolute(tolerance) => worst / tolerance,
            Rule::Rms(tolerance) => {
                let expected = rms(pairs.iter().map(|(expected, _)| expected * expected).sum());
                let found = rms(pairs.iter().map(|(_, found)| found * found).sum());
                (expected - found).abs() / expected.max(FLOOR) / tolerance
            }
            Rule::Mismatch { tolerance, share } => {
                let wrong = pairs.iter().filter(|(expected, found)| (expected - found).abs() > tolerance * peak);
                wrong.count() as f64 / pairs.len() as f64 / share
            }
        })
    }
}

fn matches(name: &str, patterns: &[&str]) -> bool {
    patterns.iter().any(|pattern| match pattern.strip_suffix('*') {
        Some(start) => name.starts_with(start),
        None => name == *pattern,
    })
}

/// An FMU and its connections: value references and positions on the bus.
struct Component {
    instance: Instance,
    inputs: Wires,
    outputs: Wires,
}

#[derive(Default)]
struct Wires {
    references: Vec<Reference>,
    places: Vec<usize>,
    values: Vec<f64>,
    /// Integers and Booleans: type, reference, position on the bus.
    others: Vec<(BaseType, Reference, usize)>,
}

impl Wires {
    fn add(&mut self, variable: &Variable, place: usize) {
        if variable.base_type == BaseType::Real {
            self.references.push(variable.reference);
            self.places.push(place);
            self.values.push(0.0);
        } else {
            self.others.push((variable.base_type, variable.reference, place));
        }
    }
}

impl Component {
    fn set(&mut self, bus: &[f64]) {
        let wires = &mut self.inputs;
        wires.values.iter_mut().zip(&wires.places).for_each(|(value, &place)| *value = bus[place]);
        ok(self.instance.set_real(&wires.references, &wires.values));
        for &(base_type, reference, place) in &wires.others {
            let value = [bus[place] as i32];
            ok(match base_type {
                BaseType::Boolean => self.instance.set_boolean(&[reference], &value),
                _ => self.instance.set_integer(&[reference], &value),
            });
        }
    }

    fn read(&mut self, bus: &mut [f64]) {
        let wires = &mut self.outputs;
        ok(self.instance.get_real(&wires.references, &mut wires.values));
        wires.values.iter().zip(&wires.places).for_each(|(&value, &place)| bus[place] = value);
        for &(base_type, reference, place) in &wires.others {
            let mut value = [0];
            ok(match base_type {
                BaseType::Boolean => self.instance.get_boolean(&[reference], &mut value),
                _ => self.instance.get_integer(&[reference], &mut value),
            });
            bus[place] = f64::from(value[0]);
        }
    }
}

/// The components of a case, connected by a bus of signals.
struct System {
    components: HashMap<String, Component>,
    /// Names of the components, in the order of their first calls.
    order: Vec<&'static str>,
    bus: Vec<f64>,
    /// Signals from the file: columns and positions on the bus.
    feeds: Vec<(usize, usize)>,
    places: HashMap<String, usize>,
}

impl System {
    fn new(case: &Case, table: &Table) -> Self {
        let mut order = Vec::new();
        for call in case.program {
            if !order.contains(&call.component()) {
                order.push(call.component());
            }
        }
        let fmus: Vec<_> = order.iter().map(|name| Fmu::named(name)).collect();

        // Signals from the file have the first positions, and outputs never overwrite them.
        let given = table.names.iter().filter(|name| matches(name, case.inputs)).map(String::as_str);
        let given: Vec<&str> = given.chain(case.constants.iter().map(|constant| constant.0)).collect();
        let mut places: HashMap<String, usize> =
            given.iter().enumerate().map(|(place, name)| ((*name).to_owned(), place)).collect();
        for output in fmus.iter().flat_map(|fmu| fmu.with(Causality::Output)) {
            let place = places.len();
            places.entry(output.name.clone()).or_insert(place);
        }
        let mut bus = vec![0.0; places.len()];
        for (name, value) in case.constants {
            bus[places[*name]] = *value;
        }
        let feeds = table.names.iter().enumerate();
        let feeds = feeds.filter_map(|(column, name)| places.get(name).map(|&place| (column, place)));
        let feeds: Vec<_> = feeds.filter(|&(_, place)| place < given.len()).collect();

        let mut used = vec![false; places.len()];
        let mut components = HashMap::new();
        for fmu in &fmus {
            let mut component =
                Component { instance: fmu.instance(), inputs: Wires::default(), outputs: Wires::default() };
            for input in fmu.with(Causality::Input) {
                let wire = case.wires.iter().find(|(name, to, _)| (*name, *to) == (&*fmu.name, &*input.name));
                let source = wire.map_or(input.name.as_str(), |(_, _, from)| from);
                if let Some(&place) = places.get(source) {
                    component.inputs.add(input, place);
                    used[place] = true;
                }
            }
            for output in fmu.with(Causality::Output) {
                let place = places[&output.name];
                if place >= given.len() {
                    component.outputs.add(output, place);
                }
            }
            for (_, name, value) in case.parameters.iter().filter(|parameter| parameter.0 == fmu.name) {
                set_parameter(fmu, &mut component.instance, name, *value);
            }
            for (_, name, file) in case.files.iter().filter(|parameter| parameter.0 == fmu.name) {
                // Under Wine, the workspace's path has no drive letter, and the FMU would use the drive of its
                // resources.
                let path = std::path::absolute(tests::workspace().join("tests/references").join(file));
                let path = path.expect("the workspace has a path");
                ok(component.instance.set_string(&[fmu.reference(name)], &[path.to_str().expect("the path is UTF-8")]));
            }
            components.insert(fmu.name.clone(), component);
        }
        let unused = given.iter().zip(used).find(|(_, used)| !used);
        assert!(unused.is_none(), "{}: no component has the input {}", case.file, unused.map_or("", |(name, _)| name));
        Self { components, order, bus, feeds, places }
    }

    fn feed(&mut self, row: &[f64]) {
        for &(column, place) in &self.feeds {
            self.bus[place] = row[column];
        }
    }

    fn initialize(&mut self) {
        for name in &self.order {
            let component = self.components.get_mut(*name).expect("all were inserted");
            ok(component.instance.setup_experiment(0.0, None));
            ok(component.instance.enter_initialization_mode());
            component.set(&self.bus);
            ok(component.instance.exit_initialization_mode());
        }
    }

    fn call(&mut self, call: Call, time: f64, step: f64) {
        let component = self.components.get_mut(call.component()).expect("all were inserted");
        if matches!(call, Call::Set(_) | Call::Run(_)) {
            component.set(&self.bus);
        }
        if matches!(call, Call::Step(_) | Call::Run(_)) {
            ok(component.instance.do_step(time, step));
        }
        if matches!(call, Call::Read(_) | Call::Run(_)) {
            component.read(&mut self.bus);
        }
    }
}

fn set_parameter(fmu: &Fmu, instance: &mut Instance, name: &str, value: f64) {
    let variable = fmu.description.variable(name).unwrap_or_else(|| panic!("{} has no parameter {name}", fmu.name));
    match variable.base_type {
        BaseType::Real => ok(instance.set_real(&[variable.reference], &[value])),
        BaseType::Integer => ok(instance.set_integer(&[variable.reference], &[value as i32])),
        BaseType::Boolean => ok(instance.set_boolean(&[variable.reference], &[i32::from(value != 0.0)])),
        BaseType::String | BaseType::Binary => panic!("{name} is not a number"),
    }
}

/// Runs a case with the inputs of a table and returns the values of these signals, row by row.
fn simulate(case: &Case, table: &Table, signals: &[&str]) -> Vec<Vec<f64>> {
    let mut system = System::new(case, table);
    let place_of =
        |signal: &&str| *system.places.get(*signal).unwrap_or_else(|| panic!("no component has the output {signal}"));
    let places: Vec<usize> = signals.iter().map(place_of).collect();
    system.feed(&table.rows[0]);
    system.initialize();
    let mut found = vec![Vec::with_capacity(table.rows.len()); places.len()];
    for (k, row) in table.rows.iter().enumerate() {
        system.feed(row);
        for call in case.program {
            system.call(*call, k as f64 * case.step, case.step);
        }
        for (found, &place) in found.iter_mut().zip(&places) {
            found.push(system.bus[place]);
        }
    }
    found
}

/// Runs a case and checks every column that is not an input against the limits.
fn compare(case: &Case) {
    let table = Table::read(case.file);
    // The columns to compare, with the names of their signals.
    let compared: Vec<(&str, &str)> = if case.renamed.is_empty() {
        let names = table.names.iter().map(String::as_str);
        let names = names.filter(|name| *name != "time" && !matches(name, case.inputs) && !matches(name, case.ignored));
        names.map(|name| (name, name)).collect()
    } else {
        case.renamed.to_vec()
    };
    assert!(!compared.is_empty() && table.rows.len() > 1, "{}: nothing to compare", case.file);

    let signals: Vec<&str> = compared.iter().map(|(_, signal)| *signal).collect();
    let found = simulate(case, &table, &signals);

    let times: Vec<f64> = (0..table.rows.len()).map(|k| k as f64 * case.step).collect();
    let mut verdicts = Vec::new();
    for ((name, _), found) in compared.iter().zip(&found) {
        let expected = table.column(name);
        let limits = case.limits.iter().filter(|limit| matches(name, limit.columns) && !matches(name, limit.except));
        let before = verdicts.len();
        verdicts.extend(limits.filter_map(|limit| Some((limit.usage(&times, &expected, found)?, name, limit.rule))));
        assert!(verdicts.len() > before, "{}: nothing holds {name}", case.file);
    }
    verdicts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (usage, name, rule) = verdicts[0];
    // `scripts/nightly fmi3` compares the checksums between the versions of FMI.
    let bytes: Vec<u8> = found.iter().flatten().flat_map(|value| value.to_bits().to_le_bytes()).collect();
    let bits = checksum(&bytes);
    println!("{}: {} columns, {name} uses {usage:.2} of {rule:?}, bits {bits:016x}", case.file, compared.len());
    assert!(usage <= 1.0, "{}: {name} is off by {usage:.2} times what {rule:?} allows", case.file);
}

#[test]
fn rules_measure_what_they_say() {
    let times = [0.0, 1.0, 2.0, 3.0];
    let expected = [0.0, 2.0, f64::NAN, -4.0];
    let usage = |rule, found: [f64; 4]| Limit { rule, ..within(0.0) }.usage(&times, &expected, &found).unwrap();
    // An error of 1 in a column whose peak is 4; the missing cell does not count.
    let found = [0.0, 3.0, 9.0, -4.0];
    assert_eq!(usage(Rule::Peak(0.25), found), 1.0);
    assert_eq!(usage(Rule::Absolute(0.5), found), 2.0);
    assert_eq!(usage(Rule::Rms(0.5), [0.0, -4.0, 9.0, 8.0]), 2.0);
    assert_eq!(usage(Rule::Mismatch { tolerance: 0.2, share: 1.0 / 3.0 }, found), 1.0);
    assert_eq!(usage(Rule::Mismatch { tolerance: 0.3, share: 0.5 }, found), 0.0);
    assert_eq!(usage(Rule::Peak(0.25), [0.0, f64::NAN, 0.0, -4.0]), f64::INFINITY);
    let late = Limit { from: 2.0, ..within(0.5) };
    assert_eq!(late.usage(&times, &expected, &found), Some(0.0));
    assert_eq!(Limit { from: 4.0, ..late }.usage(&times, &expected, &found), None);
}
