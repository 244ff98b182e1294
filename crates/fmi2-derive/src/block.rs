//! Structs of variables.

use proc_macro2::TokenStream;
use quote::{quote, quote_spanned};
use syn::{DeriveInput, Error, Field, GenericParam, Ident, Result};

use crate::attribute::{Source, Variable, doc, fields, is_type};

const REAL_KEYS: &[&str] = &["unit", "start", "min", "max", "nominal", "display", "positive", "tunable"];

/// Fields that divide the time into samples or integration steps, and what they implement.
const GRID: [(&str, &str); 2] = [("sample_time", "HasSampleTime"), ("max_step", "HasMaxStep")];

fn name(field: &Field) -> &Ident {
    field.ident.as_ref().expect("the fields are named")
}

/// Start values are read back from the declarations, so that they stand in one place.
pub(crate) fn parameters(input: &DeriveInput) -> Result<TokenStream> {
    if let Some(parameter) = input.generics.params.first() {
        let message = "parameters are plain numbers; the number type of the equations stands on inputs and states";
        return Err(Error::new_spanned(parameter, message));
    }
    let block = &input.ident;
    let mut declarations = Vec::new();
    let mut readers = Vec::new();
    let mut extra = Vec::new();
    for field in fields(input)? {
        let (declaration, reader) = if is_nested(field) { nested(field)? } else { parameter(field)? };
        declarations.push(declaration);
        let field_name = name(field);
        readers.push(quote!(#field_name: #reader));
        for (method, bound) in GRID {
            if field_name == method {
                let bound = Ident::new(bound, field_name.span());
                extra.push(quote! {
                    impl ::fmi2::model::#bound for #block {
                        fn #field_name(&self) -> f64 { self.#field_name }
                    }
                });
            }
        }
    }
    Ok(quote! {
        impl ::fmi2::block::Parameters for #block {
            fn declare() -> ::std::vec::Vec<::fmi2::variable::Declaration> {
                let mut all = ::std::vec::Vec::new();
                #(#declarations)*
                all
            }
            fn read(values: &mut ::fmi2::block::ParameterReader<'_>) -> Self {
                Self { #(#readers),* }
            }
        }
        impl ::std::default::Default for #block {
            fn default() -> Self {
                ::fmi2::declare::start_parameters()
            }
        }
        #(#extra)*
    })
}

/// A field that is a parameter block itself.
fn is_nested(field: &Field) -> bool {
    field.attrs.iter().any(|attribute| attribute.path().is_ident("parameters"))
}

