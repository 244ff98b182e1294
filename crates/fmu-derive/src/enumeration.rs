//! Enums as named values of a variable.

use heck::ToSnakeCase as _;
use proc_macro2::TokenStream;
use quote::quote;
use syn::punctuated::Punctuated;
use syn::{Data, DeriveInput, Error, Expr, ExprLit, Fields, Ident, Lit, Meta, Result, Token};

use crate::attribute::{doc, root};
use crate::errors::Errors;

pub(crate) fn enumeration(input: &DeriveInput) -> Result<TokenStream> {
    let root = root(&input.attrs)?;
    let name = &input.ident;
    let Data::Enum(data) = &input.data else {
        return Err(Error::new(name.span(), "an enumeration must be an enum without data"));
    };
    let mut errors = Errors::default();
    let mut next = Some(0_i32);
    let mut last = None;
    let (mut variants, mut values, mut names, mut descriptions) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for variant in &data.variants {
        if !matches!(variant.fields, Fields::Unit) {
            errors.add(Error::new_spanned(variant, "an enumeration must be an enum without data"));
        }
        if let Some((_, expression)) = &variant.discriminant {
            match expression {
                Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => next = errors.keep(number.base10_parse()),
                other => errors.add(Error::new_spanned(other, "expected an integer that is not negative")),
            }
        }
        let value = next.unwrap_or(0);
        // The compiler reports duplicate values.
        if next.is_none_or(|value| last.is_some_and(|last| last > value) && !values.contains(&value)) {
            errors.add(Error::new_spanned(variant, "the values of the variants must increase"));
        }
        let description = doc(&variant.attrs);
        if description.is_empty() {
            let message = "the doc comment is missing: it becomes the description of the value";
            errors.add(Error::new_spanned(variant, message));
        }
        variants.push(&variant.ident);
        values.push(value);
        names.push(variant.ident.to_string().to_snake_case());
        descriptions.push(description);
        last = Some(value);
        next = value.checked_add(1);
    }
    if variants.is_empty() {
        errors.add(Error::new(name.span(), "an enumeration needs at least one variant"));
    }
    let first = variants.first();
    if (1..values.len()).any(|i| values[..i].contains(&values[i])) {
        return errors.finish(crate::stubs::enumeration(input));
    }
    let text = name.to_string();
    let size = size(input);
    errors.finish(quote! {
        impl #root::Enumeration for #name {
            const NAME: &'static str = #text;
            const SIZE: #root::Size = #root::Size::#size;
            const ITEMS: &'static [#root::Item] = &[
                #(#root::Item { value: #values, name: #names, description: #descriptions }),*
            ];
            fn first() -> Self {
                Self::#first
            }
            fn from_value(value: i32) -> ::std::option::Option<Self> {
                match value {
                    #(#values => Some(Self::#variants),)*
                    _ => None,
                }
            }
            fn value(&self) -> i32 {
                match self {
                    #(Self::#variants => #values),*
                }
            }
        }
        #root::enumeration_fields!(#name);
    })
}

/// FMI 3.0 name of the integer type in `#[repr(…)]`. The compiler reports a variant whose number does not fit, and mistakes
/// in the attribute.
fn size(input: &DeriveInput) -> Ident {
    let mut name = "Int32";
    for attribute in input.attrs.iter().filter(|attribute| attribute.path().is_ident("repr")) {
        let Ok(list) = attribute.parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated) else { continue };
        for ident in list.iter().filter_map(|meta| meta.path().get_ident()) {
            name = match ident.to_string().as_str() {
                "i8" => "Int8",
                "u8" => "UInt8",
                "i16" => "Int16",
                "u16" => "UInt16",
                "u32" => "UInt32",
                "i64" => "Int64",
                "u64" => "UInt64",
                _ => name,
            };
        }
    }
    Ident::new(name, input.ident.span())
}
