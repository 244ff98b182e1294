//! Worker processes, which execute FMUs. If an FMU crashes, exits or hangs, only the work of its worker is lost.
//!
//! A program starts itself as a worker ([`Launch`]). A worker loads libraries once and keeps them. It receives requests
//! over a private connection, which FMUs do not see (`connection`, [`message`]), and records every call on a call board
//! in a file ([`loader::calls`](crate::loader::calls)), which is not lost if the worker crashes. [`serve_requests`] is
//! the worker's side. [`Process`] is the side of the parent, which reads the board and ends a worker whose step takes
//! too long. The crate that sends requests defines their content.
//!
//! Output that an FMU prints does not reach the connection: standard output and error are a pipe, which is read line by
//! line (`output`). A worker ends when its connection is closed, and therefore also when its parent is killed. On
//! Linux, a process between parent and worker (`supervisor`) ends all processes that the worker leaves behind, and a
//! sandbox (`sandbox`), if [`Settings`] request it, protects the machine from FMUs.

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
