//! The call board: a file that contains the function and component that a process is executing.
//!
//! A worker maps the file into memory and writes to it before and after every call to an FMU. This costs two stores and
//! no system call. If the worker crashes, its parent reads the file and reports what the worker was doing.

use crate::description::{FmiVersion, Interface};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Name of a function with the prefix of its FMI version. Without a literal, it is the name of the item in `Function`.
macro_rules! name {
    ($prefix:literal $name:ident) => {
        concat!($prefix, stringify!($name))
    };
    ($prefix:literal $name:ident $other:literal) => {
        concat!($prefix, $other)
    };
}

macro_rules! functions {
    ($($interface:expr => $($name:ident $([$v2:literal $v3:literal])?)*;)*) => {
        /// The functions that the loader calls. One item stands for a function in both FMI versions.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(super) enum Function { $($(
            #[doc = concat!("`", name!("fmi2" $name $($v2)?), "`, `", name!("fmi3" $name $($v3)?), "`")]
            $name,
        )*)* }

        /// Names in FMI 2.0 and FMI 3.0, by item. Messages use them even if a version does not have the function.
        pub(crate) const NAMES: &[[&str; 2]] =
            &[$($([name!("fmi2" $name $($v2)?), name!("fmi3" $name $($v3)?)],)*)*];

        impl Function {
            /// The interface to which the function belongs; `None` for both.
            pub(super) fn interface(self) -> Option<Interface> {
                match self {
                    $($(Self::$name)|* => $interface,)*
                }
            }
        }
    };
}

functions! {
    None =>
        FreeInstance SetupExperiment EnterInitializationMode ExitInitializationMode Terminate Reset GetBoolean
        GetString SetBoolean SetString GetFloat32 SetFloat32 GetInt8 SetInt8 GetUInt8 SetUInt8 GetInt16 SetInt16
        GetUInt16 SetUInt16 GetUInt32 SetUInt32 GetInt64 SetInt64 GetUInt64 SetUInt64 GetBinary SetBinary
        SetDebugLogging GetDirectionalDerivative GetAdjointDerivative EnterConfigurationMode ExitConfigurationMode
        GetNumberOfVariableDependencies GetVariableDependencies GetClock SetClock GetIntervalDecimal SetIntervalDecimal GetShiftDecimal
        GetReal ["GetReal" "GetFloat64"]
        GetInteger ["GetInteger" "GetInt32"]
        SetReal ["SetReal" "SetFloat64"]
        SetInteger ["SetInteger" "SetInt32"]
        GetFmuState ["GetFMUstate" "GetFMUState"]
        SetFmuState ["SetFMUstate" "SetFMUState"]
        FreeFmuState ["FreeFMUstate" "FreeFMUState"]
        SerializedFmuStateSize ["SerializedFMUstateSize" "SerializedFMUStateSize"]
        SerializeFmuState ["SerializeFMUstate" "SerializeFMUState"]
        DeserializeFmuState ["DeSerializeFMUstate" "DeserializeFMUState"];
    Some(Interface::CoSimulation) =>
        DoStep CancelStep GetRealStatus GetBooleanStatus
        InstantiateCoSimulation ["Instantiate" "InstantiateCoSimulation"]
        EnterStepMode
        SetInputDerivatives ["SetRealInputDerivatives" "SetRealInputDerivatives"]
        GetOutputDerivatives ["GetRealOutputDerivatives" "GetOutputDerivatives"];
    Some(Interface::ModelExchange) =>
        SetTime SetContinuousStates GetContinuousStates GetEventIndicators GetNumberOfEventIndicators
        EnterEventMode EnterContinuousTimeMode CompletedIntegratorStep
        InstantiateModelExchange ["Instantiate" "InstantiateModelExchange"]
        GetDerivatives ["GetDerivatives" "GetContinuousStateDerivatives"]
        GetNominals ["GetNominalsOfContinuousStates" "GetNominalsOfContinuousStates"]
        GetNumberOfStates ["GetNumberOfContinuousStates" "GetNumberOfContinuousStates"]
        NewDiscreteStates ["NewDiscreteStates" "UpdateDiscreteStates"];
    Some(Interface::ScheduledExecution) =>
        InstantiateScheduledExecution ActivateModelPartition;
}

const fn version(fmi: FmiVersion) -> usize {
    match fmi {
        FmiVersion::V2 => 0,
        FmiVersion::V3 => 1,
    }
}

impl Function {
    pub(super) fn name(self, fmi: FmiVersion) -> &'static str {
        NAMES[self as usize][version(fmi)]
    }
}

/// Function number while a library is being loaded, which runs the library's initializers.
const LOADING: u64 = 0xff;
/// Number of low bits in [`Word::Call`] that contain the function number, counted from 1. The upper bits contain the
/// component.
const FUNCTION_BITS: u32 = 8;
const FUNCTIONS: u64 = 127;
const _: () = assert!(NAMES.len() as u64 <= FUNCTIONS);

#[derive(Clone, Copy)]
enum Word {
    /// The present call; 0 if there is none.
    Call,
    /// Start of the present step in s, as the bits of an f64; NaN outside a step.
    Time,
    /// Number of completed steps in the present run.
    Steps,
    /// Changes whenever the worker makes progress.
    Pulse,
    /// Index of the component that is being loaded or instantiated.
    Component,
    /// 1 while the parent has paused a run in real time.
    Pause,
}
const WORDS: usize = 6;
/// Size of the file, bytes.
const SIZE: usize = 8 * WORDS;

