//! Processes that execute FMUs, so that one that crashes, exits or hangs costs its run and nothing else.
//!
//! The executable of this project starts itself as a worker ([`Launch`]). A worker loads libraries once and keeps them; it
//! gets its work over a private connection that no FMU knows of (`protocol`, `connection`) and announces every call on
//! a board in a file (`loader::calls`), which outlives it. [`serve`] is its side, `process` and `pool` are that of the
//! process that starts it: it watches the board, ends a worker whose step takes too long, and replaces it.
//!
//! Nothing an FMU prints reaches the protocol: its standard output and error are one pipe, read line by line (`output`).
//! A worker ends when its connection is closed, that is, also when the process that started it is killed.

mod connection;
mod output;
mod pool;
mod process;
mod protocol;
mod serve;

pub use output::Printed;
pub use pool::{Failure, Finish, Pool, Task};
pub use process::{Launch, Settings, check, linearize, trials};
pub use serve::serve;
