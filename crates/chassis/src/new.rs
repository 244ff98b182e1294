//! `chassis new`: writes a short scenario for a plant, which users can extend.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use fmu_import::bytes::BinaryText;
use fmu_import::description::{BaseType, Causality, ModelDescription, Value, Variable};
use fmu_import::names::{any_of, suggestion};
use fmu_system::resolve::{Descriptions, FmuFolder, Options, resolve_text};
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::arguments::Folders;
use crate::python;
use crate::schema::Format;
use cargo_fmu::files::write_whole;
use cargo_fmu::outln;
use cargo_fmu::workspace::Workspace;

/// FMUs of the driver and the road, used if a folder has them.
const DRIVER: &str = "Driver";
const ROAD: &str = "Road";

const RECORDED: usize = 4;
/// Outputs of a vehicle that are recorded if it has them, in this order.
const WANTED: [&str; 4] = ["vehicle.yaw_rate", "vehicle.lateral_acceleration", "vehicle.sideslip", "body.roll"];

#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Scenario file, with or without `.toml`
    path: PathBuf,
    /// Name of the plant's FMU
    #[arg(long, value_name = "FMU")]
    plant: String,
    /// Maneuver of the FMU `Driver`, such as sine_with_dwell [default: start value of the FMU]
    #[arg(long, value_name = "NAME")]
    maneuver: Option<String>,
    #[command(flatten)]
    fmus: Folders,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let path = &arguments.path;
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    // A dot in a name does not begin an extension.
    let name = name.strip_suffix(".toml").unwrap_or(name);
    if name.is_empty() {
        return Err(miette!("invalid scenario name `{}`; use a file name such as my-test", path.display()));
    }
    let file = place(path).with_file_name(format!("{name}.toml"));
    if file.exists() {
        return Err(miette!("{} exists already; nothing was written", file.display()));
    }
    let fmus = arguments.fmus.source();
    let plant = arguments.plant.as_str();
    let (schema, is_committed) = schema(&file)?;
    let text = format!("#:schema {schema}\n\n{}", text(plant, arguments.maneuver.as_deref(), &fmus)?);
    resolve_text(&file, &text, &fmus, &Options::default())
        .wrap_err_with(|| format!("a scenario for {plant} needs more settings"))?;
    if let Some(parent) = file.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        std::fs::create_dir_all(parent).into_diagnostic().wrap_err_with(|| format!("making {}", parent.display()))?;
    }
    write_whole(&file, text.as_bytes())?;
    if !is_committed {
        write_whole(&file.with_file_name(schema), (Format::Scenario.text()? + "\n").as_bytes())?;
    }
    let inside = std::env::current_dir().ok().and_then(|here| file.strip_prefix(here).ok());
    let shown = inside.unwrap_or(&file).display().to_string();
    outln!(
        "{shown} is ready. Next:\n  chassis plan {shown}   # what is connected to what\n  chassis run {shown}    # signals, requirements and a page"
    );
    if Workspace::find().is_ok_and(|found| found.root.join("scripts/run").is_file()) {
        outln!("  scripts/run {shown}      # the same, after building what changed");
    }
    Ok(())
}

/// Path of the scenario. A name without a folder refers to the folder that the workspace sets for scenarios.
fn place(path: &Path) -> PathBuf {
    Workspace::find().map_or_else(|_| path.to_owned(), |workspace| workspace.place(path, "scenario"))
}

/// Path of the JSON Schema for editors, relative to a scenario. For a scenario in the repository in which this program
/// was built, it is the schema of the repository, and the second value is true. Otherwise, it is a file next to the
/// scenario, and the second value is false.
fn schema(file: &Path) -> Result<(String, bool)> {
    let file = std::path::absolute(file).into_diagnostic()?;
    let inside = python::root().and_then(|root| Some(file.strip_prefix(root).ok()?.components().count()));
    Ok(match inside {
        Some(depth) => ("../".repeat(depth - 1) + "python/chassis_fmu/schemas/scenario.json", true),
        None => ("scenario.schema.json".to_owned(), false),
    })
}

fn needed(name: &str, fmus: &FmuFolder) -> Result<std::sync::Arc<ModelDescription>> {
    match fmus.find(name).map_err(|message| miette!("{name}.fmu: {message}"))? {
        Some(found) => Ok(found.description),
        None if fmus.buildable().iter().any(|known| known == name) => {
            Err(miette!("{name}.fmu is not in {}; run `cargo fmu pack {name}`", fmus.place()))
        }
        None => {
            let known: BTreeSet<String> = fmus.names().into_iter().chain(fmus.buildable()).collect();
            let hint = suggestion(name, known.iter().map(String::as_str));
            let hint = hint.map_or_else(String::new, |hint| format!("; {hint}"));
            Err(miette!("there is no FMU named `{name}` in {}{hint}", fmus.place()))
        }
    }
}

