//! Empty implementations for declarations with mistakes: the trait bounds hold, so the mistake is the only message.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{DeriveInput, GenericParam, parse_quote};

use crate::attribute::root;
use crate::variables::Block;

/// `Parameters`, `Inputs`, `Outputs`, `State`.
pub(crate) fn variables(input: &DeriveInput, block: Block) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| quote!(::fmu));
    let ident = &input.ident;
    let mut generics = input.generics.clone();
    let mut number = quote!(f64);
    for (i, parameter) in generics.type_params_mut().enumerate() {
        if i == 0 && block != Block::Parameters {
            let ident = &parameter.ident;
            number = quote!(#ident);
            parameter.bounds.push(parse_quote!(#root::Scalar));
        } else if block == Block::Parameters {
            parameter.bounds.push(parse_quote!(::core::marker::Send));
            parameter.bounds.push(parse_quote!('static));
        }
    }
    if generics.params.iter().any(|parameter| matches!(parameter, GenericParam::Lifetime(_))) {
        return quote!();
    }
    let (parameters, arguments, conditions) = generics.split_for_impl();
    let mut tokens = quote! {
        impl #parameters #root::Variables<#number> for #ident #arguments #conditions {
            const COUNTS: #root::variables::Counts = #root::variables::Counts::ZERO;
            fn declare(_: &mut ::std::vec::Vec<#root::variable::Declaration>) {}
            fn read(_: #root::variables::Values<'_, #number>, _: #root::variables::Counts) -> Self {
                ::core::unreachable!()
            }
            fn write(&self, _: &mut #root::variables::ValuesMut<'_, #number>, _: #root::variables::Counts) {}
        }
        impl #parameters ::core::default::Default for #ident #arguments #conditions {
            fn default() -> Self {
                ::core::unreachable!()
            }
        }
    };
    match block {
        Block::State => tokens.extend(quote! {
            impl #parameters #root::variables::ContinuousState<#number> for #ident #arguments #conditions {
                fn combine(&self, _: &Self, _: impl Fn(#number, #number) -> #number + Copy) -> Self {
                    ::core::unreachable!()
                }
            }
        }),
        Block::Parameters => {
            tokens.extend(quote!(impl #parameters #root::Parameters for #ident #arguments #conditions {}));
        }
        _ => {}
    }
    tokens
}

/// `Derived`.
pub(crate) fn derived(input: &DeriveInput) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| quote!(::fmu));
    let ident = &input.ident;
    let (parameters, arguments, conditions) = input.generics.split_for_impl();
    quote! {
        impl #parameters #root::Derived for #ident #arguments #conditions {
            fn declare(_: &mut ::std::vec::Vec<#root::variable::Declaration>) {}
            fn write(&self, _: &mut #root::variables::ValuesMut<'_, f64>, _: #root::variables::Counts) {}
        }
    }
}

/// `DiscreteState`.
pub(crate) fn discrete_state(input: &DeriveInput) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| quote!(::fmu));
    let ident = &input.ident;
    let (parameters, arguments, conditions) = input.generics.split_for_impl();
    quote! {
        impl #parameters #root::DiscreteState for #ident #arguments #conditions {
            fn save(&self, _: &mut dyn FnMut(#root::discrete_state::Word<'_>)) {}
            fn load(
                &mut self,
                _: &mut #root::discrete_state::Words<'_>,
            ) -> ::core::result::Result<(), ::std::string::String> {
                ::core::unreachable!()
            }
            fn not_finite(&self) -> ::core::option::Option<(&'static str, f64)> {
                None
            }
        }
    }
}

/// `Enumeration`.
pub(crate) fn enumeration(input: &DeriveInput) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| quote!(::fmu));
    let ident = &input.ident;
    if !input.generics.params.is_empty() {
        return quote!();
    }
    quote! {
        impl #root::Enumeration for #ident {
            const NAME: &'static str = "";
            const ITEMS: &'static [#root::enumeration::Item] = &[];
            fn first() -> Self {
                ::core::unreachable!()
            }
            fn from_value(_: i32) -> ::core::option::Option<Self> {
                None
            }
            fn value(&self) -> i32 {
                0
            }
        }
        impl<T: #root::Scalar> #root::Field<T> for #ident {
            type Start = Self;
            const COUNTS: #root::variables::Counts = #root::variables::Counts::INTEGER;
            const IS_REAL: bool = false;
            fn declare(
                _: &#root::declare::Spec,
                _: ::core::option::Option<Self>,
                _: &mut ::std::vec::Vec<#root::variable::Declaration>,
            ) {}
            fn read(_: #root::variables::Values<'_, T>, _: #root::variables::Counts) -> Self {
                ::core::unreachable!()
            }
            fn write(&self, _: &mut #root::variables::ValuesMut<'_, T>, _: #root::variables::Counts) {}
        }
        impl #root::discrete_state::StateField for #ident {
            fn not_finite(&self) -> ::core::option::Option<f64> {
                None
            }
            fn save(&self, _: &mut dyn FnMut(#root::discrete_state::Word<'_>)) {}
            fn load(
                &mut self,
                _: &'static str,
                _: &mut #root::discrete_state::Words<'_>,
            ) -> ::core::result::Result<(), ::std::string::String> {
                ::core::unreachable!()
            }
        }
    }
}
