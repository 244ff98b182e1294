//! Processes that execute FMUs, so that one that crashes, exits or hangs costs its work and nothing else.
//!
//! A program starts itself as a worker ([`Launch`]). A worker loads libraries once and keeps them. It gets its work over a
//! private connection hidden from FMUs (`connection`, [`message`]) and announces every call on a board in a file
//! ([`loader::calls`](crate::loader::calls)), which outlives it. [`serve_requests`] is its side, [`Process`] that of the
//! process that starts it, which watches the board and ends a worker whose step takes too long.
//!
//! The content of requests is up to the crate that sends them.
//!
//! Nothing an FMU prints reaches the connection: its standard output and error are one pipe, read line by line (`output`).
//! A worker ends when its connection is closed, that is, also when the process that started it is killed. On Linux a process
//! between the two (`supervisor`) ends whatever the worker leaves behind, and a sandbox (`sandbox`) keeps FMUs from the rest of the
//! machine if [`Settings`] ask for it.

mod connection;
#[cfg(target_os = "linux")]
mod family;
mod memory;
pub mod message;
mod output;
mod process;
#[cfg(target_os = "linux")]
mod sandbox;
mod serve;
mod setup;
#[cfg(target_os = "linux")]
mod supervisor;

pub use memory::memory_share;
pub use output::Printed;
pub use process::{Ended, Launch, Process, Settings, Watch};
pub use serve::{Replies, hand_over, serve as serve_requests};
pub use setup::Incident;
