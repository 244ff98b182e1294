//! The connection between a worker and its parent.
//!
//! On Unix, the connection is a pair of sockets. A worker gets one end as its standard input. It moves this end to
//! another descriptor, which programs that the worker starts do not inherit, and replaces its standard input with
//! `/dev/null`. An FMU that uses standard streams therefore cannot disturb the protocol. On other systems, the worker
//! connects to the parent over the loopback interface, and sends a secret word that only this worker got.

use std::io;
#[cfg(not(unix))]
use std::io::{Read as _, Write as _};
use std::process::{Child, Command};

#[cfg(unix)]
pub(super) type Connection = std::os::unix::net::UnixStream;
#[cfg(not(unix))]
pub(super) type Connection = std::net::TcpStream;

/// Returns true if the error means that a read timed out.
pub(super) fn is_patience_over(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
}

#[cfg(unix)]
pub(super) fn spawn(mut command: Command) -> io::Result<(Child, Connection)> {
    let (ours, theirs) = Connection::pair()?;
    command.stdin(std::os::fd::OwnedFd::from(theirs));
    let child = command.spawn()?;
    Ok((child, ours))
}

#[cfg(unix)]
pub(super) fn accept() -> io::Result<Connection> {
    use std::os::fd::AsFd as _;
    let stream = Connection::from(io::stdin().as_fd().try_clone_to_owned()?);
    stream.peer_addr()?;
    rustix::stdio::dup2_stdin(std::fs::File::open("/dev/null")?)?;
    Ok(stream)
}

/// Environment variable with the port to which a worker connects and the secret word that it sends.
#[cfg(not(unix))]
const CALLBACK: &str = "CHASSIS_FMU_WORKER";

#[cfg(not(unix))]
pub(super) fn spawn(mut command: Command) -> io::Result<(Child, Connection)> {
    use std::hash::{BuildHasher as _, RandomState};
    let listener = std::net::TcpListener::bind((std::net::Ipv4Addr::LOCALHOST, 0))?;
    listener.set_nonblocking(true)?;
    // Each `RandomState` has 128 random bits.
    let word = format!("{:016x}{:016x}", RandomState::new().hash_one(1), RandomState::new().hash_one(2));
    command.env(CALLBACK, format!("{} {word}", listener.local_addr()?.port())).stdin(std::process::Stdio::null());
    let mut child = command.spawn()?;
    loop {
        match listener.accept() {
            Ok((mut stream, _)) => {
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(std::time::Duration::from_secs(1)))?;
                let mut said = vec![0; word.len()];
                if stream.read_exact(&mut said).is_ok() && said == word.as_bytes() {
                    stream.set_nodelay(true)?;
                    return Ok((child, stream));
                }
            }
            Err(error) if is_patience_over(&error) => std::thread::sleep(std::time::Duration::from_millis(5)),
            Err(error) => return Err(error),
        }
        if let Some(status) = child.try_wait()? {
            return Err(io::Error::other(format!("it ended at once ({status})")));
        }
    }
}

#[cfg(not(unix))]
pub(super) fn accept() -> io::Result<Connection> {
    let callback = std::env::var(CALLBACK).map_err(io::Error::other)?;
    let (port, word) = callback.split_once(' ').ok_or(io::ErrorKind::InvalidInput)?;
    let port: u16 = port.parse().map_err(io::Error::other)?;
    let mut stream = Connection::connect((std::net::Ipv4Addr::LOCALHOST, port))?;
    stream.set_nodelay(true)?;
    stream.write_all(word.as_bytes())?;
    Ok(stream)
}