fn text(plant: &str, maneuver: Option<&str>, fmus: &FmuFolder) -> Result<String> {
    let description = needed(plant, fmus)?;
    let inputs: Vec<&Variable> = description.of(Causality::Input).collect();
    let has_input = |output: &Variable| inputs.iter().any(|input| input.name == output.name);
    let found = |name: &str| fmus.find(name).ok().flatten().map(|found| found.description);
    let driver = if maneuver.is_some() { Some(needed(DRIVER, fmus)?) } else { found(DRIVER) };
    // The angle is connected to the first axle. The plants call the other axles middle and rear.
    let steering = driver.as_ref().and_then(|driver| {
        let angle = driver.of(Causality::Output).find(|output| output.name.ends_with(".steer"))?;
        let is_angle = |input: &&&Variable| input.name.starts_with("steer") && input.unit == angle.unit;
        Some((angle.name.clone(), inputs.iter().find(is_angle)?.name.clone()))
    });
    let serves = |fmu: &ModelDescription| fmu.of(Causality::Output).any(has_input);
    let driver = driver.filter(|driver| maneuver.is_some() || steering.is_some() || serves(driver));
    if let (Some(name), Some(driver)) = (maneuver, &driver) {
        check_maneuver(name, driver)?;
    }
    let road = found(ROAD).filter(|road| serves(road));

    let written: BTreeSet<&str> = [&driver, &road]
        .into_iter()
        .flatten()
        .flat_map(|fmu| fmu.of(Causality::Output))
        .map(|output| output.name.as_str())
        .chain(steering.as_ref().map(|(_, to)| to.as_str()))
        .collect();
    let is_free = |input: &&Variable| !written.contains(input.name.as_str());
    let (free, others): (Vec<&Variable>, Vec<&Variable>) = inputs.iter().copied().partition(is_free);
    let parameters = maneuver.map_or_else(String::new, |name| format!("\nparameters = {{ maneuver = \"{name}\" }}"));
    let constants = constants(&free, &others).join(", ");
    let held = if constants.is_empty() { String::new() } else { format!("\ninputs = {{ {constants} }}") };
    let experiment = description.default_experiment;
    let step = experiment.step_size.unwrap_or(0.001);
    let stop = experiment.stop_time.map_or(10.0, |stop| (stop / step).round().max(1.0) * step);
    let recorded = recorded(&description);
    let steer = steering.iter().map(|(from, _)| format!("\"driver:{from}\""));
    let signals: Vec<String> =
        steer.chain(recorded.iter().map(|output| format!("\"plant:{}\"", output.name))).collect();
    let title =
        maneuver.map_or_else(|| plant.to_owned(), |maneuver| format!("{plant}: {}", maneuver.replace('_', " ")));

    // The scenario consists of separate tables, so that users can append further tables, such as those in the
    // documentation.
    let mut parts = vec![
        format!("title = \"{title}\""),
        format!("[simulation]\nstop = {stop:?}\nstep = {step:?}"),
        format!("[record]\nsignals = [{}]", signals.join(", ")),
    ];
    let component =
        |name: &str, fmu: &str, rest: &str| format!("[[component]]\nname = \"{name}\"\nfmu = \"{fmu}\"{rest}");
    if driver.is_some() {
        parts.push(component("driver", DRIVER, &parameters));
    }
    if road.is_some() {
        parts.push(component("road", ROAD, ""));
    }
    let hint = "# Put controllers before the plant, and delete the constants of the inputs that they write.";
    parts.push(format!("{hint}\n{}", component("plant", plant, &held)));
    if let Some((from, to)) = &steering {
        parts.push(format!("[[connection]]\nfrom = \"driver:{from}\"\nto = \"plant:{to}\""));
    }
    parts.push("[[case]]\nname = \"open_loop\"\ntitle = \"Without control\"".to_owned());
    if let Some(output) = recorded.first() {
        let words = output.name.replace(['.', '_'], " ");
        parts.push(format!(
            "# With `max = 1.0` or `min = 0.1` it is a requirement.\n[[metric]]\nname = \"peak\"\ntitle = \"Peak of {words}\"\n\
             signal = \"plant:{}\"\nkind = \"peak\"",
            output.name
        ));
        parts.push(format!(
            "[[figure]]\nname = \"response\"\ntitle = \"Response\"\nkind = \"time\"\nsignals = [{}]",
            signals.join(", ")
        ));
    }
    Ok(parts.join("\n\n") + "\n")
}

