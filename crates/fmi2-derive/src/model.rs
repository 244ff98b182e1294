//! What an implementation of a model need not say.

use proc_macro2::TokenStream;
use quote::quote;
use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::{Error, Expr, ImplItem, ItemImpl, MetaNameValue, Result, Token, Type, parse_quote};

use crate::attribute::doc;

const EXAMPLE: &str = "as in `#[model(stop_time = 10.0, step_size = 0.001)]`";

/// Adds what is missing.
pub(crate) fn model(arguments: TokenStream, item: TokenStream) -> Result<TokenStream> {
    let mut block: ItemImpl = syn::parse2(item)?;
    let kind = block.trait_.as_ref().and_then(|(path, _)| path.segments.last()).map(|last| last.ident.to_string());
    let parameters: Type = match kind.as_deref() {
        Some("Plant") => parse_quote!(::fmi2::parameters::MaxStep),
        Some("Sampled") => parse_quote!(::fmi2::parameters::SampleTime),
        _ => return Err(Error::new_spanned(&block.self_ty, "expected `impl Plant for …` or `impl Sampled for …`")),
    };
    let info = info(arguments, &block)?;
    let has = |name: &str| {
        block.items.iter().any(|item| match item {
            ImplItem::Const(item) => item.ident == name,
            ImplItem::Fn(item) => item.sig.ident == name,
            ImplItem::Type(item) => item.ident == name,
            _ => false,
        })
    };
    if has("INFO") {
        return Err(Error::new_spanned(&block.self_ty, "INFO follows from the attribute; leave one of them out"));
    }
    let mut missing: Vec<ImplItem> = vec![info];
    if !has("Parameters") {
        missing.push(parse_quote!(type Parameters = #parameters;));
    }
    if !has("Design") {
        missing.push(parse_quote! { type Design = (); });
        missing.push(parse_quote! {
            fn design(_: &Self::Parameters) -> ::std::result::Result<(), ::std::string::String> {
                Ok(())
            }
        });
    }
    if !has("Memory") && kind.as_deref() == Some("Sampled") {
        missing.push(parse_quote! { type Memory = (); });
    }
    block.items.extend(missing);
    Ok(quote!(#block))
}

/// Name, description, version and default experiment.
fn info(arguments: TokenStream, block: &ItemImpl) -> Result<ImplItem> {
    let keys = Punctuated::<MetaNameValue, Token![,]>::parse_terminated.parse2(arguments)?;
    let (mut stop_time, mut step_size) = (None, None);
    for key in keys {
        let place: &mut Option<Expr> = match key.path.get_ident().map(ToString::to_string).as_deref() {
            Some("stop_time") => &mut stop_time,
            Some("step_size") => &mut step_size,
            _ => return Err(Error::new_spanned(key.path, format!("expected stop_time or step_size, {EXAMPLE}"))),
        };
        if place.replace(key.value).is_some() {
            return Err(Error::new_spanned(key.path, "this key is given twice"));
        }
    }
    let missing = |what: &str| Error::new_spanned(&block.self_ty, format!("{what} is missing, {EXAMPLE}"));
    let stop_time = stop_time.ok_or_else(|| missing("stop_time, the length of the default experiment in s,"))?;
    let step_size = step_size.ok_or_else(|| missing("step_size, the communication step in s,"))?;
    let name = match &*block.self_ty {
        Type::Path(path) => path.path.get_ident().map(ToString::to_string),
        _ => None,
    };
    let name =
        name.ok_or_else(|| Error::new_spanned(&block.self_ty, "expected the plain name of a type: that of the FMU"))?;
    let description = doc(&block.attrs);
    if description.is_empty() {
        let message = "the doc comment is missing: it is the description of the FMU";
        return Err(Error::new_spanned(&block.self_ty, message));
    }
    Ok(parse_quote! {
        const INFO: ::fmi2::Info = ::fmi2::Info {
            name: #name,
            description: #description,
            version: env!("CARGO_PKG_VERSION"),
            stop_time: #stop_time,
            step_size: #step_size,
        };
    })
}
