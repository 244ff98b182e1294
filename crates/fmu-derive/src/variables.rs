//! Structs of variables: parameters, inputs, outputs, states, derived parameters.

use proc_macro2::{Span, TokenStream};
use quote::{format_ident, quote, quote_spanned};
use syn::ext::IdentExt as _;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned as _;
use syn::{DeriveInput, Error, Expr, Field, GenericParam, Ident, Lit, LitStr, Result, Token};

use crate::attribute::{Content, Source, Variable, content, doc, element, fields, literal, name_of, root};
use crate::errors::Errors;

/// Role of a struct of variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Block {
    Parameters,
    Inputs,
    Outputs,
    State,
    Derived,
    /// The clocked fields of a discrete state.
    Clocked,
}

impl Block {
    /// The keys allowed on its fields.
    fn keys(self, content: Content) -> Vec<&'static str> {
        let keys = match (self, content) {
            (Self::Parameters, Content::Integer) => "start min max tunable elements description nested flatten",
            (Self::Parameters, Content::Binary) => "start mime tunable elements description nested flatten",
            (Self::Parameters, Content::Other) => "start tunable elements description nested flatten",
            (Self::Parameters, Content::Real) => {
                "unit start min max nominal display positive tunable elements description nested flatten"
            }
            (Self::Parameters, Content::Unknown) => {
                "start tunable enumeration unit min max nominal display positive elements description nested flatten"
            }
            (Self::Inputs | Self::Outputs, Content::Binary) => "start clock mime elements description nested flatten",
            (Self::Inputs | Self::Outputs, Content::Other) => "start clock elements description nested flatten",
            (Self::Inputs | Self::Outputs, Content::Integer) => {
                "start clock min max elements description nested flatten"
            }
            (Self::Inputs, _) => {
                "unit start clock min max nominal display intermediate elements description enumeration nested flatten"
            }
            (Self::Outputs, _) => {
                "unit start clock min max nominal display elements description enumeration nested flatten"
            }
            (Self::State, _) => "unit start nominal display local calculated elements description nested flatten",
            (Self::Clocked, Content::Binary) => "clock always_finite mime elements description",
            (Self::Clocked, Content::Integer | Content::Other) => "clock always_finite elements description",
            (Self::Clocked, _) => "clock always_finite unit nominal display elements description enumeration",
            (Self::Derived, Content::Binary) => "mime elements description",
            (Self::Derived, Content::Integer | Content::Other) => "elements description",
            (Self::Derived, _) => "unit nominal display elements description",
        };
        let fmi = if matches!(self, Self::State | Self::Clocked) { None } else { Some("fmi") };
        let structural =
            (self == Self::Parameters && matches!(content, Content::Integer | Content::Other)).then_some("structural");
        let is_constant = matches!(self, Self::Outputs | Self::Derived) && content != Content::Binary;
        let of_numbers: &[&str] = match content {
            Content::Real | Content::Unknown => &["quantity", "relative_quantity", "unbounded"],
            Content::Integer => &["quantity"],
            Content::Binary | Content::Other => &[],
        };
        let others =
            ["alias", "size"].into_iter().chain(fmi).chain(structural).chain(is_constant.then_some("constant"));
        keys.split(' ').chain(others).chain(of_numbers.iter().copied()).collect()
    }
}

/// A field, and the code that declares, reads and writes it.
struct Part {
    name: Ident,
    ty: syn::Type,
    /// The trait that reads and writes it: `Field` or `Variables`.
    by: TokenStream,
    /// The trait that combines states element by element.
    combine: TokenStream,
    declaration: TokenStream,
    /// The value of a constant, an expression of the type of the field.
    constant: Option<TokenStream>,
    /// Constant expression: true if a variable has an explicit start value.
    has_starts: TokenStream,
    /// Constant expression: true if a variable is a structural parameter.
    has_structure: TokenStream,
    /// Names of the structural parameters that are the lengths of an array.
    sizes: Vec<LitStr>,
    /// Constant expression of type `fmu::declare::Name`, followed by a comma, or nothing.
    text: TokenStream,
}

impl Part {
    fn span(&self) -> Span {
        self.ty.span().resolved_at(Span::call_site())
    }

