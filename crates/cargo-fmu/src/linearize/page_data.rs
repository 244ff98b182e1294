//! The data of an interactive page, according to the schema `web/page-data.schema.json`.

use std::io::Write as _;

use fmu_import::bytes::BinaryText;
use serde::Serialize;
use serde_json::{Value, json};

/// Largest word that represents a number.
const LARGEST: f64 = 65534.0;
/// The word for a missing number.
const MISSING: u16 = 65535;

const CASE: &str = "linear";

#[derive(Serialize)]
pub(super) struct Column {
    at: usize,
    count: usize,
    first: f64,
    step: f64,
    log: bool,
}

/// A panel with two axes, and with a curve (`is_joined`) or crosses from two columns. Each axis has a title, a unit,
/// and `true` if it is logarithmic.
pub(super) fn panel(title: &str, axes: [(&str, &str, bool); 2], [x, y]: [Column; 2], is_joined: bool) -> Value {
    let axis = |(title, unit, log): (&str, &str, bool)| {
        let units = [json!({"name": unit, "factor": 1.0, "offset": 0.0})];
        json!({"title": title, "units": units, "log": log, "zero": false, "range": null})
    };
    let line = json!({
        "title": "Linear model", "kind": "run", "case": CASE, "seed": null, "x": x, "y": y, "apart": !is_joined,
        "crosses": !is_joined,
    });
    let kind = if is_joined { "function" } else { "curve" };
    let [x, y] = axes.map(axis);
    json!({"kind": kind, "title": title, "note": "", "x": x, "y": y, "lines": [line], "levels": []})
}

/// Columns of numbers as 16-bit words.
#[derive(Default)]
pub(super) struct Block {
    words: Vec<u16>,
}

impl Block {
    /// Adds numbers; for a logarithmic axis, their logarithms.
    pub(super) fn column(&mut self, values: &[f64], log: bool) -> Column {
        let numbers: Vec<f64> = values.iter().map(|value| if log { value.log10() } else { *value }).collect();
        let known = || numbers.iter().copied().filter(|value| value.is_finite());
        let (least, greatest) = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
        let (first, span) = if least <= greatest { (least, greatest - least) } else { (0.0, 0.0) };
        let step = span / LARGEST;
        let at = self.words.len();
        let mut before = 0;
        for value in numbers {
            // Between 0 and 65534 after rounding.
            let word = match value.is_finite() {
                true if step > 0.0 => ((value - first) / step).round() as u16,
                true => 0,
                false => MISSING,
            };
            self.words.push(word.wrapping_sub(before));
            before = word;
        }
        Column { at, count: values.len(), first, step, log }
    }

    /// The data of a page, as text that is safe inside a script element. Each figure has a name and panels.
    pub(super) fn page(self, figures: &[(String, Vec<Value>)]) -> std::io::Result<String> {
        let bytes: Vec<u8> = self.words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        encoder.write_all(&bytes)?;
        let case = json!({"name": CASE, "title": "Linear model", "color": 0, "dash": 0});
        let block = BinaryText::Base64.encode(&encoder.finish()?);
        let figures: Vec<_> = figures.iter().map(|(name, panels)| json!({"name": name, "panels": panels})).collect();
        let data = json!({"format": 1, "cases": [case], "seeds": [], "figures": figures, "block": block});
        // No text may end the element or begin a comment.
        Ok(data.to_string().replace('<', "\\u003c"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_differences_of_words() {
        let mut block = Block::default();
        let column = block.column(&[1.0, 3.0, f64::NAN, 2.0], false);
        assert_eq!((column.at, column.count, column.first, column.step), (0, 4, 1.0, 2.0 / LARGEST));
        assert_eq!(block.words, [0, 65534, 1, 32767_u16.wrapping_sub(65535)]);
        let column = block.column(&[0.0, 10.0, 1000.0], true);
        assert_eq!((column.at, column.first), (4, 1.0));
        assert_eq!(block.words[4..], [65535, 1, 65534]);
    }
}
