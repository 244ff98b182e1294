//! Linear models as files: JSON, CSV, MATLAB.

use nalgebra::DMatrix;

use super::model::{LinearModel, Signal};

pub(crate) fn json(model: &LinearModel) -> serde_json::Value {
    let rows = |m: &DMatrix<f64>| -> Vec<Vec<f64>> { m.row_iter().map(|row| row.iter().copied().collect()).collect() };
    let names = |signals: &[Signal]| signals.iter().map(|signal| signal.name.clone()).collect::<Vec<_>>();
    let units = |signals: &[Signal]| signals.iter().map(|signal| signal.unit.clone()).collect::<Vec<_>>();
    let settings: Vec<_> = model.settings.iter().map(|(name, value)| [name, value]).collect();
    let poles: Vec<_> = model.poles.iter().map(|pole| [pole.re, pole.im]).collect();
    serde_json::json!({
        "fmu": model.fmu, "guid": model.guid, "sha256": model.sha256, "settings": settings,
        "states": names(&model.states), "inputs": names(&model.inputs), "outputs": names(&model.outputs),
        "units": {"states": units(&model.states), "inputs": units(&model.inputs), "outputs": units(&model.outputs)},
        "A": rows(&model.a), "B": rows(&model.b), "C": rows(&model.c), "D": rows(&model.d),
        "poles": poles, "modes": model.modes(),
    })
}

/// One matrix, \[A B; C D\], with names of columns (states, inputs) and rows (derivatives of the states, outputs).
pub(crate) fn csv(model: &LinearModel) -> String {
    let quoted = |text: &str| {
        if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
    };
    let mut lines = Vec::new();
    let columns = model.states.iter().chain(&model.inputs).map(|signal| quoted(&signal.name));
    lines.push(std::iter::once(String::new()).chain(columns).collect::<Vec<_>>().join(","));
    let rows = model.states.iter().map(|state| format!("der({})", state.name));
    let rows = rows.chain(model.outputs.iter().map(|output| output.name.clone()));
    let n = model.states.len();
    for (i, name) in rows.enumerate() {
        let numbers: Vec<f64> = if i < n {
            model.a.row(i).iter().chain(model.b.row(i).iter()).copied().collect()
        } else {
            model.c.row(i - n).iter().chain(model.d.row(i - n).iter()).copied().collect()
        };
        let numbers = numbers.iter().map(|value| format!("{value:?}"));
        lines.push(std::iter::once(quoted(&name)).chain(numbers).collect::<Vec<_>>().join(","));
    }
    lines.join("\n") + "\n"
}

/// A MATLAB file of level 5 without compression: the matrices `A`, `B`, `C`, `D`, and the names `states`, `inputs` and
/// `outputs` as cell arrays ("MAT-File Format", The MathWorks).
pub(crate) fn mat(model: &LinearModel) -> Vec<u8> {
    let mut out = format!("MATLAB 5.0 MAT-file, linear model of {}", model.fmu).into_bytes();
    // 116 bytes of text, 8 unused bytes, the version and the byte-order mark.
    out.retain(u8::is_ascii);
    out.truncate(116);
    out.resize(124, b' ');
    out[116..124].fill(0);
    out.extend(0x0100_u16.to_le_bytes());
    out.extend(*b"IM");
    for (name, matrix) in [("A", &model.a), ("B", &model.b), ("C", &model.c), ("D", &model.d)] {
        element(&mut out, ARRAY, &numbers(name, matrix));
    }
    for (name, signals) in [("states", &model.states), ("inputs", &model.inputs), ("outputs", &model.outputs)] {
        element(&mut out, ARRAY, &cells(name, signals));
    }
    out
}

// Types of elements.
const SIGNED_8: u32 = 1;
const UNSIGNED_16: u32 = 4;
const SIGNED_32: u32 = 5;
const UNSIGNED_32: u32 = 6;
const DOUBLE: u32 = 9;
const ARRAY: u32 = 14;

// Classes of arrays.
const CELLS: u32 = 1;
const TEXT: u32 = 4;
const DOUBLES: u32 = 6;

/// Appends an element: its type, the number of bytes, and the bytes, padded to a multiple of 8.
fn element(out: &mut Vec<u8>, kind: u32, bytes: &[u8]) {
    out.extend(kind.to_le_bytes());
    // The largest matrix of an FMU with a valid description is far below 4 GB.
    out.extend(u32::try_from(bytes.len()).unwrap_or(u32::MAX).to_le_bytes());
    out.extend(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
}

/// Returns the beginning of an array: class, dimensions, name.
fn array(class: u32, rows: usize, columns: usize, name: &str) -> Vec<u8> {
    let mut out = Vec::new();
    element(&mut out, UNSIGNED_32, &[class.to_le_bytes(), [0; 4]].concat());
    let dimensions = [rows, columns].map(|size| i32::try_from(size).unwrap_or(i32::MAX).to_le_bytes());
    element(&mut out, SIGNED_32, &dimensions.concat());
    element(&mut out, SIGNED_8, name.as_bytes());
    out
}

fn numbers(name: &str, matrix: &DMatrix<f64>) -> Vec<u8> {
    let mut out = array(DOUBLES, matrix.nrows(), matrix.ncols(), name);
    let bytes: Vec<u8> = matrix.iter().flat_map(|value| value.to_le_bytes()).collect();
    element(&mut out, DOUBLE, &bytes);
    out
}

/// A column of strings.
fn cells(name: &str, signals: &[Signal]) -> Vec<u8> {
    let mut out = array(CELLS, signals.len(), 1, name);
    for signal in signals {
        let units: Vec<u16> = signal.name.encode_utf16().collect();
        let mut text = array(TEXT, 1, units.len(), "");
        let bytes: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        element(&mut text, UNSIGNED_16, &bytes);
        element(&mut out, ARRAY, &text);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::tests::oscillator;
    use super::*;

    #[test]
    fn csv_is_one_matrix_with_names() {
        let expected = ",s,v,integral,f\nder(s),0.0,1.0,0.0,0.0\nder(v),-100.0,-2.0,0.0,0.5\nder(integral),1.0,0.0,0.0,0.0\n\
                        y,1.0,0.0,0.0,0.0\n";
        assert_eq!(csv(&oscillator()), expected);
    }

    #[test]
    fn json_has_modes_and_settings() {
        let found = json(&oscillator());
        assert_eq!(found["settings"], serde_json::json!([["k", "200"]]));
        assert_eq!(found["modes"][0]["damping"], serde_json::Value::Null);
        assert_eq!(found["B"], serde_json::json!([[0.0], [0.5], [0.0]]));
    }

    /// Tests the layout; a Python test reads the file with SciPy.
    #[test]
    fn matlab_files_begin_with_a_header_of_128_bytes() {
        let bytes = mat(&oscillator());
        assert!(bytes.starts_with(b"MATLAB 5.0 MAT-file"));
        assert_eq!(&bytes[124..128], b"\x00\x01IM");
        assert_eq!(bytes[128..132], ARRAY.to_le_bytes());
        assert_eq!(bytes.len() % 8, 0);
    }
}
