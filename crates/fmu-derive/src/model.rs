//! `#[fmu::model(…)]`: completes the implementation of a model trait and exports the model.

use proc_macro2::{Ident, Span, TokenStream};
use quote::{ToTokens, quote, quote_spanned};
use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned as _;
use syn::visit::{self, Visit};
use syn::{
    Error, Expr, ExprLit, ExprMethodCall, ImplItem, ItemImpl, Lit, LitInt, LitStr, Meta, Path, ReturnType, Token, Type,
    parse_quote,
};

use crate::attribute::{doc, literal, private};
use crate::errors::Errors;
use crate::forgotten::{self, Kind, associated_type, functions};
use crate::reads;
use crate::{clocks, comparison};

const EXAMPLE: &str = "as in `#[fmu::model(stop_time = 10.0, step_size = 0.001)]`";

/// Prefix of the environment variable with which `cargo fmu pack` requests an export. In the name of the variable, the
/// name of the crate follows the prefix.
const EXPORT: &str = "FMU_EXPORT_";
/// Prefix of the environment variable with the path of the dependencies, for FMI 3.0.
const DEPENDENCIES: &str = "FMU_DEPENDENCIES_";
/// The word in the variable of an export with which a discrete-time model without clocks of its own gets one.
const CLOCKS: &str = "clocks=true";

#[derive(Default)]
struct Keys {
    stop_time: Option<Expr>,
    step_size: Option<Expr>,
    name: Option<LitStr>,
    solver: Option<Expr>,
    serialize: Option<Path>,
    root: Option<Path>,
    /// True if all keys are known. Otherwise, missing keys are not reported, because a key may be misspelled.
    is_complete: bool,
}

impl Keys {
    fn parse(arguments: TokenStream, errors: &mut Errors) -> Self {
        let mut keys = Self { is_complete: true, ..Self::default() };
        let arguments = match (Punctuated::<Meta, Token![,]>::parse_terminated).parse2(arguments) {
            Ok(arguments) => arguments,
            Err(error) => {
                errors.add(error);
                keys.is_complete = false;
                return keys;
            }
        };
        let mut seen: Vec<String> = Vec::new();
        for key in arguments {
            let name = key.path().to_token_stream().to_string();
            if seen.contains(&name) {
                errors.add(Error::new_spanned(key.path(), format!("`{name}` is given twice")));
            }
            let value = match &key {
                Meta::NameValue(pair) => Some(pair.value.clone()),
                _ => None,
            };
            match (name.as_str(), value) {
                ("stop_time", Some(value)) => keys.stop_time = Some(value),
                ("step_size", Some(value)) => keys.step_size = Some(value),
                ("solver", Some(value)) => keys.solver = Some(value),
                ("name", Some(Expr::Lit(ExprLit { lit: Lit::Str(text), .. }))) => keys.name = Some(text),
                ("crate", Some(Expr::Path(path))) => keys.root = Some(path.path),
                ("serialize", None) => keys.serialize = Some(key.path().clone()),
                _ => {
                    errors.add(Error::new_spanned(&key, unknown_key(&name)));
                    keys.is_complete = false;
                }
            }
            seen.push(name);
        }
        keys
    }
}

/// The error message for an invalid key, with the correct form.
fn unknown_key(name: &str) -> String {
    const KEYS: [&str; 6] = ["stop_time", "step_size", "name", "solver", "serialize", "crate"];
    if KEYS.contains(&name) {
        return match name {
            "serialize" => "`serialize` is a flag and takes no value".to_owned(),
            "name" => "expected the name as a string, as in `name = \"Cart\"`".to_owned(),
            _ => format!("`{name}` needs a value, {EXAMPLE}"),
        };
    }
    match KEYS.iter().find(|key| strsim::damerau_levenshtein(key, name) <= 2) {
        Some(near) => format!("`{name}` is not a known key here; did you mean `{near}`?"),
        None => format!("`{name}` is not a known key here; expected one of {}", KEYS.join(", ")),
    }
}

