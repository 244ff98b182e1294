//! Traces from CSV files.

use super::{Column, Trace};
use crate::numerics::UNEVENNESS;
use fmu_import::names::{similar, suggestion};
use fmu_system::data::unit::Target;
use fmu_system::data::{Channel, DataError, Format, Signal, Table, TimeColumn};
use fmu_system::run::Linear;
use std::collections::BTreeMap;

/// Longest gap over which values are interpolated, s.
const LONGEST_GAP: f64 = 0.5;
/// Remedy for a longer gap.
const NOT_BRIDGED: &str = "gaps of more than 0.5 s are not bridged: cut the file before or after the gap";
/// Distance between rows that counts as a gap, relative to the median distance.
const GAP: f64 = 1.9;
/// Deviation of a row from an even grid, relative to the step, above which a note is added: it changes computed speeds
/// and rates by more than 2 %.
const JITTER: f64 = 0.02;
/// Times that differ by less than this fraction of the step are treated as equal.
const SAME_TIME: f64 = 1e-6;

/// Options for reading a file as a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// Names of columns that differ from the signal, by signal; `time` for the time column.
    pub names: BTreeMap<String, String>,
    /// Units of columns by signal. They take precedence over units in the file.
    pub units: BTreeMap<String, String>,
    /// Interpolates between rows that are not evenly spaced.
    pub resample: Option<Resample>,
}

/// Distance between the rows of a resampled recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Resample {
    /// The median distance in the file.
    Median,
    /// The given distance, s.
    Step(f64),
}

impl Reading {
    /// The signal in a column.
    fn signal<'a>(&'a self, column: &'a str) -> Option<&'a str> {
        let named = self.names.iter().find(|(signal, name)| *name == column && *signal != "time");
        // If a signal is mapped to another column, a column with the signal's name is ignored.
        named.map(|(signal, _)| signal.as_str()).or_else(|| (!self.names.contains_key(column)).then_some(column))
    }
}

impl Trace<'static> {
    /// Reads a CSV file, plain or compressed with gzip; `file` is its name in messages. The columns listed in `columns`
    /// become signals, converted to the units given there. An empty cell is NaN. Returns the trace and notes for the
    /// user.
    ///
    /// # Errors
    /// The file is damaged or not a table, it has no time column, its rows are not evenly spaced, or a listed column
    /// has a cell that is not a number, a unit that cannot be converted, or a duplicate name.
    pub fn read(
        file: &str,
        bytes: &[u8],
        columns: &[Column],
        reading: &Reading,
    ) -> Result<(Self, Vec<String>), DataError> {
        let table = Table::parse(file, bytes, &Format::default())?;
        let read = |signal: &str| {
            columns.iter().find(|column| match column.name.strip_suffix('*') {
                Some(group) => signal.starts_with(group),
                None => column.name == signal,
            })
        };
        let wanted: Vec<(&str, &str, &Column)> = table
            .columns()
            .iter()
            .filter_map(|column| {
                let signal = reading.signal(&column.name)?;
                Some((column.name.as_str(), signal, read(signal)?))
            })
            .collect();
        if table.found().rows == 0 {
            // This is not an error here: each metric reports that there are no rows.
            let empty = wanted.iter().map(|(_, signal, _)| ((*signal).to_owned().into(), Vec::new().into()));
            return Ok((Self { times: Vec::new().into(), columns: empty.collect() }, Vec::new()));
        }
        let column = TimeColumn {
            column: reading.names.get("time").cloned(),
            unit: reading.units.get("time").cloned(),
            ..TimeColumn::default()
        };
        let clock = table.times(&column)?;
        let mut notes = Vec::new();
        for (signal, name) in reading.names.iter().filter(|(signal, _)| read(signal).is_some()) {
            let names = || table.columns().iter().map(|column| column.name.as_str());
            if !names().any(|column| column == name) {
                let near = suggestion(name, names()).map_or(String::new(), |near| format!("; {near}"));
                notes.push(format!("the file has no column `{name}` for `{signal}`{near}"));
            }
        }
        let has = |signal: &str| wanted.iter().any(|(_, known, _)| *known == signal);
        for column in columns.iter().filter(|column| !has(column.name) && !reading.names.contains_key(column.name)) {
            let others: Vec<&str> =
                table.columns().iter().map(|other| other.name.as_str()).filter(|other| read(other).is_none()).collect();
            let near = if column.is_needed { similar(column.name, others) } else { suggestion(column.name, others) };
            if let Some(near) = near {
                notes.push(format!("the file has no column `{}`; {near} (map columns with `--vehicle`)", column.name));
            }
        }
        let times = match reading.resample {
            None => {
                check_spacing(file, clock.times(), &mut notes)?;
                clock.times().to_vec()
            }
            Some(resample) => grid(file, clock.times(), resample, &mut notes)?,
        };
        let mut trace = Self::new(times);
        for (name, signal, column) in wanted {
            let unit = reading.units.get(signal).map(String::as_str);
            let found = table.signal(&clock, &Channel { unit, ..Channel::new(name) }, &Target::named(column.unit))?;
            if found.conversion != Linear::IDENTITY {
                let factor = found.conversion.factor;
                notes.push(format!("the column `{name}` is converted to {} (factor {factor:.9})", column.unit));
            }
            let values = match reading.resample {
                None => at_rows(&trace.times, &found),
                Some(_) => interpolated(file, name, &trace.times, &found, &mut notes)?,
            };
            if trace.column(signal).is_some() {
                let help = "remove or rename one of them".to_owned();
                return Err(DataError::new(file, format!("two columns hold the signal `{signal}`"), Some(help)));
            }
            trace.columns.push((signal.to_owned().into(), values.into()));
        }
        Ok((trace, notes))
    }
}

