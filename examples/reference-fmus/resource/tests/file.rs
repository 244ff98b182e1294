//! The output is the code of the first character of the file.

use std::path::Path;

use fmu::simulation::ContinuousSimulation;
use resource::Resource;

/// Reference: the published FMU has y = 97, the code of `a`.
#[test]
fn the_output_is_the_first_character_of_the_file() {
    assert_eq!(ContinuousSimulation::new(Resource).expect("a file").outputs(&()).y, 97);
}

#[test]
fn a_missing_file_is_an_error_with_its_path() {
    let error = ContinuousSimulation::with_resources(Resource, Path::new("elsewhere")).expect_err("no file");
    assert!(error.contains(&Path::new("elsewhere").join("y.txt").display().to_string()), "{error}");
}