/// The board of this process.
#[derive(Debug)]
pub struct Board(&'static [AtomicU64; WORDS]);

static BOARD: OnceLock<Board> = OnceLock::new();

/// The board of this process; `None` unless it is a worker.
pub fn board() -> Option<&'static Board> {
    BOARD.get()
}

/// Makes a file the board of this process until the process ends. Fails if the file is not from [`create`] or cannot be
/// mapped.
#[cfg(not(target_family = "wasm"))]
pub fn publish(file: &File) -> io::Result<()> {
    if file.metadata()?.len() != SIZE as u64 {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            "the file for the shared record of calls into FMUs has the wrong size",
        ));
    }
    // SAFETY: the file is private to this process and its parent, which reads the file but does not truncate it.
    let map = Box::leak(Box::new(unsafe { memmap2::MmapMut::map_mut(file) }?));
    // SAFETY: the map is page-aligned, as long as the file, never unmapped, and accessed only with these atomics.
    let words = unsafe { &*map.as_mut_ptr().cast::<[AtomicU64; WORDS]>() };
    BOARD
        .set(Board(words))
        .map_err(|_| io::Error::other("this process already has a shared record of its calls into FMUs"))?;
    board().into_iter().for_each(Board::begin);
    Ok(())
}

/// Fills a file with an empty board.
pub fn create(file: &File) -> io::Result<()> {
    file.set_len(SIZE as u64)
}

/// Pauses the run of another process if it is in real time, or lets it go on.
#[cfg(unix)]
pub fn pause(file: &File, is_paused: bool) -> io::Result<()> {
    let place = 8 * Word::Pause as u64;
    std::os::unix::fs::FileExt::write_all_at(file, &u64::from(is_paused).to_ne_bytes(), place)
}

impl Board {
    fn set(&self, word: Word, value: u64) {
        self.0[word as usize].store(value, Ordering::Relaxed);
    }

    fn get(&self, word: Word) -> u64 {
        self.0[word as usize].load(Ordering::Relaxed)
    }

    /// Signals progress.
    pub fn pulse(&self) {
        self.set(Word::Pulse, self.get(Word::Pulse).wrapping_add(1));
    }

    /// True while a run in real time has to wait.
    pub fn is_paused(&self) -> bool {
        self.get(Word::Pause) != 0
    }

    /// Starts a run.
    pub fn begin(&self) {
        self.set(Word::Time, f64::NAN.to_bits());
        self.set(Word::Steps, 0);
        self.pulse();
    }

    /// Starts a step at `time`, s, after `done` steps.
    pub fn step(&self, time: f64, done: u64) {
        self.set(Word::Time, time.to_bits());
        self.set(Word::Steps, done);
        self.pulse();
    }

    /// Sets the component that will be loaded or instantiated next.
    pub fn component(&self, index: usize) {
        self.set(Word::Component, index as u64);
        self.pulse();
    }

    pub(super) fn current(&self) -> u64 {
        self.get(Word::Component)
    }

    pub(super) fn enter(&self, component: u64, function: Function, fmi: FmiVersion) {
        let number = FUNCTIONS * version(fmi) as u64 + function as u64 + 1;
        self.set(Word::Call, component << FUNCTION_BITS | number);
    }

    pub(super) fn load(&self) {
        self.set(Word::Call, self.current() << FUNCTION_BITS | LOADING);
    }

    pub(super) fn leave(&self) {
        self.set(Word::Call, 0);
    }
}

/// Contents of the board of another process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// Index of the component, and name of the function; the name is empty while the library is being loaded.
    pub call: Option<(usize, &'static str)>,
    /// Start of the present step, s.
    pub time: Option<f64>,
    /// Number of completed steps in the present run.
    pub steps: u64,
    /// Changes whenever the worker makes progress.
    pub pulse: u64,
}

impl Snapshot {
    /// Reads the board.
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
        // An FMU may have overwritten the board, so the number can be invalid.
        let name = match call & ((1 << FUNCTION_BITS) - 1) {
            0 => None,
            LOADING => Some(""),
            number => {
                let at = |number| usize::try_from(number).unwrap_or(usize::MAX);
                let (function, version) = (at((number - 1) % FUNCTIONS), at((number - 1) / FUNCTIONS));
                NAMES.get(function).and_then(|names| names.get(version)).copied()
            }
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

    /// The only test that publishes a board, because a process can have only one.
    #[test]
    fn another_process_reads_the_board_from_the_file() {
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
        board.enter(4, Function::GetReal, FmiVersion::V3);
        assert_eq!(read().call, Some((4, "fmi3GetFloat64")));
        board.enter(3, Function::DoStep, FmiVersion::V2);
        let stepping = read();
        assert_eq!((stepping.call, stepping.time, stepping.steps), (Some((3, "fmi2DoStep")), Some(0.25), 7));
        assert_ne!(stepping.pulse, begun.pulse);
        board.leave();
        assert_eq!(read().call, None);
        #[cfg(unix)]
        for is_paused in [true, false] {
            pause(&file, is_paused).unwrap();
            assert_eq!(board.is_paused(), is_paused);
        }
    }
}
