//! A scenario file: its layout, the files it includes, and the checks that need no FMU.

mod check;
mod layout;
mod sweep;

pub(crate) use check::{unknown, whole_steps};
pub(crate) use layout::*;

use crate::import::{self, Choice};
use crate::problem::Collector;
use crate::spanned::Spanned;
use fmu_import::limits;
use fmu_import::temporary::Folder;
use std::path::Path;
use std::sync::Arc;

/// Parses the text of a scenario and the files it includes, which are relative to `folder`. `None` if a file cannot be
/// read or does not have the layout of a scenario, or if an SSP file has something that a scenario cannot express.
///
/// The included files become sources of `problems`. Places in a file follow the places in the previous files.
pub(crate) fn parse(text: &str, folder: &Path, choice: &Choice, problems: &mut Collector) -> Option<Scenario> {
    let own: Written = problems.parse(text)?;
    let (mut files, mut fmus) = (Vec::new(), Vec::new());
    for include in &own.include {
        files.push(included(include, folder, choice, problems, &mut fmus));
    }
    let files = files.into_iter().collect::<Option<Vec<Written>>>()?;
    if choice.variant.is_some() && fmus.is_empty() {
        problems.add(0..0, "`--variant` chooses a file of an SSP file, but there is none");
    }
    assembled(own, files, fmus, problems)
}

fn included(
    path: &Spanned<String>,
    folder: &Path,
    choice: &Choice,
    problems: &mut Collector,
    fmus: &mut Vec<Arc<Folder>>,
) -> Option<Written> {
    let file = folder.join(path.get_ref());
    if import::is_ssp(&file) {
        let system = import::read(&file, path.span(), choice, problems)?;
        let from = problems.add_made(&file, &system.text, system.origins);
        fmus.push(Arc::new(system.folder));
        return problems.parse_from(&format!("{}{}", " ".repeat(from), system.text), from);
    }
    let text = limits::read_text(&file, limits::TEXT_FILE);
    let text = text.map_err(|error| problems.add(path.span(), format!("cannot read {}: {error}", file.display())));
    let text = text.ok()?;
    let from = problems.add_source(&file, &text, "toml");
    // Leading blanks shift the places in this file behind the places in the previous files.
    let moved = format!("{}{text}", " ".repeat(from));
    let part: Written = problems.parse_from(&moved, from)?;
    let texts = [("title", &part.title), ("description", &part.description), ("reference", &part.reference)];
    for (key, value) in texts.into_iter().chain([("parameter_set", &part.parameter_set)]) {
        if let Some(value) = value {
            let message = format!("an included file must not have `{key}`: remove it here; only the scenario has it");
            problems.add(value.span(), message);
        }
    }
    if let Some(nested) = part.include.first() {
        problems.add(nested.span(), "an included file cannot include others");
    }
    Some(part)
}

/// Merges the included files and the scenario. Lists are concatenated; a single table is taken from the last file that
/// has it.
fn assembled(own: Written, files: Vec<Written>, fmus: Vec<Arc<Folder>>, problems: &mut Collector) -> Option<Scenario> {
    let (title, description, reference) = (own.title.clone(), own.description.clone(), own.reference.clone());
    let parameter_set = own.parameter_set.clone();
    let mut all = Written::default();
    let mut signals = Vec::new();
    let (mut every, mut binary) = (None, None);
    let mut has_record = false;
    for mut part in files.into_iter().chain([own]) {
        all.components.append(&mut part.components);
        all.connections.append(&mut part.connections);
        all.cases.append(&mut part.cases);
        all.points.append(&mut part.points);
        all.metrics.append(&mut part.metrics);
        all.figures.append(&mut part.figures);
        all.findings.append(&mut part.findings);
        all.simulation = part.simulation.or(all.simulation);
        all.connect_by_name = part.connect_by_name.or(all.connect_by_name);
        all.sweep = part.sweep.or(all.sweep);
        all.seeds = part.seeds.or(all.seeds);
        if let Some(mut record) = part.record {
            has_record = true;
            signals.append(&mut record.signals);
            every = record.every.or(every);
            binary = record.binary.or(binary);
        }
        for (name, values) in part.parameters {
            match all.components.iter_mut().find(|component| component.name == name) {
                Some(component) => {
                    for (parameter, value) in values {
                        // Reinsert the name, whose place must be in the same file as the value.
                        component.parameters.remove(&parameter);
                        component.parameters.insert(parameter, value);
                    }
                }
                None => {
                    let names = all.components.iter().map(|component| component.name.as_str());
                    unknown("component", name.get_ref(), name.span(), names, problems);
                }
            }
        }
    }
    for (key, is_there) in
        [("title", title.is_some()), ("simulation", all.simulation.is_some()), ("record", has_record)]
    {
        if !is_there {
            problems.add(0..0, format!("missing key `{key}`"));
        }
    }
    all.points.append(&mut sweep::points(all.sweep.as_ref(), &all.points, problems));
    Some(Scenario {
        title: title?.into_inner(),
        description: description.map_or(String::new(), Spanned::into_inner),
        reference: reference.map_or(String::new(), Spanned::into_inner),
        parameter_set,
        simulation: all.simulation?,
        connect_by_name: all.connect_by_name != Some(false),
        fmus,
        components: all.components,
        connections: all.connections,
        cases: all.cases,
        points: all.points,
        sweep: all.sweep,
        seeds: all.seeds,
        record: Record { signals, every, binary },
        metrics: all.metrics,
        figures: all.figures,
        findings: all.findings,
    })
}
