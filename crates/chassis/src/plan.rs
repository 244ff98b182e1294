//! `chassis plan`: checks a scenario and shows its runs and its wiring.

use crate::selection::Selection;
use cargo_fmu::worker;
use cargo_fmu::{errln, out, outln};
use clap::Args;
use fmu_import::description::Value;
use fmu_import::terminal::{indented, line};
use fmu_system::plan::{self, Connected, Origin, Plan, Signal, Timing, TypeChange, Wiring};
use fmu_system::run::{Extrapolation, Iteration, Linear, Order, Simulation};
use fmu_system::typography::significant;
use miette::IntoDiagnostic;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Maximum number of outputs of a component that are listed by name. If there are more, only their number is shown.
const LISTED_OUTPUTS: usize = 6;

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,

    /// Print the plan as JSON: every run with its components, parameters, connections and recorded columns
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    let plan = arguments.selection.plan_with_steady_starts(&worker::Options::default())?;
    print_warnings(&plan);
    if !arguments.json {
        out!("{}", summary(&plan));
        return Ok(());
    }
    outln!("{}", serde_json::to_string(&plan).into_diagnostic()?);
    Ok(())
}

pub(crate) fn print_warnings(plan: &Plan) {
    for warning in &plan.warnings {
        errln!("warning: {}", indented(warning, "  "));
    }
}

fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// A summary of the runs, their components, and the sources of the inputs.
fn summary(plan: &Plan) -> String {
    let mut lines = vec![plan.title.clone()];
    let times = &plan.simulation;
    let factors: Vec<String> = [
        Some(counted(plan.cases.len(), "case")),
        (!plan.points.is_empty()).then(|| counted(plan.points.len(), "point")),
        (!plan.seeds.is_empty()).then(|| counted(plan.seeds.len(), "seed")),
    ]
    .into_iter()
    .flatten()
    .collect();
    lines.push(format!(
        "{}: {} = {}, each from {} s to {} s in {} steps of {} s, {}",
        plan.file,
        factors.join(" x "),
        counted(plan.runs.len(), "run"),
        times.start,
        times.stop,
        times.steps,
        times.step,
        match times.order {
            Order::Sequential => "sequential",
            Order::Jacobi => "jacobi",
            Order::Auto => "in automatic order",
        }
        .to_owned()
            + &coupling(times),
    ));
    let every = if times.every == 1 { "every step".to_string() } else { format!("every {} steps", times.every) };
    lines.push(format!(
        "{} recorded {every}, {}, {}",
        counted(plan.columns.len(), "signal"),
        counted(plan.metrics.len(), "metric"),
        counted(plan.figures.len(), "figure")
    ));
    let from_file: Vec<&str> =
        plan.columns.iter().filter(|column| column.from_file).map(|column| column.name.as_str()).collect();
    if !from_file.is_empty() {
        lines.push(format!("Recorded from the input file: {}", line(&from_file.join(", "))));
    }
    lines.push("\nComponents in order of execution".to_string());
    lines.extend(components(plan));
    let mut known: HashSet<[String; 3]> = HashSet::new();
    let mut shown = None;
    for wiring in &plan.wiring {
        let rows = rows(wiring, held(times));
        let new: Vec<[String; 3]> = rows.into_iter().filter(|row| !known.contains(row)).collect();
        if known.is_empty() {
            lines.push(format!("\nWiring, case {}", wiring.case));
        } else if !new.is_empty() {
            lines.push(format!("\nWiring of case {} where it differs", wiring.case));
        }
        lines.extend(table(&new));
        known.extend(new);
        let times = timings(wiring);
        if times.is_some() && times != shown {
            lines.extend(times.iter().map(|times| format!("  {times}")));
            shown = times;
        }
    }
    for plan::Loop { at_start, path, held } in plan.wiring.iter().flat_map(|wiring| &wiring.loops) {
        let text = if *at_start {
            format!("\nAlgebraic loop at the start, to be solved in the initialization\n  {}", line(path))
        } else {
            let held = held.join(", ");
            format!(
                "\nAlgebraic loop in each step\n  {}\n  broken by values from the start of the step: {}",
                line(path),
                line(&held)
            )
        };
        if !lines.contains(&text) {
            lines.push(text);
        }
    }
    for wiring in &plan.wiring {
        let unread = unread(wiring);
        if !unread.is_empty() && !lines.contains(&unread) {
            lines.push(format!("\nOutputs that nothing reads, case {}", wiring.case));
            lines.push(unread);
        }
    }
    lines.push(String::new());
    lines.join("\n")
}

