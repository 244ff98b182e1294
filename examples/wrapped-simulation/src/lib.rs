//! `WrappedSimulation`: an existing simulation with an FMI interface. The README describes it.

pub mod warehouse;

use fmu::prelude::*;

use warehouse::{ReorderPoint, Warehouse};

/// Longest step in days. A longer step is a mistake, and an importer should not have to wait for it.
const MOST_DAYS: i64 = 10_000;

/// Parameters.
#[derive(Parameters)]
pub struct WrappedSimulation {
    /// Stock that causes an order
    #[var(start = 30, min = 0)]
    pub level: i32,
    /// Size of an order
    #[var(start = 50, min = 1)]
    pub lot: i32,
    /// Days from order to delivery
    #[var(start = 2, min = 1)]
    pub lead_time: i32,
}

/// Inputs.
#[derive(Inputs)]
pub struct U {
    /// Pieces wanted per day
    #[var(start = 10)]
    pub demand: i32,
}

/// Outputs.
#[derive(Outputs)]
pub struct Y {
    /// Pieces in stock
    pub stock: i32,
    /// Pieces on order
    pub on_order: i32,
    /// Pieces that could not be sold so far
    pub lost: i32,
}

/// Warehouse with orders and deliveries
#[fmu::model(stop_time = 864_000.0, step_size = 86_400.0, serialize)]
impl Stateful for WrappedSimulation {
    type Inputs = U;
    type Outputs = Y;
    type Simulation = Warehouse;

    fn start(&self, _resources: &std::path::Path) -> Result<Warehouse, String> {
        let policy = ReorderPoint { level: self.level as u32, lot: self.lot as u32 };
        Ok(Warehouse::new(Box::new(policy), self.lead_time as u32))
    }

    fn step(&self, warehouse: &mut Warehouse, inputs: &U, time: f64, step: f64) -> Result<(), String> {
        let day = |time: f64| (time / 86_400.0).round() as i64;
        let days = day(time)..day(time + step);
        if days.end.saturating_sub(days.start) > MOST_DAYS {
            return Err(format!("a step must be at most {MOST_DAYS} days long, got {step} s"));
        }
        for _ in days {
            warehouse.advance_day("bolts", inputs.demand.max(0).cast_unsigned());
        }
        Ok(())
    }

    fn outputs(&self, warehouse: &Warehouse) -> Y {
        let [stock, on_order, lost] =
            [warehouse.stock("bolts"), warehouse.on_order("bolts"), warehouse.lost()].map(|pieces| pieces as i32);
        Y { stock, on_order, lost }
    }
}
