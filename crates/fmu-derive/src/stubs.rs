//! Empty implementations for declarations with mistakes. They satisfy the trait bounds, so only the mistake is
//! reported.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::{DeriveInput, GenericParam, parse_quote};

use crate::attribute::{private, root};
use crate::variables::Block;

/// Empty implementations for the derives `Parameters`, `Inputs`, `Outputs` and `State`.
pub(crate) fn variables(input: &DeriveInput, block: Block) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| private(None));
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
            fn read(_: #root::Values<'_, #number>, _: #root::Counts) -> Self {
                ::core::unreachable!()
            }
        }
        impl #parameters ::core::default::Default for #ident #arguments #conditions {
            fn default() -> Self {
                ::core::unreachable!()
            }
        }
    };
    match block {
        Block::State => tokens.extend(quote! {
            impl #parameters #root::ContinuousState<#number> for #ident #arguments #conditions {
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

/// An empty implementation for the derives `Derived` and `DiscreteState`.
pub(crate) fn empty(input: &DeriveInput, name: &str) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| private(None));
    let (ident, name) = (&input.ident, format_ident!("{name}"));
    let (parameters, arguments, conditions) = input.generics.split_for_impl();
    quote!(impl #parameters #root::#name for #ident #arguments #conditions {})
}

pub(crate) fn enumeration(input: &DeriveInput) -> TokenStream {
    let root = root(&input.attrs).unwrap_or_else(|_| private(None));
    let ident = &input.ident;
    if !input.generics.params.is_empty() {
        return quote!();
    }
    quote! {
        impl #root::Enumeration for #ident {
            const NAME: &'static str = "";
            const ITEMS: &'static [#root::Item] = &[];
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
        #root::enumeration_fields!(#ident);
    }
}
