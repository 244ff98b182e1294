//! The call board: which function of which component a process is in, in a file that another process can read.
//!
//! A worker maps the file and writes to it before and after every call of an FMU. That costs two stores and no system
//! call, and the words outlive the process: whoever started it can tell what it was doing when it crashed, exited or hung.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

macro_rules! functions {
    ($($name:ident)*) => {
        /// The functions of FMI 2.0 that the loader calls.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(super) enum Function { $(
            #[doc = stringify!($name)]
            $name,
        )* }

        const NAMES: &[&str] = &[$(concat!("fmi2", stringify!($name))),*];
    };
}

functions! {
    Instantiate FreeInstance SetupExperiment EnterInitializationMode ExitInitializationMode Terminate Reset
    GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean SetString DoStep CancelStep SetDebugLogging
    GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate
    GetDirectionalDerivative SetRealInputDerivatives GetRealOutputDerivatives
    GetStatus GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus
}

impl Function {
    /// Name of the C function.
    pub(super) fn name(self) -> &'static str {
        NAMES[self as usize]
    }
}

/// What is loaded instead of called: runs the initializers of a library.
const LOADING: u64 = 0xff;
/// Bits of a call that number the function, from 1; the component is above them.
const FUNCTION_BITS: u32 = 8;

/// Words of the board, in their order.
#[derive(Clone, Copy)]
enum Word {
    /// The call the process is in; 0: none.
    Call,
    /// Start of the present step, s, as bits; NaN: not in a step.
    Time,
    /// Steps done of the present run.
    Steps,
    /// Changes with everything that counts as progress.
    Pulse,
    /// The component that is loaded or instantiated.
    Component,
}
const WORDS: usize = 5;
/// Size of the file, bytes.
const SIZE: usize = 8 * WORDS;

/// The words that a process writes.
#[derive(Debug)]
pub struct Board(&'static [AtomicU64; WORDS]);

static BOARD: OnceLock<Board> = OnceLock::new();

/// The board of this process; `None` unless it is a worker.
#[must_use]
pub fn board() -> Option<&'static Board> {
    BOARD.get()
}

/// Makes a file into the board of this process, for its whole life.
///
/// # Errors
/// The file is not one of [`create`] or cannot be mapped.
pub fn publish(file: &File) -> io::Result<()> {
    if file.metadata()?.len() != SIZE as u64 {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "the file of the calls has another size"));
    }
    // SAFETY: the file is private to this process and the one that started it, which only reads it and does not cut it.
    let map = Box::leak(Box::new(unsafe { memmap2::MmapMut::map_mut(file) }?));
    // SAFETY: a map starts at the start of a page, is as long as the file and is never unmapped; all access to it is
    // through these atomic words.
    let words = unsafe { &*map.as_mut_ptr().cast::<[AtomicU64; WORDS]>() };
    BOARD.set(Board(words)).map_err(|_| io::Error::other("this process has a board of calls"))?;
    board().into_iter().for_each(Board::begin);
    Ok(())
}

/// Fills a file with an empty board.
///
/// # Errors
/// The file cannot be written.
pub fn create(file: &File) -> io::Result<()> {
    file.set_len(SIZE as u64)
}

impl Board {
    fn set(&self, word: Word, value: u64) {
        self.0[word as usize].store(value, Ordering::Relaxed);
    }

    fn get(&self, word: Word) -> u64 {
        self.0[word as usize].load(Ordering::Relaxed)
    }

    fn pulse(&self) {
        self.set(Word::Pulse, self.get(Word::Pulse).wrapping_add(1));
    }

    /// A run begins.
    pub fn begin(&self) {
        self.set(Word::Time, f64::NAN.to_bits());
        self.set(Word::Steps, 0);
        self.pulse();
    }

    /// A step begins at a time, s, after so many others.
    pub fn step(&self, time: f64, done: u64) {
        self.set(Word::Time, time.to_bits());
        self.set(Word::Steps, done);
        self.pulse();
    }

    /// What is loaded or instantiated from now on is this component.
    pub fn component(&self, index: usize) {
        self.set(Word::Component, index as u64);
        self.pulse();
    }

    /// The component that is loaded or instantiated.
    pub(super) fn current(&self) -> u64 {
        self.get(Word::Component)
    }

    /// The process enters a function of a component.
    pub(super) fn enter(&self, component: u64, function: Function) {
        self.set(Word::Call, component << FUNCTION_BITS | (function as u64 + 1));
    }

    /// The process loads the library of the present component.
    pub(super) fn load(&self) {
        self.set(Word::Call, self.current() << FUNCTION_BITS | LOADING);
    }

    /// The process is out of the FMU.
    pub(super) fn leave(&self) {
        self.set(Word::Call, 0);
    }
}

/// What the board of another process says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// Index of the component, and the name of the function; an empty name: loading its library.
    pub call: Option<(usize, &'static str)>,
    /// Start of the present step, s.
    pub time: Option<f64>,
    /// Steps done of the present run.
    pub steps: u64,
    /// Changes with progress.
    pub pulse: u64,
}

impl Snapshot {
    /// Reads the board.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(mut file: &File) -> io::Result<Self> {
        let mut bytes = [0; SIZE];
        file.seek(SeekFrom::Start(0))?;
        file.read_exact(&mut bytes)?;
        let word = |word: Word| {
            let mut eight = [0; 8];
            eight.copy_from_slice(&bytes[8 * word as usize..][..8]);
            u64::from_ne_bytes(eight)
        };
        let call = word(Word::Call);
        let component = usize::try_from(call >> FUNCTION_BITS).unwrap_or(usize::MAX);
        // An FMU may have written over it.
        let name = match call & ((1 << FUNCTION_BITS) - 1) {
            0 => None,
            LOADING => Some(""),
            function => usize::try_from(function - 1).ok().and_then(|at| NAMES.get(at)).copied(),
        };
        let time = f64::from_bits(word(Word::Time));
        Ok(Self {
            call: name.map(|name| (component, name)),
            time: time.is_finite().then_some(time),
            steps: word(Word::Steps),
            pulse: word(Word::Pulse),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The only test that publishes a board: a process has one.
    #[test]
    fn what_is_written_is_read_through_the_file() {
        let file = tempfile::tempfile().unwrap();
        create(&file).unwrap();
        let read = || Snapshot::read(&file).unwrap();
        assert_eq!((read().call, read().steps), (None, 0));
        publish(&file).unwrap();
        let board = board().unwrap();
        board.begin();
        let begun = read();
        assert_eq!(begun.time, None);
        board.component(3);
        board.load();
        assert_eq!(read().call, Some((3, "")));
        board.step(0.25, 7);
        board.enter(3, Function::DoStep);
        let stepping = read();
        assert_eq!((stepping.call, stepping.time, stepping.steps), (Some((3, "fmi2DoStep")), Some(0.25), 7));
        assert_ne!(stepping.pulse, begun.pulse);
        board.leave();
        assert_eq!(read().call, None);
    }
}
