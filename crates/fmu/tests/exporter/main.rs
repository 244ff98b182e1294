//! Tests of the exporter with small models: the safe instance, the C interface, the description.

mod allocations;
mod arrays;
mod c_interface;
mod comparisons;
mod derivatives;
mod description;
mod events;
mod exact;
mod failures;
mod fmi3;
mod independence;
mod minimal;
mod model_exchange;
mod models;
mod resources;
mod solvers;
mod sources;
mod stateful;
mod states;
mod structure;
mod time;
mod time_events;
mod types;
mod units;
mod values;
