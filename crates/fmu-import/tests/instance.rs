//! Opens FMUs and calls their functions. The FMUs are built from C in a temporary folder.
#![cfg(unix)]

mod support;

use fmu_import::fmu::{Fmu, FmuError};
use fmu_import::loader::{CallProblem, LoadError, Status};
use std::path::Path;
use support::Build;
use tempfile::TempDir;

#[test]
fn an_instance_has_the_functions_of_the_standard() {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(Build::new("Position", "y", "x").pack(folder.path())).unwrap();
    let mut instance = fmu.instantiate("one").unwrap();
    let mut other = fmu.instantiate("two").unwrap();
    // The instances keep the library loaded.
    drop(fmu);
    assert_eq!(instance.name(), "one");
    instance.setup_experiment(0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.set_real(&[2, 0], &[3.0, 5.0]).unwrap();
    instance.set_string(&[0], &["käse"]).unwrap();
    instance.exit_initialization_mode().unwrap();
    let strings = instance.get_string(&[0, 1]).unwrap();
    assert_eq!(strings[0], "käse");
    let note = strings[1].strip_prefix("file://").unwrap();
    assert_eq!(std::fs::read_to_string(Path::new(note).join("note.txt")).unwrap(), "here");

    let saved = instance.save_state().unwrap();
    instance.do_step(0.0, 0.5).unwrap();
    let mut x = [0.0];
    instance.get_real(&[1], &mut x).unwrap();
    assert_eq!(x, [7.5], "exact: 0.5 * (3 * 5)");
    instance.restore_state(&saved).unwrap();
    instance.get_real(&[1], &mut x).unwrap();
    assert_eq!(x, [0.0]);

    instance.do_step(0.0, 0.5).unwrap();
    instance.save_state_again(&saved).unwrap();
    let bytes = instance.serialize_state(&saved).unwrap();
    let restored = other.deserialize_state(&bytes).unwrap();
    other.restore_state(&restored).unwrap();
    other.get_real(&[1], &mut x).unwrap();
    assert_eq!(x, [7.5]);
    let error = other.restore_state(&saved).unwrap_err();
    assert!(matches!(error.problem, CallProblem::Arguments(_)), "{error}");
    instance.free_state(saved).unwrap();
    assert!(other.deserialize_state(&bytes[1..]).is_err());

    // dx'/du * 2 + dx'/dgain * 1 = 3 * 2 + 5 * 1. The numbers of unknowns and knowns differ on purpose.
    let mut result = [0.0];
    instance.get_directional_derivative(&[1], &[0, 2], &[2.0, 1.0], &mut result).unwrap();
    assert_eq!(result, [11.0]);

    let error = instance.get_real(&[1, 2], &mut x).unwrap_err();
    assert!(matches!(error.problem, CallProblem::Arguments(_)), "{error}");
    let error = instance.get_real(&[77], &mut x).unwrap_err();
    assert_eq!(error.problem, CallProblem::Status(Status::Error));
    assert!(instance.set_string(&[0], &["a\0b"]).is_err());
    let error = instance.cancel_step().unwrap_err();
    assert_eq!(error.problem, CallProblem::NotExported);

    instance.reset().unwrap();
    let mut flags = [0, 1];
    instance.set_boolean(&[0], &[1]).unwrap();
    instance.get_boolean(&[0, 1], &mut flags).unwrap();
    assert_eq!(flags, [1, 0]);
    instance.terminate().unwrap();
}

#[test]
fn after_a_fatal_status_nothing_is_called() {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(Build::new("Position", "y", "x").pack(folder.path())).unwrap();
    let mut instance = fmu.instantiate("one").unwrap();
    instance.set_integer(&[0], &[2]).unwrap();
    let error = instance.do_step(1.0, 0.1).unwrap_err();
    assert_eq!(error.problem, CallProblem::Status(Status::Fatal));
    let error = instance.terminate().unwrap_err();
    assert_eq!(error.problem, CallProblem::Dead);
}

#[test]
fn unusable_fmus_give_clear_errors() {
    let folder = TempDir::new().unwrap();
    let open = |build: &Build<'_>| Fmu::open(build.pack(folder.path()));
    let build = Build { version: "1.0", ..Build::new("Old", "u", "x") };
    let error = open(&build).unwrap_err();
    assert!(matches!(error, FmuError::Load { cause: LoadError::Version(_), .. }), "{error}");

    let build = Build { guid: "{another}", ..Build::new("Wrong", "u", "x") };
    let error = open(&build).unwrap().instantiate("w").unwrap_err();
    assert_eq!(error.to_string(), "`w`: fmi2Instantiate returned no instance\n  fmi2Error: wrong GUID");

    let build = Build { states: false, ..Build::new("Small", "u", "x") };
    let mut instance = open(&build).unwrap().instantiate("s").unwrap();
    let error = instance.save_state().unwrap_err();
    assert_eq!(error.to_string(), "`s`: the FMU does not export fmi2GetFMUstate");

    let build = Build { flags: "canBeInstantiatedOnlyOncePerProcess=\"true\"", ..Build::new("Single", "u", "x") };
    let fmu = open(&build).unwrap();
    let first = fmu.instantiate("a").unwrap();
    assert!(matches!(fmu.instantiate("b"), Err(FmuError::OnlyOnce(_))));
    drop(first);
    fmu.instantiate("b").unwrap();

    let text = folder.path().join("Text.fmu");
    std::fs::write(&text, "no archive").unwrap();
    assert!(matches!(Fmu::open(&text), Err(FmuError::Archive(_))));
}
