//! Tests of the exporter with small models: the safe instance, the C interface, the description.

mod advancing;
mod allocations;
mod brief;
mod c_interface;
mod derivatives;
mod description;
mod failures;
mod models;
mod sources;
mod states;
mod time;
mod values;
