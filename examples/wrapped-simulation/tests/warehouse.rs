//! Compares the wrapped simulation with the equations of the stock.

use std::path::Path;

use fmu::Stateful as _;
use wrapped_simulation::warehouse::{OrderUpTo, Warehouse};
use wrapped_simulation::{U, WrappedSimulation};

const DAY: f64 = 86_400.0;

/// Reference: with a constant demand d, a lot that is a multiple of d and a level of at least d * lead time, the stock
/// at the end of a day is a sawtooth with the period lot / d. Its lowest value is level - d * (lead time - 1), and its
/// highest value is greater by lot - d.
#[test]
fn the_stock_is_a_sawtooth() {
    let model = WrappedSimulation::default();
    let mut warehouse = model.start(Path::new("")).expect("it starts");
    let inputs = U { demand: 10 };
    let mut stock = Vec::new();
    for day in 0..100 {
        model.step(&mut warehouse, &inputs, f64::from(day) * DAY, DAY).expect("a step");
        let y = model.outputs(&warehouse);
        stock.push(y.stock);
        // Nothing can be sold until the first delivery.
        assert_eq!(y.lost, 10 * (day + 1).min(2));
    }
    let settled = &stock[50..];
    assert!(settled.windows(6).all(|days| days[0] == days[5]), "{settled:?}");
    assert_eq!((settled.iter().min(), settled.iter().max()), (Some(&20), Some(&60)));
}

/// A saved state continues like the original, through a clone and through bytes.
#[test]
fn a_saved_state_continues() {
    let save = WrappedSimulation::SERIALIZE.expect("it can be serialized");
    let mut warehouse = Warehouse::new(Box::new(OrderUpTo { level: 80, interval: 3, waited: 1 }), 2);
    let follow = |mut warehouse: Warehouse| {
        let day = |k: u32| {
            warehouse.advance_day(if k.is_multiple_of(3) { "nuts" } else { "bolts" }, k % 7);
            (warehouse.stock("nuts"), warehouse.stock("bolts"), warehouse.on_order("bolts"), warehouse.lost())
        };
        (0..50).map(day).collect::<Vec<_>>()
    };
    warehouse.set_stock("nuts", 5);
    (0..7).for_each(|_| warehouse.advance_day("bolts", 4));
    let copy = (save.load)(&(save.save)(&warehouse).expect("bytes")).expect("a state");
    let expected = follow(warehouse.clone());
    assert_eq!(follow(copy), expected);
    assert_eq!(follow(warehouse), expected);
}

#[test]
fn the_step_size_does_not_change_the_days() {
    let model = WrappedSimulation::default();
    let run = |steps: u32| {
        let mut warehouse = model.start(Path::new("")).expect("it starts");
        let step = 12.0 * DAY / f64::from(steps);
        for k in 0..steps {
            model.step(&mut warehouse, &U { demand: 7 }, f64::from(k) * step, step).expect("a step");
        }
        let y = model.outputs(&warehouse);
        (y.stock, y.on_order, y.lost)
    };
    assert_eq!(run(12), run(1));
    assert_eq!(run(12), run(7));
    assert_eq!(run(12), run(1000));
}
