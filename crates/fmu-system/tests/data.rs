//! Reading data files. The references in `tests/references/reader` are small files with the expected signals or error.

use fmu_import::description::BaseUnit;
use fmu_system::data::unit::Target;
use fmu_system::data::{Channel, Duplicates, Encoding, Format, Offset, Table, TimeColumn, Trigger};
use fmu_system::run::Linear;
use serde_json::Value;
use std::io::Write as _;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/references/reader")
}

fn parse(text: &str) -> Table {
    Table::parse("a.csv", text.as_bytes(), &Format::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Times and values of a column, without units.
fn signal(table: &Table, options: &TimeColumn, channel: &Channel<'_>) -> (Vec<f64>, Vec<f64>) {
    let clock = table.times(options).unwrap_or_else(|error| panic!("{error}"));
    let signal = table.signal(&clock, channel, &Target::default()).unwrap_or_else(|error| panic!("{error}"));
    (signal.times.to_vec(), signal.values.to_vec())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}: {found:?}, not {expected:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{what}: {found}, not {expected}");
    }
}

/// All files of the reference; tolerance 1e-12.
#[test]
fn the_reference_files_are_read() {
    let text = std::fs::read_to_string(folder().join("expected.json")).unwrap();
    let entries: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    for (key, entry) in &entries {
        let (file, variant) = key.split_once(' ').unwrap_or((key, ""));
        let path = folder().join(file);
        let request = &entry["request"];
        let number = |name: &str, default: f64| request[name].as_f64().unwrap_or(default);
        let options = TimeColumn {
            column: (file == "german.csv").then(|| "Zeit".to_owned()),
            offset: Offset::Add(number("time_offset", 0.0)),
            duplicates: match variant {
                "duplicates=first" => Duplicates::First,
                "duplicates=last" => Duplicates::Last,
                "duplicates=mean" => Duplicates::Mean,
                _ => Duplicates::Error,
            },
            ..TimeColumn::default()
        };
        let read = |name: &str, unit: &str| {
            let table = Table::read(&path, &Format::default())?;
            let clock = table.times(&options)?;
            let column = match (file, name) {
                ("german.csv", "steer") => "Lenkrad",
                ("german.csv", "yaw") => "Gier",
                _ => name,
            };
            let channel = Channel {
                unit: request["unit"].as_str(),
                scale: number("scale", 1.0),
                offset: number("offset", 0.0),
                sign: number("sign", 1.0),
                delay: number("delay", 0.0),
                zero: request["zero"].as_array().map(|zero| [0, 1].map(|end| zero[end].as_f64().unwrap())),
                ..Channel::new(column)
            };
            let has_unit = channel.unit.is_some() || matches!(file, "german.csv" | "tab_utf16.csv");
            let target = if has_unit { Target::named(unit) } else { Target::default() };
            // The tab-separated file has the units of the variables.
            let channel = Channel {
                unit: channel.unit.or((file == "tab_utf16.csv").then_some(if name == "steer" {
                    "deg"
                } else {
                    "deg/s"
                })),
                ..channel
            };
            table.signal(&clock, &channel, &target).map(|signal| (table.found(), signal))
        };
        if let Some(expected) = entry["error"].as_str() {
            let errors: Vec<String> = [("steer", "rad"), ("yaw", "rad/s")]
                .iter()
                .filter_map(|(name, unit)| read(name, unit).err())
                .map(|error| error.to_string())
                .collect();
            let plain = errors.join("\n").replace(", column `steer`,", "");
            assert!(
                errors.join("\n").contains(expected) || plain.contains(expected),
                "{key}: {errors:?}, not {expected}"
            );
            continue;
        }
        for (name, expected) in entry["signals"].as_object().unwrap() {
            let unit = if name == "steer" { "rad" } else { "rad/s" };
            let (found, signal) = read(name, unit).unwrap_or_else(|error| panic!("{key}: {error}"));
            assert_close(&signal.times, &numbers(&expected["time"]), key);
            assert_close(&signal.values, &numbers(&expected["value"]), key);
            if let Some(info) = entry["info"].as_object() {
                let encoding = match found.encoding {
                    Encoding::Utf8 => "utf-8",
                    Encoding::Utf8Marked => "utf-8-sig",
                    Encoding::Utf16 => "utf-16",
                    Encoding::Windows1252 => "cp1252",
                };
                assert_eq!(info["encoding"], encoding, "{key}");
                assert_eq!(info["delimiter"], found.delimiter.to_string(), "{key}");
                assert_eq!(info["decimal"], found.decimal.to_string(), "{key}");
                assert_eq!(info["rows"], found.rows, "{key}");
            }
        }
    }
}

#[test]
fn a_compressed_file_is_read_like_a_plain_one() {
    let plain = std::fs::read(folder().join("semicolon_point.csv")).unwrap();
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&plain).unwrap();
    let packed = encoder.finish().unwrap();
    let read = |bytes: &[u8]| {
        let table = Table::parse("a", bytes, &Format::default()).unwrap();
        signal(&table, &TimeColumn::default(), &Channel::new("steer"))
    };
    assert_eq!(read(&packed), read(&plain));
    let error = Table::parse("a.gz", &packed[..packed.len() - 9], &Format::default()).unwrap_err().to_string();
    assert!(error.starts_with("a.gz: the file cannot be decompressed"), "{error}");
}