/// The coupling of the components, if it is not the usual one.
fn coupling(simulation: &Simulation) -> String {
    let mut words = Vec::new();
    if simulation.extrapolation == Extrapolation::Linear {
        words.push("linear inputs".to_owned());
    }
    if let Some(Iteration { tolerance, limit }) = simulation.iterate {
        words.push(format!("steps iterated to {tolerance:e} in up to {limit} passes"));
    }
    if let Some(control) = simulation.error_control {
        words.push(format!("steps of continuous components chosen for an error of {:e}", control.tolerance));
    }
    words.into_iter().map(|word| format!(", {word}")).collect()
}

/// Describes how a connection uses the value from the start of a step.
fn held(simulation: &Simulation) -> &'static str {
    match (simulation.iterate, simulation.extrapolation) {
        (Some(_), _) => ", iterated",
        (None, Extrapolation::Linear) => ", extrapolated over the step",
        (None, Extrapolation::Hold) => ", held over the step",
    }
}

/// The number of connections by the time of their values; `None` without connections.
fn timings(wiring: &Wiring) -> Option<String> {
    let count = |wanted: Timing| wiring.inputs.iter().filter(|input| input.timing == Some(wanted)).count();
    let [on_time, held, late, early] = [Timing::OnTime, Timing::Held, Timing::Late, Timing::Early].map(count);
    let text = format!("{} on time, {held} held, {late} late, {early} early", counted(on_time, "wire"));
    (on_time + held + late + early > 0).then_some(text)
}

/// All components, in an order that agrees with the execution order of every run.
fn order(plan: &Plan) -> Vec<&str> {
    let mut orders: Vec<Vec<&str>> = Vec::new();
    for run in &plan.runs {
        let order = run.components.iter().map(|component| component.name.as_str()).collect();
        if !orders.contains(&order) {
            orders.push(order);
        }
    }
    let mut left: Vec<&str> = Vec::new();
    for name in orders.iter().flatten() {
        if !left.contains(name) {
            left.push(name);
        }
    }
    let mut found = Vec::new();
    while !left.is_empty() {
        // In every run that has this component, it must be the first of the remaining components.
        let is_next = |name: &&str| {
            orders.iter().filter(|o| o.contains(name)).all(|o| o.iter().find(|n| left.contains(n)) == Some(name))
        };
        let next = left.iter().position(is_next).unwrap_or(0);
        found.push(left.remove(next));
    }
    found
}

/// Name and FMU of every component, the version of FMI, and the number of parameters that the scenario sets.
fn components(plan: &Plan) -> Vec<String> {
    let mut rows: Vec<[String; 3]> = Vec::new();
    for component in plan.runs.iter().flat_map(|run| &run.components) {
        let fmu = std::path::Path::new(&component.fmu)
            .file_stem()
            .map_or(String::new(), |s| s.to_string_lossy().into_owned());
        let steady = if component.steady.is_some() { ", starts in a steady state" } else { "" };
        let set = counted(component.parameters.len(), "parameter");
        let rate = match (component.every, component.substeps) {
            (1, 1) => String::new(),
            (1, substeps) => format!(", {substeps} steps per communication step"),
            (every, _) => format!(", a step per {every} communication steps"),
        };
        let solver = component.integration.map_or(String::new(), |by| format!(", model exchange with {by}"));
        let parameters = format!("FMI {}, sets {set}{steady}{rate}{solver}", component.fmi);
        let row = [component.name.clone(), fmu, parameters];
        match rows.iter().position(|known| known[0] == row[0]) {
            None => rows.push(row),
            // The component has another FMU in another case.
            Some(at) if rows.iter().all(|known| known[..2] != row[..2]) => rows.insert(at + 1, row),
            Some(_) => (),
        }
    }
    let order = order(plan);
    rows.sort_by_key(|row| order.iter().position(|name| *name == row[0]));
    table(&rows)
}

