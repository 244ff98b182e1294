//! The parameters that the equations read.

use std::collections::BTreeSet;

use proc_macro2::{TokenStream, TokenTree};
use syn::ext::IdentExt as _;
use syn::visit::{self, Visit};
use syn::{Expr, ExprField, ExprMethodCall, GenericParam, ImplItem, Item, Local, Macro, Member, Pat};

/// The fields of `self` that the functions generic over the number type read; `None` if one of these functions passes
/// `self` to another function.
pub(crate) fn of_equations(items: &[ImplItem]) -> Option<BTreeSet<String>> {
    let is_generic = |parameter: &GenericParam| matches!(parameter, GenericParam::Type(_));
    let functions = || {
        items.iter().filter_map(|item| match item {
            ImplItem::Fn(function) if function.sig.generics.params.iter().any(is_generic) => Some(function),
            _ => None,
        })
    };
    let known = functions().map(|function| function.sig.ident.to_string()).collect();
    let mut reads = Reads { known, fields: BTreeSet::new(), passes_on: false };
    for function in functions() {
        reads.visit_block(&function.block);
    }
    (!reads.passes_on).then_some(reads.fields)
}

struct Reads {
    /// The generic functions. Calls between them do not count as passing on `self`.
    known: BTreeSet<String>,
    fields: BTreeSet<String>,
    passes_on: bool,
}

impl Reads {
    fn field(&mut self, member: &Member) {
        if let Member::Named(name) = member {
            self.fields.insert(name.unraw().to_string());
        }
    }

    /// Searches the tokens of a macro call. `self.field` reads a field; any other use of `self` passes it on.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut rest = tokens.into_iter().peekable();
        while let Some(token) = rest.next() {
            match token {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(word) if word == "self" => {
                    let is_dot = |token: &TokenTree| matches!(token, TokenTree::Punct(point) if point.as_char() == '.');
                    let name = rest.next_if(is_dot).and_then(|_| match rest.next() {
                        Some(TokenTree::Ident(name)) => Some(name),
                        _ => None,
                    });
                    let is_call = matches!(rest.peek(), Some(TokenTree::Group(_)));
                    match name {
                        Some(name) if !is_call => {
                            self.fields.insert(name.unraw().to_string());
                        }
                        _ => self.passes_on = true,
                    }
                }
                _ => {}
            }
        }
    }
}

fn is_self(expression: &Expr) -> bool {
    match expression {
        Expr::Path(path) => path.path.is_ident("self"),
        Expr::Paren(inner) => is_self(&inner.expr),
        Expr::Reference(inner) => is_self(&inner.expr),
        _ => false,
    }
}

impl<'ast> Visit<'ast> for Reads {
    fn visit_expr_field(&mut self, access: &'ast ExprField) {
        if is_self(&access.base) {
            self.field(&access.member);
        } else {
            visit::visit_expr_field(self, access);
        }
    }

    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        if is_self(&call.receiver) && self.known.contains(&call.method.to_string()) {
            call.args.iter().for_each(|argument| self.visit_expr(argument));
        } else {
            visit::visit_expr_method_call(self, call);
        }
    }

    /// A pattern such as `let Self { a, b, .. } = self;` reads the fields that it lists.
    fn visit_local(&mut self, local: &'ast Local) {
        match (&local.pat, &local.init) {
            (Pat::Struct(pattern), Some(init)) if is_self(&init.expr) => {
                pattern.fields.iter().for_each(|field| self.field(&field.member));
            }
            _ => visit::visit_local(self, local),
        }
    }

    fn visit_expr(&mut self, expression: &'ast Expr) {
        if is_self(expression) {
            self.passes_on = true;
        } else {
            visit::visit_expr(self, expression);
        }
    }

    fn visit_macro(&mut self, call: &'ast Macro) {
        self.tokens(call.tokens.clone());
    }

    // A nested item has a different `self`.
    fn visit_item(&mut self, _: &'ast Item) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use syn::parse_quote;

    fn reads(body: syn::Block) -> Option<Vec<String>> {
        let item: syn::ItemImpl = parse_quote! {
            impl Continuous for M {
                fn load(&self, folder: &Path) -> Result<(), String> { read(self.file) }
                fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> #body
            }
        };
        of_equations(&item.items).map(|fields| fields.into_iter().collect())
    }

    #[test]
    fn fields_are_listed_unless_self_is_passed_on() {
        let all = |names: &[&str]| Some(names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
        assert_eq!(reads(parse_quote!({ at.state.x * self.rate + (&self).nested.value })), all(&["nested", "rate"]));
        assert_eq!(
            reads(parse_quote!({
                let Self { rate, r#type, .. } = self;
                rate
            })),
            all(&["rate", "type"])
        );
        assert_eq!(
            reads(parse_quote!({
                let c = || self.a;
                self.outputs(self.b);
            })),
            None
        );
        assert_eq!(reads(parse_quote!({ self.derivatives(self.b) })), all(&["b"]));
        assert_eq!(
            reads(parse_quote!({
                assert!(self.a > 0.0, "{}", self.b.c);
            })),
            all(&["a", "b"])
        );
        assert_eq!(
            reads(parse_quote!({
                assert!(self.is_good());
            })),
            None
        );
        assert_eq!(reads(parse_quote!({ helper(self, at) })), None);
        assert_eq!(
            reads(parse_quote!({
                let p = self;
                p.rate
            })),
            None
        );
        assert_eq!(reads(parse_quote!({ at.state.x })), all(&[]));
    }
}