fn check_maneuver(name: &str, driver: &ModelDescription) -> Result<()> {
    let parameter = driver.of(Causality::Parameter).find(|parameter| parameter.name == "maneuver");
    let names: Vec<&str> =
        parameter.map_or(Vec::new(), |p| p.named_values().into_iter().map(|(_, name)| name).collect());
    let is_file = |parameter: &&Variable| parameter.name == format!("{name}.file");
    if let Some(file) = driver.of(Causality::Parameter).find(is_file).filter(|_| names.contains(&name)) {
        let help = format!("Start with another maneuver, then set `maneuver = \"{name}\"` and `\"{}\"`.", file.name);
        return Err(miette!(help = help, "the maneuver `{name}` needs a file, the parameter `{}`", file.name));
    }
    if names.contains(&name) {
        return Ok(());
    }
    let hint = suggestion(name, names.iter().copied()).map_or_else(String::new, |hint| format!("; {hint}"));
    Err(miette!("{DRIVER} has no maneuver `{name}`, expected {}{hint}", any_of(&names)))
}

/// Constants for inputs that nothing writes, with their start values. Inputs with the same prefix and value share a
/// pattern, unless it matches one of the `others`.
fn constants(inputs: &[&Variable], others: &[&Variable]) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&Variable>)> = Vec::new();
    for input in inputs {
        let prefix = input.name.rsplit_once('.').map_or("", |(prefix, _)| prefix);
        match groups.iter_mut().find(|(known, _)| *known == prefix && !prefix.is_empty()) {
            Some((_, members)) => members.push(input),
            None => groups.push((prefix, vec![input])),
        }
    }
    let mut all = Vec::new();
    for (prefix, members) in groups {
        let values: Vec<String> = members.iter().map(|input| constant(input)).collect();
        let start = format!("{prefix}.");
        let is_shared = others.iter().any(|other| other.name.starts_with(&start));
        if members.len() > 1 && !is_shared && values.iter().all(|value| *value == values[0]) {
            all.push(format!("\"{prefix}.*\" = {}", values[0]));
        } else {
            all.extend(members.iter().zip(&values).map(|(input, value)| format!("\"{}\" = {value}", input.name)));
        }
    }
    all
}

fn constant(input: &Variable) -> String {
    match &input.start {
        Some(value @ Value::Unsigned(_)) => format!("{:?}", value.text()),
        Some(Value::Binary { hex }) => format!("{:?}", BinaryText::Base64.encode(hex)),
        Some(value) => value.to_string(),
        None if input.base_type == BaseType::Boolean => "false".to_owned(),
        None => "0.0".to_owned(),
    }
}

/// The first outputs of a plant that are not elements of a group such as wheels.
fn recorded(description: &ModelDescription) -> Vec<&Variable> {
    let is_scalar = |output: &&Variable| output.size == 1 && output.base_type == BaseType::Real;
    let is_element = |output: &&Variable| {
        let last = output.name.rsplit_once('.').map_or("", |(_, last)| last);
        output.name.ends_with(']') || (1..=2).contains(&last.len())
    };
    let whole = || description.of(Causality::Output).filter(is_scalar);
    let mut found: Vec<&Variable> = whole().filter(|output| !is_element(output)).collect();
    // Preferred outputs come first. The sort is stable, so the others keep their order.
    found.sort_by_key(|output| WANTED.iter().position(|name| output.name == *name).unwrap_or(WANTED.len()));
    found.truncate(RECORDED);
    if found.is_empty() { whole().take(RECORDED).collect() } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_of_one_value_share_a_pattern() {
        let decay = ModelDescription::parse(include_str!("../../fmu-import/tests/data/decay2.xml")).unwrap();
        let of = |name: &str, start: Value| {
            let template = decay.variables.iter().find(|variable| variable.base_type == BaseType::Real).unwrap();
            Variable { name: name.to_owned(), start: Some(start), ..template.clone() }
        };
        let force = [of("force.l", Value::Real(0.0)), of("force.r", Value::Real(0.0))];
        let steer = [of("steer.rear", Value::Real(0.0)), of("steer.middle", Value::Real(0.0))];
        let mode =
            [of("mode", Value::Integer(2)), of("friction.l", Value::Real(1.0)), of("friction.r", Value::Real(0.5))];
        let front = of("steer.front", Value::Real(0.0));
        let free: Vec<&Variable> = force.iter().chain(&steer).chain(&mode).collect();
        assert_eq!(
            constants(&free, &[&front]),
            [
                "\"force.*\" = 0.0",
                "\"steer.rear\" = 0.0",
                "\"steer.middle\" = 0.0",
                "\"mode\" = 2",
                "\"friction.l\" = 1.0",
                "\"friction.r\" = 0.5"
            ]
        );
    }
}