/// The values of a signal at the rows; NaN for missing values.
fn at_rows(times: &[f64], signal: &Signal) -> Vec<f64> {
    let mut samples = signal.times.iter().zip(&*signal.values).peekable();
    let value = |time: &f64| samples.next_if(|(of, _)| *of == time).map_or(f64::NAN, |(_, value)| *value);
    times.iter().map(value).collect()
}

/// Interpolates a signal. Adds a note if it becomes zero or nonzero in a gap.
fn interpolated(
    file: &str,
    name: &str,
    times: &[f64],
    signal: &Signal,
    notes: &mut Vec<String>,
) -> Result<Vec<f64>, DataError> {
    if let Some(gap) = signal.times.windows(2).find(|pair| pair[1] - pair[0] > LONGEST_GAP) {
        return Err(too_long(file, &format!("the column `{name}`"), gap));
    }
    let usual = median(&signal.times);
    for (times, values) in signal.times.windows(2).zip(signal.values.windows(2)) {
        let (length, is_switch) = (times[1] - times[0], (values[0] == 0.0) != (values[1] == 0.0));
        if is_switch && length > GAP * usual {
            let what = if values[0] == 0.0 { "begins" } else { "ends" };
            notes.push(format!(
                "`{name}` {what} in the gap from {} s to {} s: this time, and everything measured from it, is \
                 uncertain by {length:.3} s",
                times[0], times[1]
            ));
        }
    }
    let mut row = 0;
    let value = |time: &f64| {
        while signal.times.get(row + 1).is_some_and(|next| next <= time) {
            row += 1;
        }
        let (t0, v0) = (signal.times[row], signal.values[row]);
        match signal.times.get(row + 1).zip(signal.values.get(row + 1)) {
            _ if *time < t0 => f64::NAN,
            Some((t1, v1)) => v0 + (v1 - v0) * ((time - t0) / (t1 - t0)),
            None if *time == t0 => v0,
            None => f64::NAN,
        }
    };
    Ok(times.iter().map(value).collect())
}

fn too_long(file: &str, what: &str, gap: &[f64]) -> DataError {
    let message = format!("{what} has a gap from {} s to {} s", gap[0], gap[1]);
    DataError::new(file, message, Some(NOT_BRIDGED.to_owned()))
}

