//! `Feedthrough`: each output is the input of the same type. It follows the model of the same name in the Reference
//! FMUs of the Modelica Association, with its names and start values.

use fmu::prelude::*;

/// Options
#[derive(Enumeration, Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// First option
    Option1 = 1,
    /// Second option
    Option2,
}

/// Parameters.
#[derive(Parameters)]
pub struct Feedthrough {
    /// Fixed parameter (1)
    #[var("Float64_fixed_parameter", start = 0.0)]
    pub fixed: f64,
    /// Tunable parameter (1)
    #[var("Float64_tunable_parameter", start = 0.0, tunable)]
    pub tunable: f64,
    /// String parameter
    #[var("String_parameter", start = "Set me!", tunable)]
    pub string: String,
}

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Float32 (1)
    #[var("Float32_discrete_input")]
    pub float32: f32,
    /// Float64 (1)
    #[var("Float64_continuous_input")]
    pub float64: T,
    /// Signed integer of 8 bits
    #[var("Int8_input")]
    pub int8: i8,
    /// Unsigned integer of 8 bits
    #[var("UInt8_input")]
    pub uint8: u8,
    /// Signed integer of 16 bits
    #[var("Int16_input")]
    pub int16: i16,
    /// Unsigned integer of 16 bits
    #[var("UInt16_input")]
    pub uint16: u16,
    /// Signed integer of 32 bits
    #[var("Int32_input")]
    pub int32: i32,
    /// Unsigned integer of 32 bits
    #[var("UInt32_input")]
    pub uint32: u32,
    /// Signed integer of 64 bits
    #[var("Int64_input")]
    pub int64: i64,
    /// Unsigned integer of 64 bits
    #[var("UInt64_input")]
    pub uint64: u64,
    /// Boolean
    #[var("Boolean_input")]
    pub boolean: bool,
    /// String
    #[var("String_input", start = "Set me!")]
    pub string: String,
    /// Binary
    #[var("Binary_input", start = b"foo")]
    pub binary: Bytes<128>,
    /// Enumeration
    #[var("Enumeration_input", enumeration)]
    pub choice: Choice,
}

/// Outputs.
#[derive(Outputs, Debug, PartialEq)]
pub struct Y<T> {
    /// Float32 (1)
    #[var("Float32_discrete_output")]
    pub float32: f32,
    /// Float64 (1)
    #[var("Float64_continuous_output")]
    pub float64: T,
    /// Signed integer of 8 bits
    #[var("Int8_output")]
    pub int8: i8,
    /// Unsigned integer of 8 bits
    #[var("UInt8_output")]
    pub uint8: u8,
    /// Signed integer of 16 bits
    #[var("Int16_output")]
    pub int16: i16,
    /// Unsigned integer of 16 bits
    #[var("UInt16_output")]
    pub uint16: u16,
    /// Signed integer of 32 bits
    #[var("Int32_output")]
    pub int32: i32,
    /// Unsigned integer of 32 bits
    #[var("UInt32_output")]
    pub uint32: u32,
    /// Signed integer of 64 bits
    #[var("Int64_output")]
    pub int64: i64,
    /// Unsigned integer of 64 bits
    #[var("UInt64_output")]
    pub uint64: u64,
    /// Boolean
    #[var("Boolean_output")]
    pub boolean: bool,
    /// String
    #[var("String_output")]
    pub string: String,
    /// Binary
    #[var("Binary_output")]
    pub binary: Bytes<128>,
    /// Enumeration
    #[var("Enumeration_output", enumeration)]
    pub choice: Choice,
}

/// Feedthrough of all types
#[fmu::model(stop_time = 2.0, step_size = 0.1)]
impl Continuous for Feedthrough {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        let U { float32, float64, int8, uint8, int16, uint16, int32, uint32, int64, uint64, boolean, choice, .. } =
            *at.inputs;
        let (string, binary) = (at.inputs.string.clone(), at.inputs.binary.clone());
        Y {
            float32,
            float64,
            int8,
            uint8,
            int16,
            uint16,
            int32,
            uint32,
            int64,
            uint64,
            boolean,
            string,
            binary,
            choice,
        }
    }
}
