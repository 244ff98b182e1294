//! Mistakes in associated types and functions for which the compiler's messages would be hard to understand: undeclared
//! types that functions of the model use, types in which the number type is missing or superfluous, functions with too
//! few or too many arguments.

use proc_macro2::{Ident, TokenStream};
use quote::{ToTokens, format_ident, quote};
use syn::visit::{self, Visit};
use syn::{
    Error, Expr, FnArg, GenericArgument, GenericParam, ImplItem, ImplItemFn, ImplItemType, Member, Pat, PathArguments,
    ReturnType, Type, parse_quote,
};

use crate::errors::Errors;

/// Reports each mistake. Then corrects declarations and empties functions to prevent follow-up errors of the compiler.
pub(crate) fn complete(items: &mut Vec<ImplItem>, kind: Kind, root: &TokenStream, errors: &mut Errors) {
    let mut mistakes = Errors::default();
    let mut added = Vec::new();
    for name in kind.types() {
        let is_generic = kind.is_generic(name);
        let declared = associated_type(items, name);
        if let Some(declared) = declared {
            let Some(message) = wrong_parameters(declared, is_generic) else { continue };
            mistakes.add(Error::new_spanned(declared, message));
        }
        let parameter = if is_generic { "<T: Scalar>" } else { "" };
        let shown = functions(items)
            .find_map(|function| Some((in_signature(name, kind, function)?, number(function).cloned())));
        let (ty, number) = if let Some((ty, number)) = shown {
            if declared.is_none() {
                let shown = without_blanks(&ty);
                let message = format!("`type {name}` is missing; add it, as in `type {name}{parameter} = {shown};`");
                mistakes.add(Error::new_spanned(&ty, message));
            }
            (ty, number)
        } else if declared.is_some() {
            (parse_quote!(()), None)
        } else if let Some(used) = functions(items).find_map(|function| in_body(name, kind, function)) {
            let example = match (*name, is_generic) {
                ("Inputs", true) => "U<T>",
                ("Inputs", false) => "U",
                ("Derived", _) => "D",
                (_, true) => "X<T>",
                (_, false) => "X",
            };
            let message = format!(
                "the model has no `type {name}`, so `{}` is empty; declare it, as in \
                 `type {name}{parameter} = {example};`",
                without_blanks(&used)
            );
            mistakes.add(Error::new_spanned(&used, message));
            (parse_quote!(()), None)
        } else {
            continue;
        };
        let ident = format_ident!("{name}");
        let number = number.unwrap_or_else(|| format_ident!("T"));
        let generics = is_generic.then(|| quote!(<#number: #root::Scalar>));
        items.retain(|item| !matches!(item, ImplItem::Type(item) if item.ident == ident));
        added.push(quote!(type #ident #generics = #ty;));
        let has_function = functions(items).any(|f| f.sig.ident == "derived" || f.sig.ident == "load");
        if *name == "Derived" && !has_function {
            added.push(quote! {
                fn derived(&self) -> ::core::result::Result<#ty, ::std::string::String> { ::core::unreachable!() }
            });
        }
    }
    for item in items.iter_mut() {
        if let ImplItem::Fn(function) = item
            && let Some(signature) = kind.signature(&function.sig.ident)
            && let Ok(expected) = with_paths(signature, root)
            && expected.sig.inputs.len() != function.sig.inputs.len()
        {
            let name = &function.sig.ident;
            let (count, given) = (expected.sig.inputs.len(), function.sig.inputs.len());
            let hint = if signature.contains("Self::Derived") {
                "; without `type Derived`, `Self::Derived` is `()`"
            } else {
                ""
            };
            let message =
                format!("`{name}` has {count} arguments including `self`, found {given}: write `{signature}`{hint}");
            mistakes.add(Error::new_spanned(&function.sig, message));
            *function = expected;
        }
    }
    if mistakes.is_empty() {
        return;
    }
    errors.keep(mistakes.finish(()));
    for item in items.iter_mut() {
        if let ImplItem::Fn(function) = item {
            function.attrs.push(parse_quote!(#[allow(unused)]));
            function.block = parse_quote!({ ::core::unreachable!() });
        }
    }
    items.extend(added.into_iter().map(|item| parse_quote!(#item)));
}

/// The mistake in the type parameters of an associated type.
fn wrong_parameters(declared: &ImplItemType, is_generic: bool) -> Option<String> {
    let (name, mut ty) = (&declared.ident, declared.ty.clone());
    let has_number = declared.generics.type_params().next().is_some();
    if has_number == is_generic {
        return None;
    }
    let is_unit = matches!(&ty, Type::Tuple(tuple) if tuple.elems.is_empty());
    if let Type::Path(path) = &mut ty
        && let Some(last) = path.path.segments.last_mut()
    {
        last.arguments = PathArguments::None;
    }
    let shown = without_blanks(&ty);
    Some(if is_generic {
        let (number, hint) = match is_unit {
            true => ("", String::new()),
            false => ("<T>", format!(", or `= {shown};` if it has no real variables")),
        };
        format!(
            "`type {name}` of a continuous-time model needs the number type of the equations: write \
             `type {name}<T: Scalar> = {shown}{number};`{hint}"
        )
    } else {
        format!("`type {name}` takes no number type here: write `type {name} = {shown};`")
    })
}

/// A function of a model trait, with full paths of types.
fn with_paths(signature: &str, root: &TokenStream) -> syn::Result<ImplItemFn> {
    let mut text = signature.replace("&Path", "&::std::path::Path");
    for name in ["Scalar", "At<", "Event<", "Sample<"] {
        text = text.replace(name, &format!("{root}::{name}"));
    }
    syn::parse_str(&format!("{text} {{ ::core::unreachable!() }}"))
}

/// Code without the spaces between tokens: `X<T>`, not `X < T >`.
fn without_blanks(code: &impl ToTokens) -> String {
    code.to_token_stream().to_string().replace(' ', "")
}

pub(crate) fn associated_type<'a>(items: &'a [ImplItem], name: &str) -> Option<&'a ImplItemType> {
    items.iter().find_map(|item| match item {
        ImplItem::Type(item) if item.ident == name => Some(item),
        _ => None,
    })
}

pub(crate) fn functions(items: &[ImplItem]) -> impl Iterator<Item = &ImplItemFn> {
    items.iter().filter_map(|item| match item {
        ImplItem::Fn(item) => Some(item),
        _ => None,
    })
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Continuous,
    Discrete,
    Stateful,
}

impl Kind {
    /// The types that default to `()`.
    pub(crate) const fn types(self) -> &'static [&'static str] {
        match self {
            Self::Continuous => &["State", "Inputs", "Outputs", "Derived", "DiscreteState"],
            Self::Discrete => &["State", "Inputs", "Outputs", "Derived"],
            Self::Stateful => &["Inputs", "Outputs"],
        }
    }

    /// Returns true if a type is generic over the number type of the equations.
    pub(crate) fn is_generic(self, name: &str) -> bool {
        self == Self::Continuous && ["State", "Inputs", "Outputs"].contains(&name)
    }

    /// Signature of a function of the trait.
    fn signature(self, function: &Ident) -> Option<&'static str> {
        const EQUATIONS: &[&str] = &[
            "fn derived(&self) -> Result<Self::Derived, String>",
            "fn load(&self, resources: &Path) -> Result<Self::Derived, String>",
            "fn fingerprint(derived: &Self::Derived) -> u64",
        ];
        const CONTINUOUS: &[&str] = &[
            "fn initialize(&self, derived: &Self::Derived, state: &mut Self::State<f64>)",
            "fn initial_discrete_state(&self, at: At<'_, f64, Self>) -> Self::DiscreteState",
            "fn derivatives<T: Scalar>(&self, at: At<'_, T, Self>) -> Self::State<T>",
            "fn outputs<T: Scalar>(&self, at: At<'_, T, Self>) -> Self::Outputs<T>",
            "fn evaluate<T: Scalar>(&self, at: At<'_, T, Self>) -> (Self::State<T>, Self::Outputs<T>)",
            "fn advance(&self, at: At<'_, f64, Self>, step: f64) -> Self::State<f64>",
            "fn zero_crossings(&self, at: At<'_, f64, Self>) -> Self::Crossings",
            "fn next_time_event(&self, at: At<'_, f64, Self>) -> Option<f64>",
            "fn on_event(&self, event: Event<'_, Self>)",
            "fn is_finished(&self, discrete: &Self::DiscreteState) -> bool",
        ];
        const DISCRETE: &[&str] = &[
            "fn initial_state(&self, derived: &Self::Derived) -> Self::State",
            "fn check(&self, sample: &Sample<'_, Self>) -> Result<(), String>",
            "fn update(&self, sample: Sample<'_, Self>) -> Self::Outputs",
        ];
        const STATEFUL: &[&str] = &[
            "fn start(&self, resources: &Path) -> Result<Self::Simulation, String>",
            "fn step(&self, simulation: &mut Self::Simulation, inputs: &Self::Inputs, time: f64, step: f64) -> \
                 Result<(), String>",
            "fn outputs(&self, simulation: &Self::Simulation) -> Self::Outputs",
        ];
        let (common, own) = match self {
            Self::Continuous => (EQUATIONS, CONTINUOUS),
            Self::Discrete => (EQUATIONS, DISCRETE),
            Self::Stateful => (&[][..], STATEFUL),
        };
        let name = function.to_string();
        let is_it = |signature: &&&str| signature[3..].split(['(', '<']).next() == Some(name.as_str());
        common.iter().chain(own).find(is_it).copied()
    }

    /// The field of a function's argument that contains values of the type.
    fn field(self, name: &str) -> Option<&'static str> {
        match (self, name) {
            (Self::Continuous | Self::Discrete, "State") => Some("state"),
            (Self::Continuous | Self::Discrete, "Inputs") => Some("inputs"),
            (Self::Continuous | Self::Discrete, "Derived") => Some("derived"),
            (Self::Continuous, "DiscreteState") => Some("discrete"),
            _ => None,
        }
    }
}

/// The type in the signature of a function that must be the associated type `name`.
fn in_signature(name: &str, kind: Kind, function: &ImplItemFn) -> Option<Type> {
    let returned = || match &function.sig.output {
        ReturnType::Type(_, ty) => Some((**ty).clone()),
        ReturnType::Default => None,
    };
    // The referenced type of an argument, `self` not counted.
    let argument = |index: usize| {
        let argument = function.sig.inputs.iter().filter(|argument| matches!(argument, FnArg::Typed(_))).nth(index)?;
        match argument {
            FnArg::Typed(argument) => match &*argument.ty {
                Type::Reference(reference) => Some((*reference.elem).clone()),
                _ => None,
            },
            FnArg::Receiver(_) => None,
        }
    };
    let ty = match (kind, name, function.sig.ident.to_string().as_str()) {
        (Kind::Continuous, "State", "derivatives" | "advance")
        | (_, "Outputs", "outputs")
        | (Kind::Continuous, "DiscreteState", "initial_discrete_state")
        | (Kind::Discrete, "Outputs", "update")
        | (Kind::Discrete, "State", "initial_state") => returned()?,
        (Kind::Continuous, "State", "evaluate") => pair(returned()?)?.0,
        (Kind::Continuous, "Outputs", "evaluate") => pair(returned()?)?.1,
        (Kind::Stateful, "Inputs", "step") => argument(1)?,
        (_, "Derived", "derived" | "load") => success(&returned()?)?,
        (Kind::Continuous, "Derived", "initialize") if function.sig.inputs.len() == 3 => argument(0)?,
        (Kind::Discrete, "Derived", "initial_state") | (_, "Derived", "fingerprint") => argument(0)?,
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

/// `D` in `Result<D, String>`.
fn success(ty: &Type) -> Option<Type> {
    let Type::Path(path) = ty else { return None };
    let PathArguments::AngleBracketed(arguments) = &path.path.segments.last()?.arguments else { return None };
    match arguments.args.first()? {
        GenericArgument::Type(ty) => Some(ty.clone()),
        _ => None,
    }
}

/// The type parameter of a function.
fn number(function: &ImplItemFn) -> Option<&Ident> {
    function.sig.generics.params.iter().find_map(|parameter| match parameter {
        GenericParam::Type(parameter) => Some(&parameter.ident),
        _ => None,
    })
}

/// The first access to values of the type in a function, such as `at.inputs.speed` or `let U { speed } = at.inputs`.
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
    /// Records the expression if it is the field of an argument.
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
