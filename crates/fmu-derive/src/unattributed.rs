//! Implementations of a model trait that lack `#[fmu::model]`. The compiler would list all items that the attribute
//! adds.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::visit::{self, Visit};
use syn::{DeriveInput, Error, ImplItem, ItemImpl, Type};

use crate::attribute::root;

/// The error, as tokens, if the model's implementation is in the same file and lacks the attribute.
pub(crate) fn error(input: &DeriveInput) -> Option<TokenStream> {
    let file = input.ident.span().unwrap().local_file()?;
    let file = syn::parse_file(&std::fs::read_to_string(file).ok()?).ok()?;
    let mut search = Search { model: input.ident.to_string(), found: None };
    search.visit_file(&file);
    let of = search.found?;
    let message = format!(
        "the attribute of the model is missing: write `#[fmu::model(stop_time = 10.0, step_size = 0.01)]` above \
         `impl {of} for {}`",
        input.ident
    );
    let error = Error::new(input.ident.span(), message).into_compile_error();
    let root = root(&input.attrs).ok()?;
    let of = format_ident!("{of}");
    // A second implementation, for an unknown type, keeps the compiler from reporting missing items in the first.
    Some(quote!(#error impl #root::#of for __attribute_is_missing::Model {}))
}

/// Looks for an implementation without the attribute.
struct Search {
    model: String,
    found: Option<String>,
}

impl<'ast> Visit<'ast> for Search {
    fn visit_item_impl(&mut self, block: &'ast ItemImpl) {
        visit::visit_item_impl(self, block);
        let of = block.trait_.as_ref().and_then(|(path, ..)| path.segments.last()).map(|last| last.ident.to_string());
        let Some(of) = of.filter(|of| ["Continuous", "Discrete", "Stateful"].contains(&of.as_str())) else { return };
        let is_model = matches!(&*block.self_ty, Type::Path(path) if path.path.is_ident(&self.model));
        // Any other attribute could be `model` under another name or condition.
        let plain = ["doc", "allow", "expect"];
        let is_plain = block.attrs.iter().all(|attribute| plain.iter().any(|known| attribute.path().is_ident(known)));
        let is_complete = block.items.iter().any(|item| matches!(item, ImplItem::Const(item) if item.ident == "INFO"));
        if is_model && is_plain && !is_complete {
            self.found = Some(of);
        }
    }
}
