//! Associated types that the functions of a model use and that its implementation does not declare.

use proc_macro2::{Ident, TokenStream};
use quote::{ToTokens, format_ident, quote};
use syn::visit::{self, Visit};
use syn::{Error, Expr, FnArg, GenericParam, ImplItem, ImplItemFn, Member, Pat, ReturnType, Type, parse_quote};

use crate::errors::Errors;
use crate::model::Kind;

/// Reports each missing type. Adds the type and empties the functions, so that the compiler reports no follow-up errors.
pub(crate) fn complete(items: &mut Vec<ImplItem>, kind: Kind, root: &TokenStream, errors: &mut Errors) {
    let mut added = Vec::new();
    for name in kind.types() {
        let is_declared = items.iter().any(|item| matches!(item, ImplItem::Type(item) if item.ident == name));
        if is_declared {
            continue;
        }
        let functions = || {
            items.iter().filter_map(|item| match item {
                ImplItem::Fn(function) => Some(function),
                _ => None,
            })
        };
        let is_generic = kind == Kind::Continuous && *name != "DiscreteState";
        let parameter = if is_generic { "<T: Scalar>" } else { "" };
        let declared =
            functions().find_map(|function| Some((in_signature(name, kind, function)?, number(function).cloned())));
        let (ty, number) = if let Some((ty, number)) = declared {
            let shown = without_blanks(&ty);
            let message = format!("`type {name}` is missing, as in `type {name}{parameter} = {shown};`");
            errors.add(Error::new_spanned(&ty, message));
            (ty, number)
        } else if let Some(used) = functions().find_map(|function| in_body(name, kind, function)) {
            let example =
                format!("{}{}", if *name == "Inputs" { "U" } else { "X" }, if is_generic { "<T>" } else { "" });
            let message = format!(
                "the model has no `type {name}`, so there is nothing in `{}`; declare it, as in \
                 `type {name}{parameter} = {example};`",
                without_blanks(&used)
            );
            errors.add(Error::new_spanned(&used, message));
            (parse_quote!(()), None)
        } else {
            continue;
        };
        let ident = format_ident!("{name}");
        let number = number.unwrap_or_else(|| format_ident!("T"));
        let generics = is_generic.then(|| quote!(<#number: #root::Scalar>));
        added.push(quote!(type #ident #generics = #ty;));
    }
    if added.is_empty() {
        return;
    }
    for item in items.iter_mut() {
        if let ImplItem::Fn(function) = item {
            function.attrs.push(parse_quote!(#[allow(unused)]));
            function.block = parse_quote!({ ::core::unreachable!() });
        }
    }
    items.extend(added.into_iter().map(|item| parse_quote!(#item)));
}

/// Code as the author writes it: `X<T>`, not `X < T >`.
fn without_blanks(code: &impl ToTokens) -> String {
    code.to_token_stream().to_string().replace(' ', "")
}

impl Kind {
    /// The types that are empty if they are not declared.
    const fn types(self) -> &'static [&'static str] {
        match self {
            Self::Continuous => &["State", "Inputs", "Outputs", "DiscreteState"],
            Self::Discrete => &["State", "Inputs", "Outputs"],
            Self::Stateful => &["Inputs", "Outputs"],
        }
    }

    /// The field of the argument in which a function finds values of the type.
    fn field(self, name: &str) -> Option<&'static str> {
        match (self, name) {
            (Self::Continuous | Self::Discrete, "State") => Some("state"),
            (Self::Continuous | Self::Discrete, "Inputs") => Some("inputs"),
            (Self::Continuous, "DiscreteState") => Some("discrete"),
            _ => None,
        }
    }
}

/// The type in the signature of a function that is `name` by definition.
fn in_signature(name: &str, kind: Kind, function: &ImplItemFn) -> Option<Type> {
    let returned = || match &function.sig.output {
        ReturnType::Type(_, ty) => Some((**ty).clone()),
        ReturnType::Default => None,
    };
    let ty = match (kind, name, function.sig.ident.to_string().as_str()) {
        (Kind::Continuous, "State", "derivatives" | "advance")
        | (_, "Outputs", "outputs")
        | (Kind::Continuous, "DiscreteState", "initial_discrete_state")
        | (Kind::Discrete, "Outputs", "update")
        | (Kind::Discrete, "State", "initial_state") => returned()?,
        (Kind::Continuous, "State", "evaluate") => pair(returned()?)?.0,
        (Kind::Continuous, "Outputs", "evaluate") => pair(returned()?)?.1,
        (Kind::Stateful, "Inputs", "step") => match function.sig.inputs.iter().nth(2)? {
            FnArg::Typed(argument) => match &*argument.ty {
                Type::Reference(reference) => (*reference.elem).clone(),
                _ => return None,
            },
            FnArg::Receiver(_) => return None,
        },
        _ => return None,
    };
    let is_empty = matches!(&ty, Type::Tuple(tuple) if tuple.elems.is_empty());
    let is_relative =
        matches!(&ty, Type::Path(path) if path.path.segments.first().is_some_and(|first| first.ident == "Self"));
    (!is_empty && !is_relative).then_some(ty)
}

fn pair(ty: Type) -> Option<(Type, Type)> {
    let Type::Tuple(tuple) = ty else { return None };
    let mut types = tuple.elems.into_iter();
    Some((types.next()?, types.next()?))
}

/// The type parameter of a function.
fn number(function: &ImplItemFn) -> Option<&Ident> {
    function.sig.generics.params.iter().find_map(|parameter| match parameter {
        GenericParam::Type(parameter) => Some(&parameter.ident),
        _ => None,
    })
}

/// The first access of a function to values of the type, such as `at.inputs.speed` or `let U { speed } = at.inputs`.
fn in_body(name: &str, kind: Kind, function: &ImplItemFn) -> Option<Expr> {
    let arguments = function.sig.inputs.iter().filter_map(|argument| match argument {
        FnArg::Typed(argument) => match &*argument.pat {
            Pat::Ident(pattern) => Some(pattern.ident.clone()),
            _ => None,
        },
        FnArg::Receiver(_) => None,
    });
    let mut search = Search { arguments: arguments.collect(), field: kind.field(name)?, found: None };
    search.visit_block(&function.block);
    search.found
}

struct Search {
    arguments: Vec<Ident>,
    field: &'static str,
    found: Option<Expr>,
}

impl Search {
    /// Notes the expression if it is the field of an argument.
    fn note(&mut self, expression: &Expr) {
        if let Expr::Field(access) = expression
            && matches!(&access.member, Member::Named(member) if member == self.field)
            && matches!(&*access.base, Expr::Path(path)
                if path.path.get_ident().is_some_and(|base| self.arguments.contains(base)))
        {
            self.found.get_or_insert_with(|| expression.clone());
        }
    }
}

impl<'ast> Visit<'ast> for Search {
    fn visit_expr_field(&mut self, access: &'ast syn::ExprField) {
        self.note(&access.base);
        visit::visit_expr_field(self, access);
    }

    fn visit_local(&mut self, local: &'ast syn::Local) {
        if let (Pat::Struct(_), Some(init)) = (&local.pat, &local.init) {
            self.note(&init.expr);
        }
        visit::visit_local(self, local);
    }
}
