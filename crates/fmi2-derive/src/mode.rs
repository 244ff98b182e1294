//! Enums as choices among named values.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Data, DeriveInput, Error, Expr, ExprLit, Fields, Lit, Result};

use crate::attribute::doc;

pub(crate) fn mode(input: &DeriveInput) -> Result<TokenStream> {
    let name = &input.ident;
    let Data::Enum(data) = &input.data else {
        return Err(Error::new(name.span(), "a mode is an enum without data"));
    };
    let mut next = Some(0_i32);
    let mut last = None;
    let (mut variants, mut values, mut names, mut descriptions) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for variant in &data.variants {
        if !matches!(variant.fields, Fields::Unit) {
            return Err(Error::new_spanned(variant, "a mode is an enum without data"));
        }
        if let Some((_, expression)) = &variant.discriminant {
            next = match expression {
                Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => Some(number.base10_parse()?),
                other => return Err(Error::new_spanned(other, "expected a whole number, 0 or more")),
            };
        }
        let Some(value) = next.filter(|value| last.is_none_or(|last| last < *value)) else {
            return Err(Error::new_spanned(variant, "the numbers of the choices must rise"));
        };
        let description = doc(&variant.attrs);
        if description.is_empty() {
            return Err(Error::new_spanned(variant, "the doc comment is missing: it is the meaning of the choice"));
        }
        variants.push(&variant.ident);
        values.push(value);
        names.push(snake_case(&variant.ident.to_string()));
        descriptions.push(description);
        last = Some(value);
        next = value.checked_add(1);
    }
    if variants.is_empty() {
        return Err(Error::new(name.span(), "a mode needs at least one choice"));
    }
    let text = name.to_string();
    Ok(quote! {
        impl ::fmi2::block::Mode for #name {
            const NAME: &'static str = #text;
            const CHOICES: &'static [::fmi2::block::Choice] = &[
                #(::fmi2::block::Choice { value: #values, name: #names, description: #descriptions }),*
            ];
            fn from_value(value: i32) -> ::std::option::Option<Self> {
                match value {
                    #(#values => Some(Self::#variants),)*
                    _ => None,
                }
            }
            fn value(self) -> i32 {
                match self {
                    #(Self::#variants => #values),*
                }
            }
        }
    })
}

fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for (i, c) in name.char_indices() {
        if c.is_uppercase() && i > 0 {
            snake.push('_');
        }
        snake.extend(c.to_lowercase());
    }
    snake
}
