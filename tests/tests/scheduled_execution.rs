//! Scheduled execution by the importer. Reference: the published model Clocks of the Reference FMUs, whose importer
//! activates `inClock1` every second, `inClock2` at 0, 1, 8 and 9 s with `input2` = 10, and `inClock3` when it is due.

use fmu_import::c_api::Reference;
use fmu_import::description::{Interface, IntervalVariability};
use fmu_import::fmu::Fmu;
use fmu_import::loader::Instance;
use tests::{ok, workspace};

/// Ticks of the three clocks and their sum, `result2`, `output3`; at each call of `clockUpdate`: true if `inClock3` has
/// a new interval, and true if `outClock` has ticked.
type Row = ([i32; 6], &'static [(bool, bool)]);

const EXPECTED: [Row; 10] = [
    ([1, 1, 0, 2, 10, 0], &[]),
    ([2, 2, 0, 4, 20, 0], &[]),
    ([3, 2, 0, 5, 20, 0], &[(false, true)]),
    ([4, 2, 0, 6, 20, 0], &[]),
    ([5, 2, 1, 8, 20, 1000], &[(true, false)]),
    ([6, 2, 1, 9, 20, 1000], &[]),
    ([7, 2, 1, 10, 20, 1000], &[(false, true)]),
    ([8, 2, 1, 11, 20, 1000], &[]),
    ([9, 3, 1, 13, 30, 1000], &[]),
    ([10, 4, 1, 15, 40, 1000], &[(false, true)]),
];

#[test]
fn the_scheduler_reproduces_the_published_run() {
    // FMUs of another exporter, such as the published one, with `CLOCKS_FMU=PATH`.
    let folder = std::env::var_os("CHASSIS_FMU3_DIR").map_or_else(|| workspace().join("target/fmu3"), Into::into);
    let path = std::env::var_os("CLOCKS_FMU").map_or_else(|| folder.join("Clocks.fmu"), Into::into);
    let fmu = Fmu::open_for(path, Interface::ScheduledExecution).expect("run `cargo fmu pack --fmi 3 Clocks`");
    let description = fmu.description();
    let reference = |name: &str| {
        let clock = description.clocks.iter().find(|clock| clock.name == name).map(|clock| clock.reference);
        clock.unwrap_or_else(|| description.variable(name).expect("a variable").reference)
    };
    let [first, second, third, out] = ["inClock1", "inClock2", "inClock3", "outClock"].map(reference);
    let mut instance = fmu.instantiate("clocks").expect("an instance");
    ok(instance.setup_experiment(0.0, None));
    ok(instance.enter_initialization_mode());
    ok(instance.exit_initialization_mode());
    let counters = ["inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks", "result2", "output3"];
    let counters = counters.map(reference);
    for (time, (values, updates)) in (0_u8..).zip(EXPECTED) {
        let time = f64::from(time);
        let mut found = Vec::new();
        let mut activate = |instance: &mut Instance, clock: Reference| {
            let activation = ok(instance.activate_partition(clock, time));
            assert_eq!(activation.locks, 0);
            if activation.updates > 0 {
                let asked = instance.asked_intervals().iter().find(|asked| asked.clock == third);
                found.push((asked.is_some_and(|asked| asked.qualifier == 2), instance.is_active(out)));
            }
        };
        ok(instance.set_integer(&[reference("input2")], &[10]));
        // In the order of their priorities.
        while let Some(&clock) = instance.due_clocks(time, 1.0).first() {
            activate(&mut instance, clock);
            if clock == first && [0.0, 1.0, 8.0, 9.0].contains(&time) {
                activate(&mut instance, second);
            }
        }
        let mut counts = [0; 6];
        ok(instance.get_integer(&counters, &mut counts));
        assert_eq!((counts, &found[..]), (values, updates), "at {time} s");
    }
    let kinds = [first, third].map(|reference| description.clocks.iter().find(|clock| clock.reference == reference));
    let kinds = kinds.map(|clock| clock.map(|clock| clock.interval_variability));
    assert_eq!(kinds, [Some(IntervalVariability::Constant), Some(IntervalVariability::Countdown)]);
}
