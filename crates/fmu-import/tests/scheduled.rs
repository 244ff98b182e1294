//! Scheduled execution with an FMU built from C. Reference: FMI 3.0.2, section 5.2; times and counts in closed form.
#![cfg(unix)]

#[path = "support/decay.rs"]
mod decay;

use decay::Decay;
use fmu_import::description::{FmiVersion, Interface};
use fmu_import::fmu::Fmu;
use fmu_import::loader::{Activation, CallProblem, Instance, Status};
use tempfile::TempDir;

// Value references of `clocks.c`.
const TIME: u32 = 0;
const EVERY: u32 = 1;
const TIMER: u32 = 2;
const VARYING: u32 = 3;
const ASKED: u32 = 4;
const THIRD: u32 = 5;
const U: u32 = 6;
const SUM: u32 = 7;
const TICKS: u32 = 8;
const GAIN: u32 = 9;
const KEPT: u32 = 10;

fn started(defects: &[&str], edits: &[(&str, &str)]) -> (TempDir, Instance) {
    let folder = TempDir::new().unwrap();
    let build = Decay { has_clocks: true, defects, edits, ..Decay::new(FmiVersion::V3) };
    let fmu = Fmu::open_for(build.pack(folder.path()), Interface::ScheduledExecution).unwrap();
    let mut instance = fmu.instantiate("one").unwrap();
    instance.setup_experiment(0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    (folder, instance)
}

fn real(instance: &mut Instance, reference: u32) -> f64 {
    let mut value = [f64::NAN];
    instance.get_real(&[reference], &mut value).unwrap();
    value[0]
}

fn integer(instance: &mut Instance, reference: u32) -> i32 {
    let mut value = [-1];
    instance.get_integer(&[reference], &mut value).unwrap();
    value[0]
}

/// Number of ticks before a time: `every` at 0.25 s and then every 0.5 s, `timer` at each third of these ticks,
/// `varying` 0.3 s and 1 s after each full second.
fn ticks(before: f64) -> i32 {
    let every = (0..).take_while(|k| 0.25 + 0.5 * f64::from(*k) < before).count();
    let varying = (0..20).flat_map(|n| [f64::from(n) + 0.3, f64::from(n) + 1.0]).filter(|time| *time < before).count();
    i32::try_from(every + every / 3 + varying).unwrap()
}

/// The result does not depend on the steps: a partition runs at the time of its tick.
#[test]
fn steps_activate_partitions_at_their_times() {
    for (step, steps) in [(0.1, 80), (0.25, 32), (2.0, 4)] {
        let (_folder, mut instance) = started(&[], &[]);
        for k in 0..steps {
            let time = step * f64::from(k);
            instance.do_step(time, step).unwrap();
            // A tick at the end of the step belongs to the next one.
            assert_eq!(integer(&mut instance, TICKS), ticks(time + step - 1e-9), "{step} s, {time} s");
            // The output clock `third` ticks at each third tick of `every`: first at 1.25 s, then every 1.5 s.
            let thirds = |before: f64| ((before - 1.25) / 1.5).ceil().max(0.0);
            let mut has_ticked = [-1];
            instance.get_boolean(&[THIRD], &mut has_ticked).unwrap();
            assert_eq!(has_ticked[0] != 0, thirds(time + step - 1e-9) > thirds(time - 1e-9), "{step} s, {time} s");
        }
        assert!((real(&mut instance, TIME) - 7.75).abs() < 1e-9, "the time of the last activation");
    }
}

/// At 1 s, two clocks tick; that with the smaller number first.
#[test]
fn clocks_at_one_time_tick_in_the_order_of_their_priorities() {
    for (priority, last) in [("2", EVERY), ("0", VARYING)] {
        let every = format!("intervalDecimal=\"0.5\" shiftDecimal=\"0\" priority=\"{priority}\"");
        let edits = [("intervalDecimal=\"0.5\" shiftDecimal=\"0.25\" priority=\"2\"", every.as_str())];
        let (_folder, mut instance) = started(&["SHIFT=0"], &edits);
        instance.do_step(0.0, 1.0).unwrap();
        assert_eq!(instance.due_clocks(1.0, 1.0), if last == EVERY { [VARYING, EVERY] } else { [EVERY, VARYING] });
        instance.do_step(1.0, 0.1).unwrap();
        // `timer`, which `every` starts in its third tick, has the smallest number.
        let expected = if last == EVERY { TIMER } else { last };
        assert_eq!(integer(&mut instance, KEPT), expected as i32, "{priority}");
    }
}

/// Inputs and tunable parameters are set before an activation, and outputs are read after it; no Get follows a Set.
#[test]
fn values_are_set_before_an_activation() {
    let (_folder, mut instance) = started(&[], &[]);
    instance.set_real(&[U, GAIN], &[3.0, 5.0]).unwrap();
    assert_eq!([real(&mut instance, U), real(&mut instance, GAIN), real(&mut instance, SUM)], [3.0, 5.0, 0.0]);
    instance.do_step(0.0, 0.2).unwrap();
    assert_eq!(real(&mut instance, SUM), 0.0, "a triggered clock ticks when the importer activates it");
    let activation = instance.activate_partition(ASKED, 0.2).unwrap();
    assert_eq!(activation, Activation { updates: 0, locks: 0 });
    assert_eq!((real(&mut instance, SUM), integer(&mut instance, KEPT)), (15.0, 4));
    // The third tick of `every` makes an output clock tick and starts `timer` after 0 s.
    for (k, updates) in [(0, 0), (1, 0), (2, 1)] {
        let time = 0.25 + 0.5 * f64::from(k);
        assert_eq!(instance.activate_partition(EVERY, time).unwrap().updates, updates);
        assert_eq!(instance.is_active(THIRD), updates == 1);
    }
    assert_eq!(instance.due_clocks(1.25, 0.1), [TIMER, VARYING]);
    let error = instance.activate_partition(EVERY, 1.25).unwrap_err();
    assert_eq!((error.function, &error.problem), ("fmi3ActivateModelPartition", &CallProblem::Status(Status::Error)));
}

#[test]
fn a_restored_state_has_the_same_next_ticks() {
    let (_folder, mut instance) = started(&[], &[]);
    instance.do_step(0.0, 0.6).unwrap();
    let saved = instance.save_state().unwrap();
    for _ in 0..2 {
        instance.do_step(0.6, 1.4).unwrap();
        assert_eq!(integer(&mut instance, TICKS), ticks(2.0 - 1e-9));
        instance.restore_state(&saved).unwrap();
        assert_eq!(integer(&mut instance, TICKS), ticks(0.6));
    }
    instance.reset().unwrap();
    instance.setup_experiment(0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance.do_step(0.0, 2.0).unwrap();
    assert_eq!(integer(&mut instance, TICKS), ticks(2.0 - 1e-9));
}

/// A clock may tick once at one time.
#[test]
fn an_interval_of_0_at_the_tick_of_the_same_clock_is_an_error() {
    let (_folder, mut instance) = started(&["ENDLESS"], &[]);
    instance.do_step(0.0, 1.25).unwrap();
    let error = instance.do_step(1.25, 0.25).unwrap_err().to_string();
    assert!(error.ends_with("the clock `timer` is due twice at 1.25 s; start it with an interval above 0"), "{error}");
}
