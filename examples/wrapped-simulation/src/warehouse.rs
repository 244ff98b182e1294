//! The simulation as it was before it became an FMU: it does not use the crate `fmu`.

use std::collections::HashMap;
use std::fmt::Debug;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Decides how much to order.
pub trait Policy: Debug + Send {
    /// Pieces to order. `stock` includes the pieces on order.
    fn order(&mut self, stock: u32) -> u32;
    /// The policy as a value that can be saved.
    fn saved(&self) -> Saved;
}

/// A policy as a value.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Saved {
    /// [`ReorderPoint`].
    ReorderPoint(ReorderPoint),
    /// [`OrderUpTo`].
    OrderUpTo(OrderUpTo),
}

impl Saved {
    /// Converts the value to a policy.
    #[must_use]
    pub fn policy(self) -> Box<dyn Policy> {
        match self {
            Self::ReorderPoint(policy) => Box::new(policy),
            Self::OrderUpTo(policy) => Box::new(policy),
        }
    }
}

/// Orders a lot when the stock has fallen to a level.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct ReorderPoint {
    /// Stock that causes an order.
    pub level: u32,
    /// Size of an order.
    pub lot: u32,
}

/// Fills the stock up at fixed intervals.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct OrderUpTo {
    /// Stock after an order.
    pub level: u32,
    /// Days between two orders, at least 1.
    pub interval: u32,
    /// Days since the last order.
    pub waited: u32,
}

impl Policy for ReorderPoint {
    fn order(&mut self, stock: u32) -> u32 {
        if stock <= self.level { self.lot } else { 0 }
    }
    fn saved(&self) -> Saved {
        Saved::ReorderPoint(*self)
    }
}

impl Policy for OrderUpTo {
    fn order(&mut self, stock: u32) -> u32 {
        self.waited += 1;
        if self.waited < self.interval {
            return 0;
        }
        self.waited = 0;
        self.level.saturating_sub(stock)
    }
    fn saved(&self) -> Saved {
        Saved::OrderUpTo(*self)
    }
}

impl Clone for Box<dyn Policy> {
    fn clone(&self) -> Self {
        self.saved().policy()
    }
}

impl Serialize for dyn Policy {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.saved().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Box<dyn Policy> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Saved::deserialize(deserializer).map(Saved::policy)
    }
}

/// An order on its way.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Delivery {
    good: String,
    pieces: u32,
    days_left: u32,
}

/// Goods in stock and on order.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Warehouse {
    stock: HashMap<String, u32>,
    deliveries: Vec<Delivery>,
    policy: Box<dyn Policy>,
    lead_time: u32,
    lost: u32,
}

impl Warehouse {
    /// An empty warehouse that receives orders after `lead_time` days.
    #[must_use]
    pub fn new(policy: Box<dyn Policy>, lead_time: u32) -> Self {
        Self { stock: HashMap::new(), deliveries: Vec::new(), policy, lead_time, lost: 0 }
    }

    /// Sets the stock of a good.
    pub fn set_stock(&mut self, good: &str, pieces: u32) {
        self.stock.insert(good.to_owned(), pieces);
    }

    /// Simulates a day: deliveries arrive, up to `demand` pieces of a good are sold, and the policy places an order.
    pub fn advance_day(&mut self, good: &str, demand: u32) {
        let stock = &mut self.stock;
        self.deliveries.retain_mut(|delivery| {
            delivery.days_left -= 1;
            if delivery.days_left == 0 {
                *stock.entry(delivery.good.clone()).or_insert(0) += delivery.pieces;
            }
            delivery.days_left > 0
        });
        let left = stock.entry(good.to_owned()).or_insert(0);
        let sold = demand.min(*left);
        *left -= sold;
        self.lost += demand - sold;
        let pieces = self.policy.order(*left + self.on_order(good));
        if pieces > 0 {
            self.deliveries.push(Delivery { good: good.to_owned(), pieces, days_left: self.lead_time });
        }
    }

    /// Pieces of a good in stock.
    #[must_use]
    pub fn stock(&self, good: &str) -> u32 {
        self.stock.get(good).copied().unwrap_or(0)
    }

    /// Pieces of a good on order.
    #[must_use]
    pub fn on_order(&self, good: &str) -> u32 {
        self.deliveries.iter().filter(|delivery| delivery.good == good).map(|delivery| delivery.pieces).sum()
    }

    /// Pieces that could not be sold.
    #[must_use]
    pub fn lost(&self) -> u32 {
        self.lost
    }
}