/// The connections of a case: component, input, source. Inputs whose names differ only in the last part share a row if
/// their sources differ in the same way.
fn rows(wiring: &Wiring, held: &str) -> Vec<[String; 3]> {
    let mut rows: Vec<([String; 4], Vec<String>)> = Vec::new();
    let mut indices: HashMap<[String; 4], usize> = HashMap::new();
    for Connected { input, source, type_change, conversion, timing } in &wiring.inputs {
        let (stem, place) = input.variable.rsplit_once('.').unwrap_or((&input.variable, ""));
        let source = match source {
            Origin::Output(Signal { component, variable }) => {
                let words = match type_change {
                    Some(TypeChange::BooleanToReal) => " (Boolean to Real: 0 or 1)",
                    Some(TypeChange::RealToBoolean) => " (Real to Boolean: above 0.5)",
                    None => "",
                };
                match variable.rsplit_once('.').filter(|(_, last)| *last == place && words.is_empty()) {
                    Some((of, _)) => format!("{component}:{of}.*"),
                    None => format!("{component}:{variable}{words}"),
                }
            }
            Origin::File(signal) => format!("file: {signal}"),
            Origin::Constant { value, unit } => {
                let value = match value {
                    Value::Real(v) => v.to_string(),
                    other => other.to_string(),
                };
                let unit = unit.as_ref().filter(|unit| *unit != "1").map_or(String::new(), |unit| format!(" {unit}"));
                format!("constant {value}{unit}")
            }
        };
        let note = match timing {
            None | Some(Timing::OnTime) => "",
            Some(Timing::Held) => held,
            Some(Timing::Late) => ", one step late",
            Some(Timing::Early) => ", one step early",
        };
        let converted = conversion.map_or(String::new(), |Linear { factor, offset }| match offset {
            0.0 => format!(" x {}", significant(factor, 6)),
            _ => format!(" x {} + {}", significant(factor, 6), significant(offset, 6)),
        });
        let source = format!("{source}{converted}");
        let row = [input.component.clone(), stem.to_string(), source, note.to_owned()];
        let index = *indices.entry(row.clone()).or_insert(rows.len());
        match rows.get_mut(index) {
            Some((_, places)) => places.push(place.to_string()),
            None => rows.push((row, vec![place.to_string()])),
        }
    }
    rows.into_iter()
        .map(|([component, stem, source, note], places)| {
            let (input, last) = match &places[..] {
                [place] if place.is_empty() => (stem, ""),
                [place] => (format!("{stem}.{place}"), place.as_str()),
                several => (format!("{stem}.{{{}}}", several.join(" ")), "*"),
            };
            let source = match source.strip_suffix(".*") {
                Some(of) => format!("{of}.{last}"),
                None => source,
            };
            [component, input, format!("<- {source}{note}")]
        })
        .collect()
}

fn table(rows: &[[String; 3]]) -> Vec<String> {
    let rows: Vec<_> = rows.iter().map(|row| row.each_ref().map(|cell| line(cell))).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let (first, second) = (width(0), width(1));
    rows.iter().map(|row| format!("  {:first$}  {:second$}  {}", row[0], row[1], row[2])).collect()
}

/// Outputs that nothing reads, a line for each component.
fn unread(wiring: &Wiring) -> String {
    let mut components: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for signal in &wiring.unread {
        components.entry(&signal.component).or_default().push(&signal.variable);
    }
    let of_component = |(component, outputs): (&str, Vec<&str>)| {
        let outputs =
            if outputs.len() > LISTED_OUTPUTS { format!("{} outputs", outputs.len()) } else { outputs.join(", ") };
        format!("  {component}: {}", line(&outputs))
    };
    components.into_iter().map(of_component).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_are_shown_beside_the_source() {
        let signal =
            |component: &str, variable: &str| Signal { component: component.into(), variable: variable.into() };
        let inputs =
            [("level", None), ("active", Some(TypeChange::RealToBoolean))].map(|(name, type_change)| Connected {
                input: signal("pump", name),
                source: Origin::Output(signal("law", "command")),
                type_change,
                conversion: None,
                timing: None,
            });
        let wiring = Wiring {
            case: "only".into(),
            inputs: inputs.into(),
            unread: Vec::new(),
            loops: Vec::new(),
            discrete: Vec::new(),
        };
        let sources: Vec<String> = rows(&wiring, "").into_iter().map(|[.., source]| source).collect();
        assert_eq!(sources, ["<- law:command", "<- law:command (Real to Boolean: above 0.5)"]);
    }
}