    fn counts(&self, root: &TokenStream, number: &TokenStream) -> TokenStream {
        let Self { ty, by, .. } = self;
        quote_spanned!(self.span()=> <#ty as #root::#by<#number>>::COUNTS)
    }

    fn write(&self, root: &TokenStream, number: &TokenStream) -> TokenStream {
        let Self { name, ty, by, .. } = self;
        let value = match &self.constant {
            // The compiler must not warn that the field is never read.
            Some(constant) => quote!({ let _ = &self.#name; #constant }),
            None => quote!(self.#name),
        };
        quote_spanned!(self.span()=> <#ty as #root::#by<#number>>::write(&#value, values, at);)
    }
}

/// The names of the variables, and the functions that declare and write them.
fn members(parts: &[Part], root: &TokenStream, number: &TokenStream) -> TokenStream {
    let texts = parts.iter().map(|part| &part.text);
    let declarations = parts.iter().map(|part| &part.declaration);
    let writes = parts.iter().map(|part| part.write(root, number));
    let counts = parts.iter().map(|part| part.counts(root, number));
    quote! {
        const NAMES: &'static [#root::Name] = &[#(#texts)*];
        fn declare(all: &mut ::std::vec::Vec<#root::Declaration>) {
            let _ = &all;
            #(#declarations)*
        }
        #[inline]
        fn write(&self, values: &mut #root::ValuesMut<'_, #number>, at: #root::Counts) {
            let _ = (&values, at);
            #(
                #writes
                let at = at.plus(#counts);
            )*
            let _ = at;
        }
    }
}

/// The derive `Parameters`. Also reports an implementation of a model trait that lacks `#[fmu::model]`.
pub(crate) fn parameters(input: &DeriveInput) -> Result<TokenStream> {
    let tokens = variables(input, Block::Parameters)?;
    let error = crate::unattributed::error(input);
    Ok(quote!(#tokens #error))
}

/// The derives `Parameters`, `Inputs`, `Outputs` and `State`.
pub(crate) fn variables(input: &DeriveInput, block: Block) -> Result<TokenStream> {
    let root = root(&input.attrs)?;
    let ident = &input.ident;
    let parameter = match input.generics.params.iter().collect::<Vec<_>>()[..] {
        [] => None,
        [GenericParam::Type(parameter)] if block != Block::Parameters => Some(parameter.ident.clone()),
        [GenericParam::Const(parameter)] if block == Block::Parameters => {
            let message = "an FMU has a fixed number of variables, so a struct of parameters cannot have const \
                 parameters; use a constant, as in `const N: usize = 10;`";
            return Err(Error::new_spanned(&parameter.ident, message));
        }
        [ref other, ..] if block == Block::Parameters => {
            let message = "parameters have fixed types, such as `f64`; only inputs, outputs and states have the number \
                           type of the equations";
            return Err(Error::new_spanned(other, message));
        }
        _ => {
            return Err(Error::new_spanned(
                &input.generics,
                "expected no type parameter, or one: the number type of the equations, as in `Inputs<T>`",
            ));
        }
    };
    let mut errors = Errors::default();
    let fields = fields(input)?;
    // A struct without real variables can be used with any number type.
    let is_free = matches!(block, Block::Inputs | Block::Outputs) && fields.iter().all(|field| !may_be_real(field));
    let (number, generics, ty) = match &parameter {
        Some(t) => (quote!(#t), quote!(<#t: #root::Scalar>), quote!(#ident<#t>)),
        None if is_free => (quote!(__T), quote!(<__T: #root::Scalar>), quote!(#ident)),
        None => (quote!(f64), quote!(), quote!(#ident)),
    };
    let (start_number, start_generics) = match &parameter {
        Some(_) => (&number, &generics),
        None => (&quote!(f64), &quote!()),
    };
    let parts: Vec<Part> =
        fields.iter().filter_map(|field| errors.keep(part(field, block, &root, parameter.as_ref(), &number))).collect();
    twice(&fields, &mut errors);
    let names: Vec<_> = parts.iter().map(|part| &part.name).collect();
    // The local variables do not have the names of the fields, which could be `values` or `at`, the names of the
    // arguments.
    let locals: Vec<_> = (0..parts.len()).map(|i| format_ident!("field_{i}")).collect();
    let build = if matches!(&input.data, syn::Data::Struct(data) if matches!(data.fields, syn::Fields::Unit)) {
        quote!(Self)
    } else {
        quote!(Self { #(#names: #locals),* })
    };
    // All uses of a type have the span of the type, so the compiler reports a wrong type only once.
    let counts: Vec<_> = parts.iter().map(|part| part.counts(&root, &number)).collect();
    let reads = parts.iter().zip(&locals).map(|(part, local)| {
        let Part { ty, by, sizes, .. } = part;
        let method = match sizes.len() {
            1 => "with_length",
            _ => "with_lengths",
        };
        let method = Ident::new(method, part.span());
        let lengths = (!sizes.is_empty())
            .then(|| quote_spanned!(part.span()=> .#method([#(values.length(const { #root::hash(#sizes) })),*])));
        quote_spanned!(part.span()=> let #local = <#ty as #root::#by<#number>>::read(values, at)#lengths;)
    });
    let has_starts = parts.iter().map(|part| &part.has_starts);
    let has_structure = parts.iter().map(|part| &part.has_structure);
    let members = members(&parts, &root, &number);
    let mut tokens = quote! {
        #[automatically_derived]
        impl #generics #root::Variables<#number> for #ty {
            const COUNTS: #root::Counts = #root::Counts::ZERO
                #(.plus(#counts))*;
            const HAS_STARTS: bool = false #(|| #has_starts)*;
            const HAS_STRUCTURE: bool = false #(|| #has_structure)*;
            #members
            #[inline]
            fn read(values: #root::Values<'_, #number>, at: #root::Counts) -> Self {
                let _ = (values, at);
                #(
                    #reads
                    let at = at.plus(#counts);
                )*
                let _ = at;
                #build
            }
        }
        impl #start_generics ::std::default::Default for #ty {
            /// All variables with their start values.
            fn default() -> Self {
                #root::start_values::<#start_number, Self>()
            }
        }
    };
    if block == Block::State {
        let combine = parts.iter().map(|part| {
            let Part { name, ty, combine, .. } = part;
            quote_spanned! {part.span()=>
                #name: <#ty as #root::#combine<#number>>::combine(&self.#name, &other.#name, f)
            }
        });
        tokens.extend(quote! {
            impl #generics #root::ContinuousState<#number> for #ty {
                #[inline]
                fn combine(&self, other: &Self, f: impl Fn(#number, #number) -> #number + Copy) -> Self {
                    let _ = (other, f);
                    Self { #(#combine),* }
                }
            }
        });
    }
    if block == Block::Parameters {
        let texts = names.iter().map(|name| name.unraw().to_string());
        tokens.extend(quote! {
            impl #root::Parameters for #ty {
                const FIELDS: &'static [(&'static str, #root::Counts)] = &[#((#texts, #counts)),*];
            }
        });
    }
    errors.finish(tokens)
}

/// Returns true if a field of a struct without type parameter can contain real variables.
fn may_be_real(field: &Field) -> bool {
    match content(&field.ty, None) {
        // The equations are not differentiated with respect to numbers of 32 bits.
        Content::Real => !is_f32(&field.ty),
        Content::Integer | Content::Binary | Content::Other => false,
        // An alias of `f64` has a unit, an enumeration does not, and a nested struct may contain real variables.
        Content::Unknown => Variable::of(field)
            .is_ok_and(|variable| ["unit", "nested", "flatten"].iter().any(|key| variable.key(key).is_some())),
    }
}

fn is_f32(ty: &syn::Type) -> bool {
    name_of(ty).as_deref() == Some("f32")
}

/// A start value, or start values of an array: one for all elements, or one for each.
fn start_value(ty: &syn::Type, start: &Expr, root: &TokenStream, number: &TokenStream) -> TokenStream {
    let span = start.span();
    match (element(ty), start) {
        (Some(inner), Expr::Array(starts)) => {
            let each = starts.elems.iter().map(|start| start_value(inner, start, root, number));
            // Both lengths are explicit, because the compiler's message about an inferred length is less clear.
            let count = starts.elems.len();
            quote_spanned! {span=>
                <<#ty as #root::Field<#number>>::Start>::listed::<#count>([#(#each),*])
            }
        }
        (_, Expr::Path(path)) if path.path.is_ident("identity") => quote_spanned!(span=> #root::start(#root::Identity)),
        // `From` wraps a value for the innermost arrays only.
        (Some(inner), start) if is_literal(start) || element(inner).is_some() => {
            let all = start_value(inner, start, root, number);
            quote_spanned!(span=> #root::Starts::All(#all))
        }
        (None, start) if is_literal(start) && is_number_of_another_type(ty, start) => {
            quote_spanned!(span=> #root::number(#start))
        }
        _ => quote_spanned!(span=> #root::start(#start)),
    }
}

fn is_literal(start: &Expr) -> bool {
    matches!(start, Expr::Lit(_) | Expr::Unary(_))
}

/// True for a number as the start value of an enumeration or a type alias.
fn is_number_of_another_type(ty: &syn::Type, start: &Expr) -> bool {
    literal(start).is_some() && name_of(ty).is_some_and(|name| !["f64", "i32"].contains(&name.as_str()))
}

/// The error message for a literal that does not match the type of the variable, as the value of `start` or `constant`.
fn mistaken_literal(ty: &syn::Type, key: &str, value: &Expr) -> Option<String> {
    let lit = match value {
        Expr::Array(values) => {
            let element = element(ty)?;
            return values.elems.iter().find_map(|value| mistaken_literal(element, key, value));
        }
        Expr::Unary(value) => return mistaken_literal(ty, key, &value.expr),
        Expr::Lit(value) => &value.lit,
        _ => return None,
    };
    let (variable, rule, example) = match (name_of(ty)?.as_str(), lit) {
        ("i8" | "u8" | "i16" | "u16" | "i32" | "u32" | "i64" | "u64", Lit::Int(_))
        | ("f64" | "f32", Lit::Int(_) | Lit::Float(_))
        | ("bool", Lit::Bool(_))
        | ("String", Lit::Str(_))
        | ("Bytes", Lit::ByteStr(_)) => return None,
        ("i8" | "u8" | "i16" | "u16" | "i32" | "u32" | "i64" | "u64", _) => ("an integer variable", "an integer", "2"),
        ("f64" | "f32", _) => ("a real variable", "a number", "1.0"),
        ("Bytes", _) => ("a Binary", "bytes", "b\"\\x01\\x02\""),
        ("bool", _) => ("a `bool`", "`true` or `false`", "true"),
        ("String", _) => ("a `String`", "a string", "\"file.csv\""),
        _ => return None,
    };
    let what = if key == "start" { "start value" } else { "value" };
    Some(format!("the {what} of {variable} must be {rule}, as in `{key} = {example}`"))
}

/// Returns true if the elements of an array have numbers, not names.
fn is_numbered(ty: &syn::Type, variable: &Variable) -> bool {
    match ty {
        syn::Type::Array(array) => variable.key("elements").is_none() && is_numbered(&array.elem, variable),
        _ if variable.key("size").is_some() => true,
        other => element(other).is_none(),
    }
}

/// Reports two variables with the same name.
fn twice(fields: &Punctuated<Field, Token![,]>, errors: &mut Errors) {
    let mut known: Vec<String> = Vec::new();
    for variable in fields.iter().filter_map(|field| Variable::of(field).ok()) {
        let name = match &variable.source {
            Source::Name(name) => Some(name),
            Source::Definition(_) => None,
        };
        for name in name.into_iter().chain(variable.aliases.iter().map(|alias| &alias.name)) {
            if known.contains(&name.value()) {
                errors.add(Error::new(name.span(), format!("two variables are named `{}`", name.value())));
            }
            known.push(name.value());
        }
    }
}

/// The error message for a type that cannot be the type of a variable.
fn mistaken(ty: &syn::Type, parameter: Option<&Ident>) -> Option<String> {
    let last = match ty {
        syn::Type::Path(path) => path.path.segments.last()?.ident.to_string(),
        other => return mistaken(element(other)?, parameter),
    };
    let types = match parameter {
        Some(parameter) => {
            if last == "f64" {
                return Some(format!("write `{parameter}`, the number type of the equations, instead of `f64`"));
            }
            parameter.to_string()
        }
        None => "f64".to_owned(),
    };
    let remedy = match last.as_str() {
        "usize" | "isize" => "write `i32`, and convert where the value is used, as in `self.count as usize`",
        "Vec" => {
            "an FMU has a fixed number of variables: write an array, as in `[f64; 4]`; for values computed from \
                 parameters, use a field of the derived parameters without `#[var]`"
        }
        "Option" => {
            "a variable always has a value: write the type of the value, and add a `bool` that is true if \
             the value is valid"
        }
        "char" | "i128" | "u128" => "",
        // The type may be an array.
        _ => return mistaken(element(ty)?, parameter),
    };
    let list = "`f32`, an integer of 8 to 64 bits, `bool`, `String`, `Bytes<N>`, an enum with \
                `#[derive(Enumeration)]`, or an array of these";
    Some(match remedy {
        "" => format!("`{last}` is not the type of a variable; expected `{types}`, {list}"),
        remedy => format!("`{last}` is not the type of a variable; {}", remedy.replace("f64", &types)),
    })
}

/// Builds the declaration of a field, and the code that reads and writes it.
fn part(
    field: &Field,
    block: Block,
    root: &TokenStream,
    parameter: Option<&Ident>,
    number: &TokenStream,
) -> Result<Part> {
    let name = field.ident.clone().expect("the fields are named");
    let ty = field.ty.clone();
    let variable = Variable::of(field)?;
    let content = content(&ty, parameter);
    let mut errors = Errors::default();
    let mut keys = block.keys(content);
    let is_nested = variable.key("nested").or(variable.key("flatten")).is_some();
    keys.extend(["terminal", "rule"].iter().filter(|_| is_nested && matches!(block, Block::Inputs | Block::Outputs)));
    let are_known = errors.keep(variable.allow(&keys)).is_some();
    if let Some(message) = mistaken(&ty, parameter) {
        errors.add(Error::new_spanned(&ty, message));
        return Err(errors.finish(()).unwrap_err());
    }
    if let Some(prefix) = variable.nested(field)? {
        let span = ty.span().resolved_at(Span::call_site());
        let of = quote_spanned!(span=> <#ty as #root::Variables<#number>>);
        let declaration = match errors.keep(variable.terminal(root, &doc(&field.attrs))).flatten() {
            Some(terminal) => quote_spanned!(span=> #root::terminal(#terminal, #prefix, #of::declare, all);),
            None => quote_spanned!(span=> #root::nested(#prefix, #of::declare, all);),
        };
        return errors.finish(Part {
            name,
            declaration,
            has_starts: quote_spanned!(span=> #of::HAS_STARTS),
            has_structure: quote_spanned!(span=> #of::HAS_STRUCTURE),
            text: quote_spanned!(span=> #root::Name::nested(#prefix, #of::NAMES),),
            ty,
            by: quote!(Variables),
            combine: quote!(ContinuousState),
            constant: None,
            sizes: Vec::new(),
        });
    }
    if block == Block::State && (matches!(content, Content::Integer | Content::Binary | Content::Other) || is_f32(&ty))
    {
        errors.add(Error::new_spanned(
            &ty,
            "a continuous state is `T`, the number type of the equations, or an array of it",
        ));
    }
    if block == Block::Parameters && !variable.is_explicit {
        errors.add(Error::new_spanned(&name, "a parameter needs a start value, as in `#[var(start = 1.0)]`"));
    }
    let start = errors.keep(variable.value("start")).flatten();
    let constant = errors.keep(variable.value("constant")).flatten();
    if let Some(value) = constant {
        if start.is_some() {
            errors.add(Error::new(value.span(), "a constant has its value from the start; remove `start`"));
        }
        if element(&ty).is_some() || content == Content::Binary || name_of(&ty).as_deref() == Some("String") {
            errors.add(Error::new(value.span(), "a constant is a single number, Boolean or enumeration"));
        }
        errors.keep(variable.check_start(value));
        if let Some(message) = mistaken_literal(&ty, "constant", value) {
            errors.add(Error::new(value.span(), message));
        }
    }
    match start {
        Some(start) => {
            if variable.key("calculated").is_some() {
                errors.add(Error::new(
                    start.span(),
                    "a calculated start value follows from the parameters; remove `start`",
                ));
            }
            errors.keep(variable.check_start(start));
            if let Some(message) = mistaken_literal(&ty, "start", start) {
                errors.add(Error::new(start.span(), message));
            }
        }
        None if block == Block::Parameters && variable.is_explicit && are_known && variable.key("start").is_none() => {
            errors.add(Error::new(variable.span(), "the start value is missing; add it, as in `start = 1.0`"));
        }
        None => {}
    }
    let doc = doc(&field.attrs);
    if block == Block::Parameters && (name == "sample_time" || name == "max_step") {
        if let Some(key) = variable.key("tunable") {
            errors.add(Error::new(key.span(), format!("`{name}` cannot change between steps; remove `tunable`")));
        }
        if variable.is_not_in_seconds(&doc) {
            errors.add(Error::new(variable.span(), format!("`{name}` must be in s")));
        }
    }
    let value = start.or(constant);
    let declaration = errors.keep(declaration(field, &variable, root, number, parameter, (content, &doc, value)));
    let constant = constant.map(|value| {
        let value = start_value(&ty, value, root, number);
        quote!({
            let value: <#ty as #root::Field<#number>>::Start = #value;
            <#ty as ::core::convert::From<_>>::from(value)
        })
    });
    let has_start = start.is_some();
    let has_structure = variable.key("structural").is_some();
    let is_array = element(&ty).is_some();
    for alias in variable.aliases.iter().filter(|_| is_array) {
        errors.add(Error::new(alias.name.span(), "an alias is another name of a scalar; this variable is an array"));
    }
    let aliases = variable.aliases.iter().map(|alias| &alias.name);
    let aliases = quote!(#(#root::Name::of(#aliases, false),)*);
    let text = match &variable.source {
        // Arrays with named elements can have the same name if their elements differ.
        _ if is_array && !is_numbered(&ty, &variable) => quote!(),
        Source::Name(name) => quote!(#root::Name::of(#name, #is_array), #aliases),
        Source::Definition(entry) => quote!(#root::Name::of(#entry.name, #is_array), #aliases),
    };
    errors.finish(Part {
        name,
        ty,
        by: quote!(Field),
        combine: quote!(RealField),
        constant,
        sizes: variable.sizes(&field.ty).unwrap_or_default(),
        declaration: declaration.unwrap_or_default(),
        has_starts: quote!(#has_start),
        has_structure: quote!(#has_structure),
        text,
    })
}

fn declaration(
    field: &Field,
    variable: &Variable,
    root: &TokenStream,
    number: &TokenStream,
    parameter: Option<&Ident>,
    (content, doc, start): (Content, &str, Option<&Expr>),
) -> Result<TokenStream> {
    let ty = &field.ty;
    let spec = variable.spec(root, doc, content, ty)?;
    let start = match start {
        Some(start) => {
            let start = start_value(ty, start, root, number);
            quote_spanned!(start.span()=> ::core::option::Option::Some(#start))
        }
        None => quote!(::core::option::Option::None),
    };
    // An alias of f64 also needs a unit, but only the compiler can resolve it.
    let has_unit = variable.key("unit").map(Ident::span);
    let check = if let Some(span) = has_unit.filter(|_| content == Content::Unknown && parameter.is_none()) {
        quote_spanned! {span=>
            const _: () = ::core::assert!(<#ty as #root::Field<f64>>::IS_REAL, "only real variables have a unit");
        }
    } else if content == Content::Unknown
        && parameter.is_none()
        && variable.key("unit").is_none()
        && matches!(variable.source, Source::Name(_))
    {
        let span = field.ident.as_ref().map_or_else(Span::call_site, Ident::span);
        quote_spanned! {span=>
            const _: () = ::core::assert!(
                !<#ty as #root::Field<f64>>::IS_REAL,
                "the unit of measure is missing; add it, as in `unit = \"rad\"`"
            );
        }
    } else {
        quote!()
    };
    let mut lengths = TokenStream::new();
    if let syn::Type::Array(array) = ty {
        let length = &array.len;
        for key in ["elements", "description", "unit"] {
            if let Some(list @ Expr::Array(texts)) = variable.value(key)? {
                let (count, message) = (texts.elems.len(), format!("`{key}` needs one entry per element of the array"));
                lengths
                    .extend(quote_spanned!(list.span()=> const _: () = ::core::assert!(#count == #length, #message);));
            }
        }
    }
    let limits = variable.limit_assertions();
    let span = field.ty.span();
    // Refers to the function's parameter even if the type comes from a `macro_rules` macro.
    let all = Ident::new("all", Span::call_site());
    Ok(quote_spanned! {span=>
        #check
        #lengths
        #limits
        {
            let declare = <#ty as #root::Field<#number>>::declare;
            declare(&#spec, #start, #all);
        }
    })
}

/// The derive `Derived`. Only fields with `#[var]` are variables.
pub(crate) fn derived(input: &DeriveInput) -> Result<TokenStream> {
    let root = root(&input.attrs)?;
    let ident = &input.ident;
    let mut errors = Errors::default();
    let fields = fields(input)?;
    let explicit = fields.iter().filter(|field| field.attrs.iter().any(|attribute| attribute.path().is_ident("var")));
    let parts: Vec<Part> =
        explicit.filter_map(|field| errors.keep(part(field, Block::Derived, &root, None, &quote!(f64)))).collect();
    twice(&fields, &mut errors);
    let members = members(&parts, &root, &quote!(f64));
    errors.finish(quote! {
        #[automatically_derived]
        impl #root::Derived for #ident {
            #members
        }
    })
}

/// The remedy for a type that cannot be part of a discrete state.
fn no_state(ty: &syn::Type) -> Option<&'static str> {
    let syn::Type::Path(path) = ty else { return no_state(element(ty)?) };
    match path.path.segments.last()?.ident.to_string().as_str() {
        "usize" | "isize" => Some(
            "a saved state must be the same on all processors: write `u64` or `i32`, and convert where the value is used",
        ),
        "Vec" | "VecDeque" => Some(
            "a step must not allocate: write an array, or a boxed array if it is large, as in `Box<[f64; 1000]>`; \
                 for other state, implement `Stateful`",
        ),
        "Option" => Some("write the type of the value, and a `bool` that is true if the value is valid"),
        _ => no_state(element(ty)?),
    }
}

/// The derive `DiscreteState`, for the state of a model that is kept from one sample or event to the next.
pub(crate) fn discrete_state(input: &DeriveInput) -> Result<TokenStream> {
    let root = root(&input.attrs)?;
    let ident = &input.ident;
    let fields = fields(input)?;
    let mut errors = Errors::default();
    let names: Vec<_> = fields.iter().filter_map(|field| field.ident.clone()).collect();
    let texts: Vec<_> = names.iter().map(ToString::to_string).collect();
    let is_clocked = |field: &&Field| Variable::of(field).is_ok_and(|variable| variable.key("clock").is_some());
    let clocked: Vec<Part> = fields
        .iter()
        .filter(is_clocked)
        .filter_map(|field| errors.keep(part(field, Block::Clocked, &root, None, &quote!(f64))))
        .collect();
    let members = (!clocked.is_empty()).then(|| members(&clocked, &root, &quote!(f64)));
    let searched: Vec<_> = fields
        .iter()
        .filter_map(|field| {
            let variable = errors.keep(Variable::of(field))?;
            if variable.key("clock").is_none() {
                errors.keep(variable.allow(&["always_finite", "clock"]));
            }
            if let Some(remedy) = no_state(&field.ty) {
                errors.add(Error::new_spanned(&field.ty, remedy));
            }
            let name = field.ident.as_ref()?;
            let text = name.to_string();
            (!errors.keep(variable.flag("always_finite"))?).then(|| {
                quote! {
                    if let Some(value) = #root::StateField::not_finite(&self.#name) {
                        return Some((#text, value));
                    }
                }
            })
        })
        .collect();
    errors.finish(quote! {
        impl #root::DiscreteState for #ident {
            fn save(&self, sink: &mut dyn FnMut(#root::Word<'_>)) {
                let _ = &sink;
                #(#root::StateField::save(&self.#names, sink);)*
            }
            fn load(
                &mut self,
                source: &mut #root::Words<'_>,
            ) -> ::std::result::Result<(), ::std::string::String> {
                let _ = &source;
                #(#root::StateField::load(&mut self.#names, #texts, source)?;)*
                Ok(())
            }
            #[inline]
            fn not_finite(&self) -> ::std::option::Option<(&'static str, f64)> {
                #(#searched)*
                None
            }
            #members
        }
    })
}