/// Returns the completed implementation and the export, which is omitted after a mistake to prevent follow-up errors.
pub(crate) fn model(arguments: TokenStream, item: TokenStream) -> TokenStream {
    let block = match syn::parse2(item) {
        Ok(block) => block,
        Err(error) => return error.into_compile_error(),
    };
    let mut errors = Errors::default();
    let tokens = completed(arguments, block, &mut errors);
    match errors.finish(()) {
        Ok(()) => tokens,
        Err(error) => {
            let error = error.into_compile_error();
            quote!(#error #tokens)
        }
    }
}

fn completed(arguments: TokenStream, mut block: ItemImpl, errors: &mut Errors) -> TokenStream {
    let keys = Keys::parse(arguments, errors);
    let is_attribute = |attribute: &syn::Attribute| is_model(attribute.path());
    if let Some(second) = block.attrs.iter().find(|attribute| is_attribute(attribute)) {
        errors.add(Error::new_spanned(second, "the attribute appears twice; remove one of them"));
        block.attrs.retain(|attribute| !is_attribute(attribute));
    }
    // The derive macro of the parameters reports type parameters.
    if !block.generics.params.is_empty() {
        return TokenStream::new();
    }
    let root = private(keys.root.as_ref());
    let of = block.trait_.as_ref().and_then(|(path, _)| path.segments.last()).map(|last| last.ident.to_string());
    let (kind, runner) = match of.as_deref() {
        Some("Continuous") => (Kind::Continuous, quote!(ContinuousModel)),
        Some("Discrete") => (Kind::Discrete, quote!(DiscreteModel)),
        Some("Stateful") => (Kind::Stateful, quote!(StatefulModel)),
        _ => {
            let message = "expected `impl Continuous for …`, `impl Discrete for …` or `impl Stateful for …`";
            errors.add(Error::new_spanned(&block.self_ty, message));
            return TokenStream::new();
        }
    };
    let clocks = match kind {
        Kind::Stateful => None,
        _ => clocks::lift(&mut block.items, &block.self_ty, kind, &root, errors),
    };
    let is_sampled = kind == Kind::Discrete && clocks.is_none();
    let wants_clocks = wanted().1.split(' ').any(|word| word == CLOCKS);
    let is_clocked = kind == Kind::Discrete && (!is_sampled || wants_clocks);
    let runner = if is_clocked { quote!(ClockedModel) } else { runner };
    forgotten::complete(&mut block.items, kind, &root, errors);
    let declared = block.items.clone();
    if kind == Kind::Continuous {
        comparison::replace(&mut block.items, &root);
    }
    let written: Vec<String> = block.items.iter().filter_map(name).collect();
    let has = |name: &str| written.iter().any(|written| written == name);
    let mut add = |name: &str, item: TokenStream| {
        if !has(name) {
            block.items.push(ImplItem::Verbatim(item));
        }
    };
    for name in kind.types() {
        let ident = Ident::new(name, Span::call_site());
        let generics = kind.is_generic(name).then(|| quote!(<T: #root::Scalar>));
        add(name, quote! { type #ident #generics = (); });
    }
    match kind {
        Kind::Continuous => {
            let solver = match (&keys.solver, has("advance")) {
                (Some(solver), true) => {
                    let message = "the model has both a solver and the function `advance`; remove one of them";
                    errors.add(Error::new_spanned(solver, message));
                    None
                }
                (Some(solver), false) => Some(quote! {{
                    #[allow(unused_imports)]
                    use #root::Solver::*;
                    #solver
                }}),
                (None, true) => Some(quote!(#root::Solver::Exact)),
                (None, false) => None,
            };
            if let Some(solver) = solver {
                add("SOLVER", quote! { const SOLVER: #root::Solver = #solver; });
            }
            let crossings = crossings(&declared, errors);
            add("Crossings", quote! { type Crossings = #crossings; });
            if has("next_time_event") {
                add("HAS_TIME_EVENTS", quote! { const HAS_TIME_EVENTS: bool = true; });
            }
            if has("is_finished") {
                add("CAN_FINISH", quote! { const CAN_FINISH: bool = true; });
            }
            if let Some(fields) = reads::of_equations(&declared) {
                let list = quote!(::core::option::Option::Some(&[#(#fields),*]));
                add(
                    "EQUATIONS_READ",
                    quote! {
                        const EQUATIONS_READ: ::core::option::Option<&'static [&'static str]> = #list;
                    },
                );
            }
            equations(&has, &root, &mut add);
        }
        Kind::Discrete => {}
        Kind::Stateful => {
            if let Some(key) = &keys.serialize {
                // Without the feature `serde`, this macro reports an error.
                let serialize = quote_spanned!(key.span()=> #root::serialize_with_serde!());
                let option = quote!(::core::option::Option<#root::Serialize<Self::Simulation>>);
                add("SERIALIZE", quote! { const SERIALIZE: #option = #serialize; });
            }
        }
    }
    if kind != Kind::Stateful {
        let result = |ok: TokenStream| quote!(::core::result::Result<#ok, ::std::string::String>);
        if has("load") {
            let result = result(quote!(Self::Derived));
            add(
                "derived",
                quote! { fn derived(&self) -> #result { self.load(::std::path::Path::new(Self::INFO.resources)) } },
            );
        }
        if !has("Derived") {
            let result = result(quote!(()));
            add("derived", quote! { fn derived(&self) -> #result { Ok(()) } });
        }
        if let Some(key) = &keys.serialize {
            let message = "`serialize` is only for stateful models; other models always serialize their state";
            errors.add(Error::new_spanned(key, message));
        }
    }
    if let Some(solver) = keys.solver.as_ref().filter(|_| kind != Kind::Continuous) {
        errors.add(Error::new_spanned(solver, "only a continuous-time model has a solver"));
    }
    if has("INFO") {
        errors.add(Error::new_spanned(&block.self_ty, "the attribute generates `INFO`; remove one of them"));
    } else {
        let info = info(&keys, &block, &root, errors);
        block.items.push(info);
    }
    if errors.is_empty() {
        let options = match kind {
            Kind::Continuous => 2,
            Kind::Discrete if !is_clocked => 1,
            _ => 0,
        };
        let export = export(&block.self_ty, &root, &runner, options);
        let model = &block.self_ty;
        let sampled = is_sampled.then(|| {
            quote! {
                impl #root::Clocked for #model {
                    type Schedules = [#root::Schedule; 1];
                    type Timers = #root::NoTimer;
                }
            }
        });
        let numbers = crossing_numbers(&block.items, &block.self_ty, &root);
        let starts = starts_of_outputs(kind, &block.items, &root);
        let names = shared_names(kind, &block, &root);
        quote!(#block #clocks #sampled #export #numbers #starts #names)
    } else {
        quote!(#block #clocks)
    }
}

pub(crate) fn is_model(path: &Path) -> bool {
    path.segments.last().is_some_and(|last| last.ident == "model")
}

fn name(item: &ImplItem) -> Option<String> {
    match item {
        ImplItem::Const(item) => Some(item.ident.to_string()),
        ImplItem::Fn(item) => Some(item.sig.ident.to_string()),
        ImplItem::Type(item) => Some(item.ident.to_string()),
        _ => None,
    }
}

/// Returns the type of the zero crossings from the function's signature. Reports a missing type or function.
fn crossings(items: &[ImplItem], errors: &mut Errors) -> TokenStream {
    let declared = associated_type(items, "Crossings");
    let function = functions(items).find(|function| function.sig.ident == "zero_crossings");
    match (declared, function) {
        (Some(declared), None) => {
            let message = "the function `zero_crossings`, which computes these quantities, is missing; add it, as in \
                           `fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1]`";
            errors.add(Error::new_spanned(declared, message));
        }
        (None, Some(function)) => {
            let message = "`type Crossings` is missing; add it, as in `type Crossings = [f64; 1];` for one quantity";
            errors.add(Error::new_spanned(&function.sig.ident, message));
        }
        _ => {}
    }
    match function.map(|function| &function.sig.output) {
        Some(ReturnType::Type(_, ty)) => ty.to_token_stream(),
        _ => quote!([f64; 0]),
    }
}

/// Checks the indices of zero crossings in `on_event` if they are literals.
fn crossing_numbers(items: &[ImplItem], model: &Type, root: &TokenStream) -> TokenStream {
    let mut numbers = Vec::new();
    if let Some(handler) = functions(items).find(|function| function.sig.ident == "on_event") {
        CrossingNumbers(&mut numbers).visit_block(&handler.block);
    }
    let checks = numbers.iter().filter_map(|number| {
        let value: usize = number.base10_parse().ok()?;
        let message = format!(
            "there is no zero crossing {number}: indices start at 0 and must be below the length \
             of `type Crossings`"
        );
        // Located at the number, but resolved at the call site, so that lints ignore it.
        Some(quote_spanned! {number.span().resolved_at(Span::call_site())=>
            const _: () = ::core::assert!(
                #value < ::core::mem::size_of::<<#model as #root::Continuous>::Crossings>() / 8,
                #message
            );
        })
    });
    quote!(#(#checks)*)
}

/// Rejects start values for outputs that are always computed before they are read.
fn starts_of_outputs(kind: Kind, items: &[ImplItem], root: &TokenStream) -> TokenStream {
    match (kind, associated_type(items, "Outputs")) {
        (Kind::Continuous | Kind::Stateful, Some(outputs)) => {
            let message = match kind {
                Kind::Continuous => {
                    "an output of a continuous-time model has no start value: it follows from states, inputs and \
                     parameters; remove `start`"
                }
                _ => "an output of a stateful model has no start value: it follows from the simulation; remove `start`",
            };
            let (ty, numbers) = (&outputs.ty, outputs.generics.type_params().map(|number| &number.ident));
            quote_spanned! {ty.span().resolved_at(Span::call_site())=>
                const _: () = {
                    // Uses the number type here, because it is otherwise unused if the outputs contain no real
                    // variables.
                    #(type #numbers = f64; const _: #numbers = 0.0;)*
                    ::core::assert!(!<#ty as #root::Variables<f64>>::HAS_STARTS, #message)
                };
            }
        }
        _ => TokenStream::new(),
    }
}

/// Rejects a name that occurs in two structs of variables; reported at the second struct.
fn shared_names(kind: Kind, block: &ItemImpl, root: &TokenStream) -> TokenStream {
    let mut earlier = Vec::new();
    let mut tokens = TokenStream::new();
    let model = &block.self_ty;
    let names = quote!(#root::NamesOf::<#model>::NAMES);
    let mut structs = vec![(model.span(), names)];
    for name in ["Derived", "Inputs", "Outputs", "State"] {
        // The names in the state of a discrete-time model are checked when the description is generated.
        if name == "State" && kind != Kind::Continuous {
            continue;
        }
        if let Some(item) = associated_type(&block.items, name) {
            let (ty, numbers) = (&item.ty, item.generics.type_params().map(|number| &number.ident));
            let of = Ident::new(if name == "Derived" { "NamesOfDerived" } else { "NamesOf" }, Span::call_site());
            let names = quote!({
                // Uses the number type here, because it is otherwise unused if the struct contains no real variables.
                #(type #numbers = f64; const _: #numbers = 0.0;)*
                #root::#of::<#ty>::NAMES
            });
            structs.push((ty.span(), names));
        }
    }
    for (span, names) in structs {
        tokens.extend(quote_spanned! {span.resolved_at(Span::call_site())=>
            #[allow(long_running_const_eval)]
            const _: () = {
                #[allow(unused_imports)]
                use #root::NoNames as _;
                const SHARED: ::core::option::Option<#root::Text> =
                    #root::shared_name(&[#(#earlier),*], #names);
                if let ::core::option::Option::Some(text) = &SHARED {
                    ::core::panic!("{}", text.as_str());
                }
            };
        });
        earlier.push(names);
    }
    tokens
}

/// Literal arguments of `fell` and `rose`.
struct CrossingNumbers<'a>(&'a mut Vec<LitInt>);

impl<'ast> Visit<'ast> for CrossingNumbers<'_> {
    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        if (call.method == "fell" || call.method == "rose")
            && let Some(Expr::Lit(ExprLit { lit: Lit::Int(number), .. })) = call.args.first()
        {
            self.0.push(number.clone());
        }
        visit::visit_expr_method_call(self, call);
    }
}

/// Adds `derivatives` and `outputs`, which call `evaluate` or, without states or outputs, do nothing.
fn equations(has: &dyn Fn(&str) -> bool, root: &TokenStream, add: &mut dyn FnMut(&str, TokenStream)) {
    let at = quote!(#root::At<'_, T, Self>);
    for (function, ty, part) in [("derivatives", "State", 0), ("outputs", "Outputs", 1)] {
        let part = syn::Index::from(part);
        let [name, of] = [function, ty].map(|name| Ident::new(name, Span::call_site()));
        if has("evaluate") {
            let tokens = quote! {
                #[inline]
                fn #name<T: #root::Scalar>(&self, at: #at) -> Self::#of<T> { self.evaluate(at).#part }
            };
            add(function, tokens);
        } else if !has(ty) {
            add(function, quote! { fn #name<T: #root::Scalar>(&self, _: #at) {} });
        }
    }
}

/// The export of the model. The library contains the C interface only if `cargo fmu pack` requests it. The runner has
/// this number of options, see [`Packed::export`].
fn export(model: &Type, root: &TokenStream, runner: &TokenStream, options: usize) -> TokenStream {
    let name = model.to_token_stream().to_string();
    let test = quote::format_ident!(
        "the_declarations_of_{}_do_not_contradict_each_other",
        heck::ToSnakeCase::to_snake_case(name.as_str())
    );
    let (variable, wanted) = wanted();
    let packed = Packed::parse(&wanted).filter(|packed| packed.name == name);
    let (symbols, facts, values) = match &packed {
        Some(packed) => packed.export(model, root),
        None if wanted.starts_with("describe") => (description(&name, model, root), quote!(), [true; 2]),
        None => (quote!(), quote!(), [true; 2]),
    };
    let options = values.iter().take(options);
    quote! {
        impl #root::Export for #model {
            type Model = #root::runner::#runner<Self #(, #options)*>;
            #facts
            fn library() -> &'static #root::abi::Library {
                static LIBRARY: #root::abi::Library = #root::abi::Library::new();
                &LIBRARY
            }
        }
        // Makes cargo recompile the crate when the variable changes.
        const _: ::core::option::Option<&str> = ::core::option_env!(#variable);
        #symbols

        #[cfg(test)]
        #[test]
        fn #test() {
            let description = <#model as #root::Export>::description();
            assert!(description.xml.contains(&description.guid));
        }
    }
}

fn crate_name() -> String {
    std::env::var("CARGO_CRATE_NAME").unwrap_or_default()
}

/// The environment variable that selects the export of the crate, and its value.
fn wanted() -> (String, String) {
    let variable = format!("{EXPORT}{}", crate_name());
    let wanted = std::env::var(&variable).unwrap_or_default();
    (variable, wanted)
}

/// The function from which `cargo fmu pack` reads the description.
fn description(name: &str, model: &Type, root: &TokenStream) -> TokenStream {
    let symbol = format!("fmu_model_description_{name}");
    quote! {
        #[doc(hidden)]
        #[allow(unsafe_code)]
        const _: () = {
            #[unsafe(export_name = #symbol)]
            extern "C" fn describe(
                version: ::core::ffi::c_int,
                options: ::core::ffi::c_int,
            ) -> *const ::core::ffi::c_char {
                #root::abi::model_description::<#model>(version, options)
            }
        };
    }
}

/// Specification of a library for `cargo fmu pack`, as in `QuarterCar={0123…} fmi=2 interfaces=cs,me indicators=4`.
struct Packed<'a> {
    name: &'a str,
    guid: &'a str,
    version: u32,
    interfaces: Vec<&'a str>,
    indicators: usize,
    arrays: bool,
}

impl<'a> Packed<'a> {
    fn parse(text: &'a str) -> Option<Self> {
        let (name, rest) = text.split_once('=')?;
        let mut words = rest.split(' ');
        let mut packed =
            Self { name, guid: words.next()?, version: 2, interfaces: Vec::new(), indicators: 0, arrays: false };
        for word in words {
            match word.split_once('=')? {
                _ if word == CLOCKS => {}
                ("fmi", version) => packed.version = version.parse().ok()?,
                ("interfaces", list) => packed.interfaces = list.split(',').collect(),
                ("arrays", value) => packed.arrays = value.parse().ok()?,
                ("indicators", count) => packed.indicators = count.parse().ok()?,
                _ => return None,
            }
        }
        Some(packed)
    }

    /// Returns the C interface, the constants of `Export`, and the options of the runner: model exchange, and inputs that
    /// are linear in time.
    fn export(&self, model: &Type, root: &TokenStream) -> (TokenStream, TokenStream, [bool; 2]) {
        let Self { guid, indicators, arrays, .. } = self;
        let has = |interface: &str| self.interfaces.contains(&interface);
        let (co_simulation, model_exchange, scheduled_execution) = (has("cs"), has("me"), has("se"));
        let interfaces = self.interfaces.iter().map(|name| Ident::new(name, Span::call_site()));
        let (version, symbols) = match self.version {
            3 => (quote!(Fmi3), quote!(#root::c_interface_of_fmi3!(#model);)),
            _ => (quote!(Fmi2), quote!(#root::c_interface_of_fmi2!(#model: #(#interfaces)*);)),
        };
        let dependencies = (self.version == 3).then(|| {
            let path = format!("{DEPENDENCIES}{}", crate_name());
            quote!(
                const DEPENDENCIES: &'static str = ::core::include_str!(::core::env!(#path));
            )
        });
        let facts = quote! {
            #dependencies
            const GUID: ::core::option::Option<&'static str> = Some(#guid);
            const EVENT_INDICATORS: usize = #indicators;
            const FORMAT: #root::description::Format = #root::description::Format {
                version: #root::calls::Version::#version,
                interfaces: #root::calls::Interfaces {
                    co_simulation: #co_simulation,
                    model_exchange: #model_exchange,
                    scheduled_execution: #scheduled_execution,
                },
                arrays: #arrays,
            };
        };
        (symbols, facts, [model_exchange, co_simulation && self.version == 2])
    }
}

/// Name, description, version and default experiment.
fn info(keys: &Keys, block: &ItemImpl, root: &TokenStream, errors: &mut Errors) -> ImplItem {
    let mut experiment = |value: &Option<Expr>, what: &str| {
        if value.is_none() && keys.is_complete {
            errors.add(Error::new_spanned(&block.self_ty, format!("{what} is missing; add it, {EXAMPLE}")));
        }
        if let Some(number) = value.as_ref().filter(|value| literal(value).is_some_and(|number| number <= 0.0)) {
            errors.add(Error::new_spanned(number, "must be above 0 s"));
        }
        value.as_ref().map_or_else(|| quote!(1.0), ToTokens::to_token_stream)
    };
    let stop_time = experiment(&keys.stop_time, "stop_time, the length of the default experiment in s,");
    let step_size = experiment(&keys.step_size, "step_size, the communication step in s,");
    let is_constant = |value: &&Expr| crate::attribute::is_constant(value);
    let mut check = TokenStream::new();
    if let (Some(stop), Some(step)) = (keys.stop_time.as_ref(), keys.step_size.as_ref().filter(is_constant)) {
        let message = "step_size, the communication step, must not exceed stop_time, the length of the experiment";
        match (literal(stop), literal(step)) {
            (Some(length), Some(number)) if number > length => errors.add(Error::new_spanned(step, message)),
            (Some(_), Some(_)) => {}
            _ if is_constant(&stop) => {
                let step_span = step.span().resolved_at(Span::call_site());
                check = quote_spanned!(step_span=> const _: () = ::core::assert!((#step) as f64 <= (#stop) as f64, #message););
            }
            _ => {}
        }
    }
    let of_type = match &*block.self_ty {
        Type::Path(path) => path.path.segments.last().map(|last| last.ident.to_string()),
        _ => None,
    };
    if of_type.is_none() {
        errors.add(Error::new_spanned(
            &block.self_ty,
            "expected the plain name of a type, which becomes the name of the FMU",
        ));
    }
    let name = match (&keys.name, of_type) {
        (Some(name), _) => {
            if let Some(error) = not_an_identifier(&name.value()) {
                errors.add(Error::new(name.span(), error));
            }
            name.value()
        }
        (None, Some(name)) => {
            if let Some(error) = not_an_identifier(&name) {
                errors.add(Error::new_spanned(&block.self_ty, format!("{error}, as in `name = \"Cart\"`")));
            }
            name
        }
        (None, None) => String::new(),
    };
    let description = doc(&block.attrs);
    if description.is_empty() {
        let message = "the doc comment is missing: it becomes the description of the FMU";
        errors.add(Error::new_spanned(&block.self_ty, message));
    }
    // A packed library does not contain the paths of the machine that built it.
    let model = block.self_ty.to_token_stream().to_string();
    let resources = match Packed::parse(&wanted().1).filter(|packed| packed.name == model) {
        Some(_) => quote!(""),
        None => quote!(::core::concat!(::core::env!("CARGO_MANIFEST_DIR"), "/resources")),
    };
    parse_quote! {
        const INFO: #root::Info = #root::Info {
            resources: #resources,
            name: #name,
            description: #description,
            version: env!("CARGO_PKG_VERSION"),
            authors: env!("CARGO_PKG_AUTHORS"),
            license: env!("CARGO_PKG_LICENSE"),
            homepage: env!("CARGO_PKG_HOMEPAGE"),
            stop_time: #stop_time,
            step_size: { #check #step_size },
        };
    }
}

/// The error message for a name that is not a C identifier, as FMI requires.
fn not_an_identifier(name: &str) -> Option<&'static str> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let is_identifier = name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_word);
    (!is_identifier).then_some(
        "the name of an FMU must consist of ASCII letters, digits and underscores and start \
         with a letter",
    )
}
