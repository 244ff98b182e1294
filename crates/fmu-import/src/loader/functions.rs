//! The tables of the C functions.

pub(super) mod v2;
pub(super) mod v3;

use super::system;
use crate::c_api;
use crate::description::{FmiVersion, Interface};

pub(super) enum Functions {
    V2(v2::Functions),
    V3(v3::Functions),
}

impl Functions {
    /// `Err`: the name of a required function that is missing.
    ///
    /// # Safety
    /// Every function of that name has the signature of its version of FMI, and the library outlives the table.
    pub(super) unsafe fn load(
        library: &system::Library,
        fmi: FmiVersion,
        interface: Interface,
    ) -> Result<Self, &'static str> {
        // SAFETY: promised by the caller.
        unsafe {
            match fmi {
                FmiVersion::V2 => v2::Functions::load(library, interface).map(Self::V2),
                FmiVersion::V3 => v3::Functions::load(library, interface).map(Self::V3),
            }
        }
    }

    pub(super) fn fmi(&self) -> FmiVersion {
        match self {
            Self::V2(_) => FmiVersion::V2,
            Self::V3(_) => FmiVersion::V3,
        }
    }
}

/// Functions that both versions declare in the same way.
macro_rules! shared {
    ($($field:ident: $type:ty,)*) => {
        impl Functions {
            $(pub(super) fn $field(&self) -> $type {
                match self {
                    Self::V2(f) => f.$field,
                    Self::V3(f) => f.$field,
                }
            })*
        }
    };
}

shared! {
    exit_initialization_mode: c_api::Transition,
    terminate: c_api::Transition,
    reset: c_api::Transition,
    free_instance: c_api::FreeInstance,
    get_state: Option<c_api::AccessState>,
    set_state: Option<c_api::SetState>,
    free_state: Option<c_api::AccessState>,
    serialized_state_size: Option<c_api::SerializedStateSize>,
    set_time: Option<c_api::SetTime>,
    set_continuous_states: Option<c_api::SetNumbers>,
    get_continuous_states: Option<c_api::GetNumbers>,
    get_derivatives: Option<c_api::GetNumbers>,
    get_event_indicators: Option<c_api::GetNumbers>,
    get_nominals: Option<c_api::GetNumbers>,
    enter_event_mode: Option<c_api::Transition>,
    enter_continuous_time_mode: Option<c_api::Transition>,
}

/// Names of the functions that a library has to export. FMI 3.0 has all of them for every interface.
pub(super) fn names(fmi: FmiVersion, interfaces: &[Interface]) -> Vec<&'static str> {
    let mut names = match fmi {
        FmiVersion::V2 => {
            let mut names: Vec<_> = interfaces.iter().flat_map(|interface| v2::Functions::names(*interface)).collect();
            if interfaces.contains(&Interface::CoSimulation) {
                names.extend(v2::UNUSED);
            }
            names
        }
        FmiVersion::V3 => {
            let mut names = v3::Functions::names(Interface::CoSimulation);
            names.extend(v3::Functions::names(Interface::ModelExchange));
            names.extend(v3::UNUSED);
            names
        }
    };
    let mut known = std::collections::HashSet::new();
    names.retain(|name| known.insert(*name));
    names
}

macro_rules! table {
    (
        required { $($field:ident: $type:ty = $name:literal,)* }
        optional { $($other:ident: $other_type:ty = $other_name:literal,)* }
        co_simulation { needed { $($cs:ident: $cs_type:ty = $cs_name:literal,)* } $($cs2:ident: $cs2_type:ty = $cs2_name:literal,)* }
        model_exchange { needed { $($me:ident: $me_type:ty = $me_name:literal,)* } $($me2:ident: $me2_type:ty = $me2_name:literal,)* }
    ) => {
        /// The functions of a library. Those that an importer needs are required; the others are missing from many FMUs
        /// although the standard requires them. Those of the other interface are never there.
        pub(in super::super) struct Functions {
            $(pub(in super::super) $field: $type,)*
            $(pub(in super::super) $other: Option<$other_type>,)*
            $(pub(in super::super) $cs: Option<$cs_type>,)*
            $(pub(in super::super) $cs2: Option<$cs2_type>,)*
            $(pub(in super::super) $me: Option<$me_type>,)*
            $(pub(in super::super) $me2: Option<$me2_type>,)*
        }

        impl Functions {
            /// # Safety
            /// As [`super::Functions::load`].
            pub(super) unsafe fn load(
                library: &crate::loader::system::Library,
                interface: Interface,
            ) -> Result<Self, &'static str> {
                let (is_co_simulation, is_model_exchange) = match interface {
                    Interface::CoSimulation => (true, false),
                    Interface::ModelExchange => (false, true),
                };
                // SAFETY: promised by the caller.
                unsafe {
                    let functions = Self {
                        $($field: crate::loader::system::symbol::<$type>(library, $name).ok_or($name)?,)*
                        $($other: crate::loader::system::symbol::<$other_type>(library, $other_name),)*
                        $($cs: crate::loader::system::symbol::<$cs_type>(library, $cs_name).filter(|_| is_co_simulation),)*
                        $($cs2: crate::loader::system::symbol::<$cs2_type>(library, $cs2_name).filter(|_| is_co_simulation),)*
                        $($me: crate::loader::system::symbol::<$me_type>(library, $me_name).filter(|_| is_model_exchange),)*
                        $($me2: crate::loader::system::symbol::<$me2_type>(library, $me2_name).filter(|_| is_model_exchange),)*
                    };
                    $(if is_co_simulation && functions.$cs.is_none() {
                        return Err($cs_name);
                    })*
                    $(if is_model_exchange && functions.$me.is_none() {
                        return Err($me_name);
                    })*
                    Ok(functions)
                }
            }

            pub(super) fn names(interface: Interface) -> Vec<&'static str> {
                let mut names = vec![$($name,)* $($other_name,)*];
                match interface {
                    Interface::CoSimulation => names.extend([$($cs_name,)* $($cs2_name,)*]),
                    Interface::ModelExchange => names.extend([$($me_name,)* $($me2_name,)*]),
                }
                names
            }
        }
    };
}
use table;