/// Reference: RFC 4180 for quotation marks; ends of lines of Unix, Windows and old Macintosh.
#[test]
fn quotes_comments_and_ends_of_lines() {
    for end in ["\n", "\r\n", "\r"] {
        let lines = ["% made by hand", "time,\"a, \"\"b\"\"\",note", "", "0,1,\"x,", "y\"", "# more", " 1 , 2 ,z", ""];
        let table = parse(&lines.join(end));
        let expected = (vec![0.0, 1.0], vec![1.0, 2.0]);
        assert_eq!(signal(&table, &TimeColumn::default(), &Channel::new("a, \"b\"")), expected, "{end:?}");
    }
    for (text, expected) in [
        ("time,a\n0,\"1\n", "a.csv:2: a quotation mark is not closed"),
        ("time,a\n0,1\n\n# x\n1\n", "a.csv:5: line 5 has 1 fields, the header 2"),
        ("", "a.csv: the file has no header"),
        ("# only\n", "a.csv: the file has no header"),
    ] {
        let error = Table::parse("a.csv", text.as_bytes(), &Format::default()).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn units_come_from_a_line_or_from_brackets() {
    let units = |text: &str| {
        let columns: Vec<(String, Option<String>)> =
            parse(text).columns().iter().map(|column| (column.name.clone(), column.unit.clone())).collect();
        columns
    };
    let named = |name: &str, unit: Option<&str>| (name.to_owned(), unit.map(str::to_owned));
    assert_eq!(
        units("time;Speed [m/s];a[2,1];b [1];c[m]\n0;1;2;3;4\n"),
        [
            named("time", None),
            named("Speed", Some("m/s")),
            named("a[2,1]", None),
            named("b", Some("1")),
            named("c", Some("m"))
        ]
    );
    assert_eq!(units("t;v\ns;[km/h]\n0;1\n"), [named("t", Some("s")), named("v", Some("km/h"))]);
    // A line of text above another line of text is not a line of units.
    assert_eq!(units("t;v\ns;m\nx;y\n"), [named("t", None), named("v", None)]);
}

/// Factors of the International System of Units; `g` is 9.80665 m/s2, 1 mph = 0.44704 m/s.
#[test]
fn units_are_converted_if_their_dimensions_agree() {
    for (from, to, value, expected) in [
        ("deg", "rad", 180.0, std::f64::consts::PI),
        ("°/s", "rad/s", 180.0, std::f64::consts::PI),
        ("rpm", "rad/s", 60.0, 2.0 * std::f64::consts::PI),
        ("km/h", "m/s", 36.0, 10.0),
        ("mph", "m/s", 1.0, 0.44704),
        ("g", "m/s2", 2.0, 19.6133),
        ("m/s²", "m/s2", 2.0, 2.0),
        ("m/s^2", "g", 9.80665, 1.0),
        ("kN·m", "N.m", 2.0, 2000.0),
        ("Nm", "N.m", 2.0, 2.0),
        ("bar", "kPa", 2.0, 200.0),
        ("%", "1", 5.0, 0.05),
        ("°C", "K", 25.0, 298.15),
        ("K", "degC", 0.0, -273.15),
        ("t", "kg", 1.5, 1500.0),
    ] {
        let conversion = Target::named(to).from(from).unwrap_or_else(|(message, _)| panic!("{from}: {message}"));
        let found = conversion.factor * value + conversion.offset;
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{value} {from} are {found} {to}, not {expected}");
    }
    let relative = Target { is_relative: true, ..Target::named("K") };
    assert_eq!(relative.from("degC").unwrap(), Linear::IDENTITY);
    for (from, to, expected) in [
        ("deg", "m", "`deg` and `m` measure different quantities"),
        ("Hz", "rad/s", "`Hz` and `rad/s` measure different quantities"),
        ("furlong", "m", "the unit `furlong` cannot be converted to `m`"),
    ] {
        assert_eq!(Target::named(to).from(from).unwrap_err().0, expected);
    }
    // For names from other languages and tools, the help suggests the intended unit, not one with a similar spelling.
    for (from, to, meant) in [("Grad", "rad", "deg"), ("1/MIN", "rad/s", "rpm"), ("m/s/s", "m/s2", "m/s2")] {
        let help = Target::named(to).from(from).unwrap_err().1;
        assert!(help.starts_with(&format!("did you mean `{meant}`? ")), "{help}");
    }
    // A unit name that only the FMU defines.
    let own = Target {
        name: Some("klaf".into()),
        base: Some(BaseUnit { exponents: [0, 1, 0, 0, 0, 0, 0, 0], factor: 2.0, offset: 0.0 }),
        ..Target::default()
    };
    assert_eq!(own.from("m").unwrap().factor, 0.5);
}

#[test]
fn times_are_shifted_and_triggered() {
    let table = parse("Time,a,b\n0,0,1\n100,0,\n200,10,2\n300,20,3\n");
    let options = |offset, trigger| TimeColumn { unit: Some("ms".into()), offset, trigger, ..TimeColumn::default() };
    let times = |options: &TimeColumn| table.times(options).unwrap().times().to_vec();
    assert_close(&times(&options(Offset::Add(-0.1), None)), &[-0.1, 0.0, 0.1, 0.2], "offset");
    let first = TimeColumn { offset: Offset::First, ..TimeColumn::default() };
    assert_eq!(parse("t,a\n5,1\n6,1\n").times(&first).unwrap().times(), [0.0, 1.0]);
    // a passes 15 in the middle between 0.2 s and 0.3 s; b never falls.
    let trigger = |column: &str, level, falls| Some(Trigger { column: column.into(), level, falls });
    assert_close(&times(&options(Offset::Add(1.0), trigger("a", 15.0, false))), &[0.75, 0.85, 0.95, 1.05], "trigger");
    let error = table.times(&options(Offset::Add(0.0), trigger("b", 2.0, true))).unwrap_err().to_string();
    assert!(error.contains("the trigger column `b` never falls below 2"), "{error}");
}

#[test]
fn what_is_not_used_may_hold_anything() {
    let table = parse("time,a,Marker,twice,twice\n0,1,start,1,2\n1,inf,end,1,2\n");
    let clock = table.times(&TimeColumn::default()).unwrap();
    let error = |name: &str| table.signal(&clock, &Channel::new(name), &Target::default()).unwrap_err().to_string();
    assert!(error("a").starts_with("a.csv:3: `inf` at line 3, column `a`, is not a number"), "{}", error("a"));
    assert!(error("twice").starts_with("a.csv: there are two columns `twice`"));
    assert!(error("b").starts_with("a.csv: there is no column `b`; the columns are `time`, `a`"), "{}", error("b"));
    assert!(error("twise").starts_with("a.csv: there is no column `twise`; did you mean `twice`?"));
    // The units after a name and in the line below may be two spellings of the same unit, but not different units.
    let table = parse("time,a [m/s2],b [deg]\ns,m/s^2,rad\n0,1,2\n");
    let clock = table.times(&TimeColumn::default()).unwrap();
    let signal = |name: &str| table.signal(&clock, &Channel::new(name), &Target::default());
    assert!(signal("a").is_ok());
    let error = signal("b").unwrap_err().to_string();
    assert_eq!(
        error,
        "a.csv: the column `b` has the unit `deg` after its name and `rad` below it; remove the wrong one"
    );
    for (text, expected) in [
        ("zeit,a\n0,1\n", "a.csv: the file has no column `time`, but `zeit`, `a`; name the time column"),
        ("time,a\n", "a.csv: the file has no rows"),
        (
            "Logger 5\ntime;a\n0;1\n",
            "a.csv: the file has no column `time`, but `Logger 5`; the first line names the columns",
        ),
        ("time,a\n0,1\n,2\n", "a.csv:3: the time is missing at line 3"),
        ("time (km),a\n0,1\n", "a.csv: column `time`: `km` and `s` measure different quantities"),
        ("time [km],a\n0,1\n", "a.csv: column `time`: `km` and `s` measure different quantities"),
    ] {
        let error = parse(text).times(&TimeColumn::default()).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}

/// Reference: the notations of loggers; a word in round brackets belongs to the name.
#[test]
fn round_brackets_hold_units_too() {
    let table = parse("Time (ms),Yaw rate (°/s),Force (front),a(s)\n0,1,2,3\n");
    let found: Vec<(&str, Option<&str>)> =
        table.columns().iter().map(|column| (column.name.as_str(), column.unit.as_deref())).collect();
    assert_eq!(found, [("Time", Some("ms")), ("Yaw rate", Some("°/s")), ("Force (front)", None), ("a", Some("s"))]);
}

/// Messages distinguish lines above the header and delimiters at the end of rows from missing cells.
#[test]
fn rows_of_other_lengths_have_a_remedy() {
    for (text, help) in [
        ("Logger 5;A\ntime;a;b\n0;1;2\n", "remove the lines above it"),
        ("time;a\n0;1;\n1;2;\n", "remove the delimiter at the end of the rows, or add one to the header"),
        ("time;a\n0;1\n1\n", "give every row a cell for each column; a cell may be empty"),
    ] {
        let error = Table::parse("a.csv", text.as_bytes(), &Format::default()).unwrap_err();
        assert!(error.lines()[0].ends_with(help), "{:?}", error.lines());
    }
}

#[test]
fn the_format_can_be_given_where_detection_fails() {
    let text = "1;2;3\nmade by;nobody;x\ntime|a,b|c\n0|1,5|2\n";
    let format = Format { delimiter: Some('|'), decimal: Some(','), header: Some(3), encoding: Some(Encoding::Utf8) };
    let table = Table::parse("a.csv", text.as_bytes(), &format).unwrap();
    assert_eq!(signal(&table, &TimeColumn::default(), &Channel::new("a,b")), (vec![0.0], vec![1.5]));
}
