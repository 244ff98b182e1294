//! Reference documentation of the evaluators.

use super::Evaluator;
use crate::metric::{Definition, Direction};
use crate::options::{Fallback, OptionRule};
use std::fmt::Write as _;

/// Columns, options and metrics of evaluators as Markdown.
pub fn reference<'a>(evaluators: impl IntoIterator<Item = &'a Evaluator>) -> String {
    let parts: Vec<String> = evaluators.into_iter().map(one).collect();
    parts.join("\n")
}

fn one(evaluator: &Evaluator) -> String {
    let mut text = format!("### `{}`\n\n{}. Procedure: {}.\n\n", evaluator.name, evaluator.title, evaluator.source);
    let columns = |is_needed: bool| {
        let chosen = evaluator.columns.iter().filter(|column| column.is_needed == is_needed);
        chosen.map(|column| format!("`{}`{}", column.name, unit(column.unit))).collect::<Vec<_>>().join(", ")
    };
    for (title, columns) in [("Required columns", columns(true)), ("Optional columns", columns(false))] {
        if !columns.is_empty() {
            let _ = writeln!(text, "{title}: {columns}.\n");
        }
    }
    if !evaluator.options.is_empty() {
        text += "| option | default | meaning |\n|---|---|---|\n";
        evaluator.options.iter().for_each(|rule| text += &option(rule));
        text.push('\n');
    }
    text += "| metric | unit | better | definition |\n|---|---|---|---|\n";
    evaluator.metrics.iter().for_each(|definition| text += &metric(definition));
    text
}

fn option(rule: &OptionRule) -> String {
    let default = match rule.default {
        Fallback::Required => "required".to_owned(),
        Fallback::Absent => "none".to_owned(),
        Fallback::Number(number) => number.to_string(),
        Fallback::Word(word) => format!("\"{word}\""),
    };
    format!("| `{}` | {default} | {}{} |\n", rule.name, rule.meaning, unit(rule.unit))
}

fn metric(definition: &Definition) -> String {
    let place = if definition.places.is_some() { ".*" } else { "" };
    let direction = match definition.direction {
        Direction::Up => "higher",
        Direction::Down => "lower",
        Direction::None => "",
    };
    let Definition { name, title, unit, definition, .. } = definition;
    format!("| `{name}{place}` | {unit} | {direction} | {title}. {definition} |\n")
}

fn unit(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" ({unit})") }
}
