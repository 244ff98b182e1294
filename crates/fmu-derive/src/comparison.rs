//! Comparisons in equations. The number type of the equations has no comparison operators, so the compiler would ask
//! for `PartialOrd`. Calls of a trait in `fmu`, which replace the operators, give a helpful message instead.

use proc_macro2::{Span, TokenStream};
use quote::quote_spanned;
use syn::spanned::Spanned as _;
use syn::visit_mut::{self, VisitMut};
use syn::{BinOp, Expr, ExprConst, ExprRepeat, GenericParam, ImplItem, ImplItemFn, Item, Pat, Type};

/// Replaces the comparisons in functions that are generic over the number type.
pub(crate) fn replace(items: &mut [ImplItem], root: &TokenStream) {
    let is_generic = |item: &ImplItemFn| item.sig.generics.params.iter().any(|p| matches!(p, GenericParam::Type(_)));
    for item in items {
        if let ImplItem::Fn(item) = item
            && is_generic(item)
        {
            Comparisons { root }.visit_block_mut(&mut item.block);
        }
    }
}

struct Comparisons<'a> {
    root: &'a TokenStream,
}

impl VisitMut for Comparisons<'_> {
    fn visit_expr_mut(&mut self, expression: &mut Expr) {
        visit_mut::visit_expr_mut(self, expression);
        let Expr::Binary(binary) = &*expression else { return };
        let operator = binary.op.span().resolved_at(Span::call_site());
        let function = match binary.op {
            BinOp::Gt(_) => quote_spanned!(operator=> Ordered::greater),
            BinOp::Ge(_) => quote_spanned!(operator=> Ordered::greater_or_equal),
            BinOp::Lt(_) => quote_spanned!(operator=> Ordered::less),
            BinOp::Le(_) => quote_spanned!(operator=> Ordered::less_or_equal),
            BinOp::Eq(_) => quote_spanned!(operator=> Equal::equal),
            BinOp::Ne(_) => quote_spanned!(operator=> Equal::not_equal),
            _ => return,
        };
        let (root, left, right) = (self.root, &binary.left, &binary.right);
        // Borrows both operands, as the operator does.
        *expression = Expr::Verbatim(quote_spanned!(operator=> #root::comparison::#function(&(#left), &(#right))));
    }

    // Constant expressions cannot call traits, and nested items have their own types.
    fn visit_item_mut(&mut self, _: &mut Item) {}
    fn visit_type_mut(&mut self, _: &mut Type) {}
    fn visit_pat_mut(&mut self, _: &mut Pat) {}
    fn visit_expr_const_mut(&mut self, _: &mut ExprConst) {}
    fn visit_expr_repeat_mut(&mut self, repeat: &mut ExprRepeat) {
        self.visit_expr_mut(&mut repeat.expr);
    }
}
