//! Variables of type Binary. Reference: FMI 3.0.2, sections 2.2.6 (getting and setting) and 2.4.7 (attributes); the
//! values of Feedthrough of the Reference FMUs.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use fmu::prelude::*;
use fmu::testing::abi::{Export, Status, fmi3};
use fmu::testing::description::{Description, Format};

use crate::fmi3::Instance;
use crate::models::{exported, reference};

#[derive(Parameters)]
pub(crate) struct Frames {
    /// Put before each frame
    #[var(start = b"\x01", tunable)]
    header: Bytes<2>,
}

#[derive(Inputs)]
pub(crate) struct FrameInputs {
    /// Frame
    #[var(start = b"foo", mime = "application/x-frame")]
    frame: Bytes<4>,
    /// Two frames
    #[var(start = [b"a", b"b"])]
    pair: [Bytes<1>; 2],
}

#[derive(Outputs)]
pub(crate) struct FrameOutputs {
    /// Header and frame
    message: Bytes<8>,
    /// Frame of the last sample
    last: Bytes<4>,
    /// The two frames in the other order
    swapped: [Bytes<1>; 2],
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct LastFrame {
    frame: Bytes<4>,
}

/// Puts headers before frames
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Frames {
    type Inputs = FrameInputs;
    type Outputs = FrameOutputs;
    type State = LastFrame;
    fn update(&self, sample: Sample<Self>) -> FrameOutputs {
        let FrameInputs { frame, pair: [first, second] } = sample.inputs;
        let mut message = Bytes::default();
        message.set(&self.header);
        message.extend(frame);
        let last = std::mem::replace(&mut sample.state.frame, frame.clone());
        FrameOutputs { message, last, swapped: [second.clone(), first.clone()] }
    }
}

exported! {
    Frames3: Frames, Format::FMI3;
}

fn get(instance: &Instance<Frames3>, name: &str) -> Vec<u8> {
    let (reference, mut size, mut value) = (reference::<Frames3>(name), usize::MAX, std::ptr::null());
    // SAFETY: arrays of one element; the bytes are valid until the next call.
    unsafe {
        let status = fmi3::get_binary::<Frames3>(instance.component, &reference, 1, &mut size, &mut value, 1);
        assert_eq!(status, Status::Ok);
        assert!(!value.is_null());
        std::slice::from_raw_parts(value, size).to_vec()
    }
}

fn set(instance: &Instance<Frames3>, names: &[&str], values: &[&[u8]]) -> Result<(), String> {
    let references: Vec<_> = names.iter().map(|name| reference::<Frames3>(name)).collect();
    let sizes: Vec<_> = values.iter().map(|value| value.len()).collect();
    // An importer may pass a null pointer for no bytes.
    let pointers: Vec<_> =
        values.iter().map(|value| if value.is_empty() { std::ptr::null() } else { value.as_ptr() }).collect();
    let (count, length) = (references.len(), values.len());
    // SAFETY: arrays of these lengths.
    let status = unsafe {
        fmi3::set_binary::<Frames3>(
            instance.component,
            references.as_ptr(),
            count,
            sizes.as_ptr(),
            pointers.as_ptr(),
            length,
        )
    };
    if status == Status::Ok { Ok(()) } else { Err(instance.messages.lock().unwrap().pop().unwrap()) }
}

#[test]
fn bytes_pass_through_at_every_length() {
    let instance = Instance::<Frames3>::co_simulation(false).initialized();
    assert_eq!(get(&instance, "frame"), b"foo");
    assert_eq!(instance.step(0.0, 0.1).0, Status::Ok);
    assert_eq!((get(&instance, "message"), get(&instance, "last")), (b"\x01foo".to_vec(), vec![]));
    assert_eq!((get(&instance, "swapped[1]"), get(&instance, "swapped[2]")), (b"b".to_vec(), b"a".to_vec()));
    for (i, frame) in [&[0x00, 0xff, 0x00, 0x01][..], &[], &[7]].into_iter().enumerate() {
        let before = get(&instance, "frame");
        set(&instance, &["frame", "header"], &[frame, &[9, 9]]).unwrap();
        assert_eq!(instance.step(0.1 * (i + 1) as f64, 0.1).0, Status::Ok);
        assert_eq!(get(&instance, "message"), [&[9, 9], frame].concat());
        assert_eq!(get(&instance, "last"), before);
    }
}

/// If one value is rejected, nothing is set.
#[test]
fn more_bytes_than_the_variable_has_are_an_error() {
    let instance = Instance::<Frames3>::co_simulation(false);
    let message = set(&instance, &["frame", "header"], &[b"new", b"123"]).unwrap_err();
    assert_eq!(message, "fmi3SetBinary: 'header' must have at most 2 bytes, got 3");
    assert_eq!(get(&instance, "frame"), b"foo");
    let instance = instance.initialized();
    let message = set(&instance, &["frame", "last"], &[b"new", b""]).unwrap_err();
    assert!(message.starts_with("fmi3SetBinary: 'last' is an output"), "{message}");
    assert_eq!(get(&instance, "frame"), b"foo");
}

#[test]
fn a_state_with_bytes_comes_back() {
    let instance = Instance::<Frames3>::co_simulation(false).initialized();
    set(&instance, &["frame"], &[b"past"]).unwrap();
    assert_eq!(instance.step(0.0, 0.1).0, Status::Ok);
    set(&instance, &["frame"], &[b"x"]).unwrap();
    let other = instance.copied();
    assert_eq!(get(&other, "frame"), b"x");
    assert_eq!(other.step(0.1, 0.1).0, Status::Ok);
    assert_eq!((get(&other, "message"), get(&other, "last")), (b"\x01x".to_vec(), b"past".to_vec()));
}

#[test]
fn the_description_has_type_and_size_of_the_bytes() {
    let xml = &Frames3::description().xml;
    let frame = &xml[xml.find("name=\"frame\"").unwrap()..];
    let (attributes, rest) = frame.split_once('>').unwrap();
    for expected in ["variability=\"discrete\"", "mimeType=\"application/x-frame\"", "maxSize=\"4\""] {
        assert!(attributes.contains(expected), "{attributes}");
    }
    assert!(rest.trim_start().starts_with("<Start value=\"666f6f\"/>"), "{}", &rest[..60]);
    // FMI 2.0 has no such type; the error names the field.
    let error = Description::try_of::<<Frames as Export>::Model>(Format::FMI2, std::path::Path::new("")).unwrap_err();
    assert_eq!(
        error,
        "Frames: 'header' is a Binary, a type that FMI 2.0 does not have: pack with --fmi 3, or leave it out of FMI 2.0 with \
         `#[var(fmi = 3)]`"
    );
}

#[test]
#[should_panic(expected = "5 bytes are too many for a Binary of at most 4")]
fn too_many_bytes_of_a_model_are_named() {
    Bytes::<4>::default().set(&[0; 5]);
}