/// Declarations and reader of a nested block.
fn nested(field: &Field) -> Result<(TokenStream, TokenStream)> {
    if let Some(other) = field.attrs.iter().find(|attribute| attribute.path().is_ident("par")) {
        return Err(Error::new_spanned(other, "the fields of a nested block carry their own attributes"));
    }
    let ty = &field.ty;
    Ok((
        quote!(all.extend(<#ty as ::fmi2::block::Parameters>::declare());),
        quote!(<#ty as ::fmi2::block::Parameters>::read(values)),
    ))
}

/// Declaration and reader of one parameter.
fn parameter(field: &Field) -> Result<(TokenStream, TokenStream)> {
    let (attribute, variable) = Variable::of(field, &["par"])?;
    if attribute.is_none() {
        return Err(Error::new_spanned(&field.ident, "a parameter needs its start value, as in `#[par(start = 1.0)]`"));
    }
    let doc = doc(&field.attrs);
    let ty = &field.ty;
    let is_mode = variable.flag("mode")?;
    let is_integer = is_type(field, "i32");
    let is_real = !is_mode && !is_integer && !is_type(field, "bool") && !is_type(field, "String");
    variable.allow(match (is_mode, is_integer, is_real) {
        (true, _, _) => &["start", "tunable", "mode"],
        (_, true, _) => &["start", "min", "max", "tunable"],
        (_, _, true) => REAL_KEYS,
        _ => &["start", "tunable"],
    })?;
    let Some(start) = variable.value("start")? else {
        return Err(Error::new(variable.span(), "the start value is missing, as in `start = 1.0`"));
    };
    variable.check_start(start)?;
    if is_real {
        let (mut spec, unit) = variable.spec_and_unit("quantity", &doc)?;
        if GRID.iter().any(|(method, _)| name(field) == method) {
            if let Some((key, _)) = variable.keys.iter().find(|(key, _)| key == "tunable") {
                return Err(Error::new(
                    key.span(),
                    "the division of the time is fixed, it cannot change between steps",
                ));
            }
            let seconds = quote_spanned!(variable.span()=> const _: () = ::fmi2::unit::require_seconds(&#unit););
            spec = quote!({ #seconds #spec.positive() });
        }
        return Ok((quote!(#spec.declare::<f64, #ty>(&mut all);), quote!(::fmi2::block::read_reals::<#ty>(values))));
    }
    let Source::Name(text) = &variable.source else {
        return Err(Error::new(
            variable.span(),
            "only real parameters stand in a catalogue; write the name as a string",
        ));
    };
    if doc.is_empty() {
        return Err(Error::new(text.span(), "the doc comment is missing: it is the description of the variable"));
    }
    let tunable = variable.flag("tunable")?;
    let kind = if is_mode {
        quote!(::fmi2::declare::mode::<#ty>(#start))
    } else if is_integer {
        let (Some(min), Some(max)) = (variable.value("min")?, variable.value("max")?) else {
            return Err(Error::new(variable.span(), "a whole number needs `min = …` and `max = …`"));
        };
        quote!(::fmi2::variable::Kind::Integer { start: #start, min: #min, max: #max, type_name: "", choices: &[] })
    } else if is_type(field, "bool") {
        quote!(::fmi2::variable::Kind::Boolean { start: #start })
    } else {
        quote!(::fmi2::variable::Kind::String { start: ::std::string::String::from(#start) })
    };
    let reader = if is_mode {
        quote!(::fmi2::block::read_mode::<#ty>(values))
    } else {
        quote!(<#ty as ::fmi2::block::ParameterField>::read(values))
    };
    Ok((quote!(::fmi2::declare::other(&mut all, #text, #doc, #tunable, #kind);), reader))
}

/// Inputs, outputs, states.
pub(crate) fn numbers(input: &DeriveInput, is_state: bool) -> Result<TokenStream> {
    let block = &input.ident;
    let (number, generics) = match input.generics.params.iter().collect::<Vec<_>>()[..] {
        [] => (quote!(f64), quote!()),
        [GenericParam::Type(parameter)] => {
            let ident = &parameter.ident;
            (quote!(#ident), quote!(<#ident: ::fmi2::Scalar>))
        }
        _ => {
            return Err(Error::new_spanned(
                &input.generics,
                "expected no type parameter, or one: the number type, as in `Inputs<T>`",
            ));
        }
    };
    let ty = if generics.is_empty() { quote!(#block) } else { quote!(#block<#number>) };
    let mut declarations = Vec::new();
    let mut names = Vec::new();
    let mut types = Vec::new();
    for field in fields(input)? {
        let (kind, variable) = Variable::of(field, &["signal", "var"])?;
        let kind = kind.as_deref();
        match (&variable.source, kind) {
            (Source::Name(text), Some("signal")) => {
                let message = "expected an entry of the signal catalogue; `#[var(\"name\", unit = …)]` declares a variable in place";
                return Err(Error::new(text.span(), message));
            }
            (Source::Entry(entry), Some("var")) => {
                let message = "expected the name as a string; `#[signal(…)]` takes an entry of the catalogue";
                return Err(Error::new_spanned(entry, message));
            }
            _ => {}
        }
        variable.allow(if is_state {
            &["unit", "start", "nominal", "display", "local"]
        } else {
            &["unit", "start", "nominal", "display"]
        })?;
        let spec = variable.spec("signal", &doc(&field.attrs)).map_err(|error| match kind {
            Some(_) => error,
            None => Error::new(error.span(), format!("{error}; an entry of a catalogue needs `#[signal(…)]`")),
        })?;
        let field_type = &field.ty;
        declarations.push(quote!(#spec.declare::<#number, #field_type>(&mut all);));
        names.push(name(field));
        types.push(field_type);
    }
    Ok(quote! {
        impl #generics ::fmi2::Block<#number> for #ty {
            const LEN: usize = 0 #(+ <#types as ::fmi2::Field<#number>>::LEN)*;
            fn declare() -> ::std::vec::Vec<::fmi2::variable::Declaration> {
                #[allow(unused_mut)]
                let mut all = ::std::vec::Vec::new();
                #(#declarations)*
                all
            }
            #[inline]
            #[allow(unused_variables)]
            fn read(values: &[#number]) -> Self {
                // One check of the length instead of one per field.
                let values = &values[..<Self as ::fmi2::Block<#number>>::LEN];
                #(
                    let #names = <#types as ::fmi2::Field<#number>>::read(values);
                    let values = &values[<#types as ::fmi2::Field<#number>>::LEN..];
                )*
                Self { #(#names),* }
            }
            #[inline]
            #[allow(unused_variables)]
            fn write(&self, values: &mut [#number]) {
                let values = &mut values[..<Self as ::fmi2::Block<#number>>::LEN];
                #(
                    ::fmi2::Field::<#number>::write(&self.#names, values);
                    let values = &mut values[<#types as ::fmi2::Field<#number>>::LEN..];
                )*
            }
            #[inline]
            #[allow(unused_variables)]
            fn zip(&self, other: &Self, f: impl Fn(#number, #number) -> #number + Copy) -> Self {
                Self { #(#names: ::fmi2::Field::<#number>::zip(&self.#names, &other.#names, f)),* }
            }
        }
        impl #generics ::std::default::Default for #ty {
            fn default() -> Self {
                ::fmi2::declare::start_block()
            }
        }
    })
}

/// What follows from the parameters.
pub(crate) fn design(input: &DeriveInput) -> Result<TokenStream> {
    let block = &input.ident;
    let mut declarations = Vec::new();
    let mut names = Vec::new();
    let mut types = Vec::new();
    for field in fields(input)? {
        if !field.attrs.iter().any(|attribute| attribute.path().is_ident("calculated")) {
            continue;
        }
        let (_, variable) = Variable::of(field, &["calculated"])?;
        variable.allow(&["unit", "display"])?;
        let spec = variable.spec("quantity", &doc(&field.attrs))?;
        let ty = &field.ty;
        declarations.push(quote!(#spec.declare::<f64, #ty>(&mut all);));
        names.push(name(field));
        types.push(ty);
    }
    Ok(quote! {
        impl ::fmi2::block::Design for #block {
            fn declare() -> ::std::vec::Vec<::fmi2::variable::Declaration> {
                #[allow(unused_mut)]
                let mut all = ::std::vec::Vec::new();
                #(#declarations)*
                all
            }
            #[allow(unused_variables)]
            fn write(&self, values: &mut [f64]) {
                #(
                    ::fmi2::Field::<f64>::write(&self.#names, values);
                    let values = &mut values[<#types as ::fmi2::Field<f64>>::LEN..];
                )*
            }
        }
    })
}

/// What a sampled unit remembers.
pub(crate) fn memory(input: &DeriveInput) -> Result<TokenStream> {
    let block = &input.ident;
    let all: Vec<_> = fields(input)?.iter().collect();
    let names: Vec<_> = all.iter().map(|field| name(field)).collect();
    let texts: Vec<_> = names.iter().map(|name| name.to_string()).collect();
    let searched: Vec<_> = all
        .iter()
        .filter(|field| !field.attrs.iter().any(|attribute| attribute.path().is_ident("generated")))
        .map(|field| {
            let (name, text) = (name(field), name(field).to_string());
            quote! {
                if let Some(value) = ::fmi2::block::MemoryField::not_finite(&self.#name) {
                    return Some((#text, value));
                }
            }
        })
        .collect();
    Ok(quote! {
        impl ::fmi2::block::Memory for #block {
            fn save(&self, sink: &mut dyn FnMut(&'static str, ::fmi2::block::Word)) {
                #(::fmi2::block::MemoryField::save(&self.#names, #texts, sink);)*
            }
            fn load(
                &mut self,
                source: &mut dyn FnMut() -> ::std::option::Option<::fmi2::block::Word>,
            ) -> ::std::result::Result<(), ::std::string::String> {
                #(::fmi2::block::MemoryField::load(&mut self.#names, #texts, source)?;)*
                Ok(())
            }
            #[inline]
            fn not_finite(&self) -> ::std::option::Option<(&'static str, f64)> {
                #(#searched)*
                None
            }
        }
    })
}