fn median(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// The times of the two neighboring rows that are farthest apart.
fn longest(times: &[f64]) -> Option<&[f64]> {
    times.windows(2).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
}

/// Checks that the rows are evenly spaced. Clock jitter is allowed and noted.
fn check_spacing(file: &str, times: &[f64], notes: &mut Vec<String>) -> Result<(), DataError> {
    let (Some(gap), [first, .., last]) = (longest(times), times) else { return Ok(()) };
    let (median, step) = (median(times), (last - first) / (times.len() - 1) as f64);
    let shares = times.iter().enumerate().map(|(row, time)| ((time - first) / step - row as f64).abs());
    let (row, share) = shares.enumerate().fold((0, 0.0), |most, one| if one.1 > most.1 { one } else { most });
    let message = if gap[1] - gap[0] > GAP * median {
        format!("the rows have a gap from {} s to {} s; their median distance is {median:.9} s", gap[0], gap[1])
    } else if share > UNEVENNESS {
        let time = times[row];
        format!(
            "the rows are not evenly spaced: the row at {time} s is off by more than half of the mean distance, {step:.9} s"
        )
    } else {
        if share > JITTER {
            let (time, percent) = (times[row], 100.0 * share);
            notes.push(format!(
                "the row at {time} s is off by {percent:.0} % of the mean distance, {step:.9} s; the rows are treated as \
                 evenly spaced; `--resample` interpolates between them"
            ));
        }
        return Ok(());
    };
    let help = if gap[1] - gap[0] > LONGEST_GAP { NOT_BRIDGED } else { "`--resample` interpolates between the rows" };
    Err(DataError::new(file, message, Some(help.to_owned())))
}

/// Evenly spaced times within the times of the file.
fn grid(file: &str, times: &[f64], resample: Resample, notes: &mut Vec<String>) -> Result<Vec<f64>, DataError> {
    let (Some(gap), [first, .., last]) = (longest(times), times) else { return Ok(times.to_vec()) };
    let step = match resample {
        Resample::Median => median(times),
        Resample::Step(step) => step,
    };
    if gap[1] - gap[0] > LONGEST_GAP {
        return Err(too_long(file, "the file", gap));
    }
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - step).abs() <= SAME_TIME * step;
    if times.windows(2).all(is_even) {
        return Ok(times.to_vec());
    }
    notes.push(format!(
        "the rows are interpolated every {step:.9} s; the longest gap is from {} s to {} s",
        gap[0], gap[1]
    ));
    let rows = ((last - first) / step * (1.0 + 1e-12)).floor();
    if rows > 1e7 {
        let help = Some("choose a longer step".to_owned());
        return Err(DataError::new(file, format!("{rows:.0} rows of {step} s are too many"), help));
    }
    let nearest = |time: f64| {
        let next = times.partition_point(|of| *of < time);
        let near = |of: &&f64| (**of - time).abs() <= SAME_TIME * step;
        // Uses the exact time of a row where there is one. Otherwise, rounding could move a jump in a signal to the
        // previous interval.
        times[next.saturating_sub(1)..(next + 1).min(times.len())].iter().find(near).copied().unwrap_or(time)
    };
    Ok((0..=rows as u64).map(|row| nearest((first + row as f64 * step).min(*last))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    const COLUMNS: [Column; 3] = [
        Column { name: "vehicle.yaw_rate", unit: "rad/s", is_needed: true },
        Column { name: "path.finished", unit: "1", is_needed: false },
        Column { name: "tire_load.*", unit: "N", is_needed: false },
    ];

    fn read(bytes: &[u8], reading: &Reading) -> Result<(Trace<'static>, Vec<String>), String> {
        Trace::read("a.csv", bytes, &COLUMNS, reading).map_err(|error| error.to_string())
    }

    #[test]
    fn files_are_read_plain_and_compressed() {
        let text = "\u{feff}vehicle.yaw_rate, time,path.finished,Marker\n1e-3,0.1,false,a\n,0.2,true,b\n";
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(text.as_bytes()).unwrap();
        for bytes in [text.as_bytes().to_vec(), encoder.finish().unwrap()] {
            let (trace, notes) = read(&bytes, &Reading::default()).unwrap();
            assert_eq!(trace.times(), [0.1, 0.2]);
            assert_eq!(trace.names().collect::<Vec<_>>(), ["vehicle.yaw_rate", "path.finished"]);
            assert_eq!(trace.column("path.finished"), Some(&[0.0, 1.0][..]));
            let rate = trace.column("vehicle.yaw_rate").unwrap();
            assert!(rate[0] == 1e-3 && rate[1].is_nan());
            assert!(notes.is_empty());
        }
    }

    #[test]
    fn a_file_may_have_no_rows() {
        assert!(read(b"time,vehicle.yaw_rate\n", &Reading::default()).unwrap().0.times().is_empty());
    }

    /// A typo in any column name is reported. For a required column, columns with common words are also suggested.
    #[test]
    fn columns_of_similar_names_are_named() {
        let notes = |header: &str| read(format!("{header}\n0,1,2\n1,1,2\n").as_bytes(), &Reading::default()).unwrap().1;
        let needed = "the file has no column `vehicle.yaw_rate`; similar names: `Yaw Rate filtered` (map columns with `--vehicle`)";
        assert_eq!(notes("time,Yaw Rate filtered,a"), [needed]);
        let slip = "the file has no column `path.finished`; did you mean `path.finish`? (map columns with `--vehicle`)";
        assert_eq!(notes("time,vehicle.yaw_rate,path.finish"), [slip]);
        assert_eq!(notes("time,vehicle.yaw_rate,a"), [""; 0]);
    }

    /// Reference: 180 deg are pi rad, 1 kN is 1000 N.
    #[test]
    fn columns_are_renamed_and_converted() {
        let text = "Zeit;Gier [°/s];vehicle.yaw_rate;tire_load.fl\nms;;;kN\n0;180,0;7;1,5\n10;90;7;2\n";
        let names = [("time", "Zeit"), ("vehicle.yaw_rate", "Gier")];
        let reading = Reading {
            names: names.map(|(signal, column)| (signal.to_owned(), column.to_owned())).into(),
            ..Reading::default()
        };
        let (trace, notes) = read(text.as_bytes(), &reading).unwrap();
        assert_eq!(trace.times(), [0.0, 0.01]);
        let rate = trace.column("vehicle.yaw_rate").unwrap();
        assert!((rate[0] - std::f64::consts::PI).abs() < 1e-15, "{rate:?}");
        assert_eq!(trace.column("tire_load.fl"), Some(&[1500.0, 2000.0][..]));
        assert_eq!(notes.len(), 2);
        // The caller declares that times are in ms, and misspells the column of the yaw rate.
        let names = [("time", "Zeit"), ("vehicle.yaw_rate", "gier")];
        let reading = Reading {
            names: names.map(|(signal, column)| (signal.to_owned(), column.to_owned())).into(),
            units: BTreeMap::from([("time".to_owned(), "ms".to_owned())]),
            ..Reading::default()
        };
        let (trace, notes) = read(b"Zeit,Gier\n0,1\n10,2\n", &reading).unwrap();
        assert_eq!(trace.times(), [0.0, 0.01]);
        assert_eq!(notes, ["the file has no column `gier` for `vehicle.yaw_rate`; did you mean `Gier`?"]);
        let units = BTreeMap::from([("vehicle.yaw_rate".to_owned(), "deg/s".to_owned())]);
        let (trace, _) =
            read(b"time,vehicle.yaw_rate\n0,180\n1,0\n", &Reading { units, ..Reading::default() }).unwrap();
        assert!((trace.column("vehicle.yaw_rate").unwrap()[0] - std::f64::consts::PI).abs() < 1e-15);
    }

    /// Reference: the straight line 10 t, which linear interpolation reproduces.
    #[test]
    fn rows_that_are_not_evenly_spaced_are_resampled_by_option() {
        let times: Vec<f64> = (0..100).filter(|k| !(30..42).contains(k)).map(|k| f64::from(k) * 0.01).collect();
        let text =
            times.iter().fold("time,vehicle.yaw_rate\n".to_owned(), |text, t| text + &format!("{t},{}\n", 10.0 * t));
        let error = read(text.as_bytes(), &Reading::default()).unwrap_err();
        assert_eq!(
            error,
            "a.csv: the rows have a gap from 0.29 s to 0.42 s; their median distance is 0.010000000 s; \
             `--resample` interpolates between the rows"
        );
        for resample in [Resample::Median, Resample::Step(0.005)] {
            let reading = Reading { resample: Some(resample), ..Reading::default() };
            let (trace, notes) = read(text.as_bytes(), &reading).unwrap();
            let step = if resample == Resample::Median { 0.01 } else { 0.005 };
            assert_eq!(trace.times().len(), (0.99_f64 / step).round() as usize + 1);
            for (time, value) in trace.times().iter().zip(trace.column("vehicle.yaw_rate").unwrap()) {
                assert!((value - 10.0 * time).abs() < 1e-12, "{value} at {time} s");
            }
            assert!(notes[0].ends_with("the longest gap is from 0.29 s to 0.42 s"), "{notes:?}");
        }
        // A step in a signal stays between the same two rows in spite of rounding: the median distance is
        // 0.010000000000000009.
        let switch = |times: &mut dyn Iterator<Item = i32>| {
            let row = |k| format!("{},{}\n", f64::from(k) * 0.01, i32::from(k >= 100));
            times.fold("time,vehicle.yaw_rate\n".to_owned(), |text, k| text + &row(k))
        };
        let reading = Reading { resample: Some(Resample::Median), ..Reading::default() };
        let (trace, notes) = read(switch(&mut (0..300)).as_bytes(), &reading).unwrap();
        assert_eq!(notes, [""; 0], "nothing is interpolated");
        assert_eq!(trace.column("vehicle.yaw_rate").unwrap()[99..101], [0.0, 1.0]);
        let (trace, notes) = read(switch(&mut (0..300).filter(|k| *k != 200)).as_bytes(), &reading).unwrap();
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert_eq!(trace.column("vehicle.yaw_rate").unwrap()[99..101], [0.0, 1.0]);
        // The time of a step is uncertain where rows are missing.
        let (_, notes) = read(switch(&mut (0..300).filter(|k| !(90..120).contains(k))).as_bytes(), &reading).unwrap();
        assert!(
            notes[1]
                .starts_with("`vehicle.yaw_rate` begins in the gap from 0.89 s to 1.2 s: this time, and everything"),
            "{notes:?}"
        );
        let long = "time,vehicle.yaw_rate\n0,1\n0.1,1\n0.9,1\n";
        let reading = Reading { resample: Some(Resample::Median), ..Reading::default() };
        let error = read(long.as_bytes(), &reading).unwrap_err();
        assert!(error.starts_with("a.csv: the file has a gap from 0.1 s to 0.9 s; gaps of more than 0.5 s"), "{error}");
        // Clock jitter of a third of a step.
        let (_, notes) = read(b"time,vehicle.yaw_rate\n0,1\n0.13,1\n0.17,1\n0.3,1\n", &Reading::default()).unwrap();
        assert_eq!(notes.len(), 1);
        assert!(notes[0].starts_with("the row at 0.13 s is off by 30 % of the mean distance"), "{notes:?}");
        // Rounding to the digits in the file is not noted.
        assert_eq!(read(b"time,vehicle.yaw_rate\n0,1\n0.01001,1\n0.02,1\n", &Reading::default()).unwrap().1, [""; 0]);
    }

    #[test]
    fn mistakes_have_a_place() {
        for (text, expected) in [
            (&b""[..], "a.csv: the file has no header"),
            (b"\n", "a.csv: the file has no header"),
            (b"a;b\n0;1\n", "a.csv: the file has no column `time`, but `a`, `b`"),
            (b"time,vehicle.yaw_rate,vehicle.yaw_rate\n0,1,1\n", "a.csv: there are two columns `vehicle.yaw_rate`"),
            (b"time,a\n0,1\n0.1\n", "a.csv:3: line 3 has 1 fields, the header 2"),
            (
                b"time,vehicle.yaw_rate\n0,1\n0.1,x\n",
                "a.csv:3: `x` at line 3, column `vehicle.yaw_rate`, is not a number",
            ),
            (b"\x1f\x8bnothing", "a.csv: the file cannot be decompressed: "),
        ] {
            let error = read(text, &Reading::default()).unwrap_err();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
