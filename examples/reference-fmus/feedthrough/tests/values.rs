//! Outputs are inputs. Reference: the values of the page of the Reference FMUs at the limits of the types.

use feedthrough::{Choice, Feedthrough, U, Y};
use fmu::Bytes;
use fmu::simulation::ContinuousSimulation;

#[test]
fn outputs_are_inputs() {
    let mut run = ContinuousSimulation::new(Feedthrough::default()).expect("it starts");
    for binary in [&b"foo"[..], &[0x00, 0xff, 0x00, 0x01], &[]] {
        let mut bytes = Bytes::default();
        bytes.set(binary);
        let inputs = U {
            float32: 0.1,
            float64: -1.5,
            int8: i8::MIN,
            uint8: u8::MAX,
            int16: i16::MIN,
            uint16: u16::MAX,
            int32: i32::MIN,
            uint32: u32::MAX,
            int64: i64::MIN,
            uint64: u64::MAX,
            boolean: true,
            string: "Set me!".to_owned(),
            binary: bytes.clone(),
            choice: Choice::Option2,
        };
        let expected = Y {
            float32: 0.1,
            float64: -1.5,
            int8: i8::MIN,
            uint8: u8::MAX,
            int16: i16::MIN,
            uint16: u16::MAX,
            int32: i32::MIN,
            uint32: u32::MAX,
            int64: i64::MIN,
            uint64: u64::MAX,
            boolean: true,
            string: "Set me!".to_owned(),
            binary: bytes,
            choice: Choice::Option2,
        };
        assert_eq!(run.outputs(&inputs), expected);
    }
}
