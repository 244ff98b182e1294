//! Tables of C functions.

pub(super) mod v2;
pub(super) mod v3;

use super::system;
use crate::c_api;
use crate::description::{FmiVersion, Interface};

#[allow(clippy::large_enum_variant, reason = "a library has one table")]
pub(super) enum Functions {
    V2(v2::Functions),
    V3(v3::Functions),
}

impl Functions {
    /// Looks up the functions. The error is the name of a missing required function.
    ///
    /// # Safety
    /// The functions must have the signatures of this FMI version, and the library must outlive the table.
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

/// Names of the functions that a library must export. FMI 3.0 requires all functions for every interface.
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
            names.extend(v3::Functions::names(Interface::ScheduledExecution));
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
        $($interface:ident {
            needed { $($need:ident: $need_type:ty = $need_name:literal,)* }
            $($more:ident: $more_type:ty = $more_name:literal,)*
        })*
    ) => {
        /// The functions in a library. The standard requires all of them, but many FMUs do not have the optional ones.
        pub(in super::super) struct Functions {
            $(pub(in super::super) $field: $type,)*
            $(pub(in super::super) $other: Option<$other_type>,)*
            $(
                $(pub(in super::super) $need: Option<$need_type>,)*
                $(pub(in super::super) $more: Option<$more_type>,)*
            )*
        }

        impl Functions {
            /// # Safety
            /// As for [`super::Functions::load`].
            pub(super) unsafe fn load(
                library: &crate::loader::system::Library,
                interface: Interface,
            ) -> Result<Self, &'static str> {
                use crate::loader::system::symbol;
                // SAFETY: promised by the caller.
                let functions = unsafe {
                    Self {
                        $($field: symbol::<$type>(library, $name).ok_or($name)?,)*
                        $($other: symbol::<$other_type>(library, $other_name),)*
                        $(
                            $($need: symbol::<$need_type>(library, $need_name).filter(|_| interface == Interface::$interface),)*
                            $($more: symbol::<$more_type>(library, $more_name).filter(|_| interface == Interface::$interface),)*
                        )*
                    }
                };
                $($(if interface == Interface::$interface && functions.$need.is_none() {
                    return Err($need_name);
                })*)*
                Ok(functions)
            }

            pub(super) fn names(interface: Interface) -> Vec<&'static str> {
                let mut names = vec![$($name,)* $($other_name,)*];
                $(if interface == Interface::$interface {
                    names.extend([$($need_name,)* $($more_name,)*] as [&str; _]);
                })*
                names
            }
        }
    };
}
use table;
