//! `documentation/index.html` of an FMU: the README of the model and the tables of its variables.

use fmu_import::description::{Causality, FmiVersion, ModelDescription, Value, Variability, Variable};
use pulldown_cmark::{Options, Parser, html};

const STYLE: &str = include_str!("documentation.css");

/// Text in HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The page, complete in itself.
pub(crate) fn page(description: &ModelDescription, readme: &str) -> String {
    let mut body = String::new();
    html::push_html(&mut body, Parser::new_ext(readme, Options::ENABLE_TABLES));
    let name = escape(&description.model_name);
    let summary = escape(description.description.as_deref().unwrap_or_default());
    let tables: String = [
        (Causality::Input, "Inputs"),
        (Causality::Output, "Outputs"),
        (Causality::Parameter, "Parameters"),
        (Causality::CalculatedParameter, "Calculated parameters"),
        (Causality::Local, "Local variables"),
    ]
    .into_iter()
    .map(|(causality, title)| table(description, causality, title))
    .collect();
    let guid = escape(&description.guid);
    let (calls, icon) = match description.fmi {
        FmiVersion::V2 => (CALLS.to_owned(), "model.png"),
        FmiVersion::V3 => (CALLS.replace("fmi2", "fmi3"), ICON),
    };
    let calls = calls.replace("REFERENCE_RUN", REFERENCE_RUN);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n<style>\n{STYLE}</style>\n\
         </head>\n<body>\n<p class=\"summary\"><img src=\"../{icon}\" alt=\"\">{summary}</p>\n{body}<h2>Variables</h2>\n{tables}\
         <h2>Calls</h2>\n{calls}<p class=\"guid\">GUID {guid}</p>\n</body>\n</html>\n"
    )
}

/// Entry of the icon in FMI 3.0.
pub(crate) const ICON: &str = "terminalsAndIcons/icon.png";

/// Entry of the reference run. FMI 2.0 asks for names of folders in `extra` that begin with a reversed domain.
pub(crate) const REFERENCE_RUN: &str = "extra/io.github.chassis-fmu/reference.csv";

const CALLS: &str = "<p>The communication step may have any length above 0 and may vary; the start time is free. Parameters \
are set before or in Initialization Mode, tunable ones also between steps. A rejected call returns fmi2Error, changes nothing \
and says in the log what, where and what was expected. A step whose result is not a finite number restores what was before it \
and returns fmi2Error. The complete state can be saved, serialized and restored in another process.</p>\n\
<p><code>REFERENCE_RUN</code>, where it exists, holds a reference run made by an independent implementation: \
set the inputs of a row, and for a plant read its outputs before the step, for a discrete-time model after it.</p>\n";

/// The variables of one causality.
fn table(description: &ModelDescription, causality: Causality, title: &str) -> String {
    let rows: String =
        description.variables.iter().filter(|variable| variable.causality == causality).map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    format!(
        "<h3>{title}</h3>\n<table>\n<thead><tr><th>name</th><th>unit</th><th>start</th><th>limits</th><th>kind</th>\
         <th>description</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    )
}

fn row(variable: &Variable) -> String {
    let unit = variable.unit.as_deref().unwrap_or_default();
    let start = variable.start.as_ref().map_or_else(String::new, value);
    let bound = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v}"));
    let (min, max) = (bound(variable.min), bound(variable.max));
    let limits = if min.is_empty() && max.is_empty() { String::new() } else { format!("{min} … {max}") };
    let kind = match variable.variability {
        Variability::Tunable => "tunable",
        Variability::Fixed => "fixed",
        Variability::Discrete => "sampled",
        Variability::Continuous => "continuous",
        Variability::Constant => "constant",
    };
    format!(
        "<tr><td><code>{}</code></td><td>{}</td><td>{}</td><td>{limits}</td><td>{kind}</td><td>{}</td></tr>\n",
        escape(&variable.name),
        escape(unit),
        escape(&start),
        escape(variable.description.as_deref().unwrap_or_default()),
    )
}

/// A start value.
fn value(value: &Value) -> String {
    match value {
        Value::Real(number) => format!("{number}"),
        Value::Integer(number) => format!("{number}"),
        Value::Boolean(switch) => format!("{switch}"),
        Value::String(text) => text.clone(),
    }
}
