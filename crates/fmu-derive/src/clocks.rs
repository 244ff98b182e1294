//! Methods with `#[clock(…)]` in `impl Discrete for …` and `impl Continuous for …`: the parts of the model that run when
//! their clocks tick.

use proc_macro2::{Ident, Span, TokenStream};
use quote::{format_ident, quote, quote_spanned};
use syn::parse::ParseStream;
use syn::spanned::Spanned as _;
use syn::{
    Attribute, BinOp, Error, Expr, ExprBinary, ExprLit, ImplItem, ImplItemFn, Lit, LitStr, Meta, Result, Token, Type,
    parse_quote,
};

use crate::attribute::{doc, literal, ungrouped};
use crate::errors::Errors;
use crate::forgotten::Kind;

const KINDS: &str = "expected one of `interval = 0.01` (or `1 / 100`), `interval_of = \"sample_time\"`, `changing`, \
                     `countdown`, `triggered`";

/// The number of clocks is limited because the exporter marks the active ones in the bits of a number.
const MOST: usize = 64;

/// A method with its clock.
struct Partition {
    method: ImplItemFn,
    name: String,
    description: String,
    /// An expression of type `fmu::clocks::Timing`.
    timing: TokenStream,
    /// True if the model can start the clock.
    is_timer: bool,
    /// An expression of type `Option<u32>`.
    priority: TokenStream,
}

/// `#[clock("name", key = value, flag, …)]`.
#[derive(Default)]
struct Keys {
    name: Option<LitStr>,
    values: Vec<(Ident, Option<Expr>)>,
}

impl Keys {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        let mut keys = Self::default();
        if input.peek(LitStr) {
            keys.name = Some(input.parse()?);
            if !input.is_empty() {
                input.parse::<Token![,]>()?;
            }
        }
        while !input.is_empty() {
            let key: Ident = input.parse()?;
            let flags = ["changing", "countdown", "triggered", "fixed", "tunable"];
            let known = flags.iter().chain(&["interval", "interval_of", "shift", "priority"]);
            if !known.clone().any(|known| key == known) {
                let text = key.to_string();
                let near = known.clone().find(|known| strsim::damerau_levenshtein(known, &text) <= 2);
                let hint = near.map_or_else(|| KINDS.to_owned(), |near| format!("did you mean `{near}`?"));
                return Err(Error::new(key.span(), format!("`{key}` is not a known key here; {hint}")));
            }
            if keys.values.iter().any(|(given, _)| *given == key) {
                return Err(Error::new(key.span(), format!("`{key}` is given twice")));
            }
            let has_value = input.parse::<Option<Token![=]>>()?.is_some();
            let value = if has_value { Some(ungrouped(input.parse()?)) } else { None };
            let is_flag = flags.iter().any(|flag| key == flag);
            match &value {
                Some(_) if is_flag => {
                    return Err(Error::new(key.span(), format!("`{key}` is a flag and takes no value")));
                }
                None if !is_flag => {
                    return Err(Error::new(key.span(), format!("`{key}` needs a value, as in `{key} = …`")));
                }
                _ => keys.values.push((key, value)),
            }
            if !input.is_empty() {
                input.parse::<Token![,]>()?;
            }
        }
        Ok(keys)
    }

    fn key(&self, name: &str) -> Option<&Ident> {
        self.values.iter().map(|(key, _)| key).find(|key| *key == name)
    }

    fn value(&self, name: &str) -> Option<&Expr> {
        self.values.iter().find(|(key, _)| key == name).and_then(|(_, value)| value.as_ref())
    }

    /// The priority in scheduled execution, as an expression of type `Option<u32>`.
    fn priority(&self) -> Result<TokenStream> {
        let Some(value) = self.value("priority") else { return Ok(quote!(::core::option::Option::None)) };
        let number = match value {
            Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => number.base10_parse::<u32>().ok(),
            _ => None,
        };
        let rule = "a priority is a whole number from 0 to 4294967295, as in `priority = 1`";
        let number = number.ok_or_else(|| Error::new_spanned(value, rule))?;
        Ok(quote!(::core::option::Option::Some(#number)))
    }

    /// The interval, as an expression of type `fmu::clocks::Interval`.
    fn interval(&self, root: &TokenStream) -> Result<Option<TokenStream>> {
        match (self.value("interval"), self.value("interval_of")) {
            (Some(_), Some(other)) => {
                Err(Error::new_spanned(other, "a clock has `interval` or `interval_of`, not both"))
            }
            (Some(interval), None) => {
                if literal(interval).is_some_and(|seconds| seconds <= 0.0) {
                    return Err(Error::new_spanned(interval, "an interval must be above 0 s"));
                }
                let span = span(interval, root)?;
                Ok(Some(quote!(#root::Interval::Constant(#span))))
            }
            (None, Some(Expr::Lit(ExprLit { lit: Lit::Str(name), .. }))) => {
                Ok(Some(quote!(#root::Interval::Of(#name))))
            }
            (None, Some(other)) => {
                let message = "expected the name of a parameter as a string, as in `interval_of = \"sample_time\"`";
                Err(Error::new_spanned(other, message))
            }
            (None, None) => Ok(None),
        }
    }

    /// When the importer may set interval and shift: a variant of `fmu::clocks::Setting`.
    fn setting(&self, kind: Option<&str>) -> Result<Ident> {
        let (flag, setting) = match (self.key("fixed"), self.key("tunable")) {
            (Some(_), Some(other)) => {
                return Err(Error::new(other.span(), "a clock is `fixed` or `tunable`, not both"));
            }
            (Some(flag), None) => (flag, "Fixed"),
            (None, Some(flag)) => (flag, "Tunable"),
            (None, None) => return Ok(Ident::new("Never", Span::call_site())),
        };
        let message = match kind {
            Some(kind) => format!("the importer sets the interval of a periodic clock only, not of a `{kind}` clock"),
            None if self.key("interval_of").is_some() => {
                format!("the parameter determines whether the interval can change; remove `{flag}`")
            }
            None => return Ok(Ident::new(setting, Span::call_site())),
        };
        Err(Error::new(flag.span(), message))
    }

    /// The expression of type `fmu::clocks::Timing`, and true if the model can start the clock.
    fn timing(&self, at: Span, root: &TokenStream) -> Result<(TokenStream, bool)> {
        let kinds: Vec<_> =
            ["changing", "countdown", "triggered"].into_iter().filter_map(|flag| self.key(flag)).collect();
        let interval = self.interval(root)?;
        let option = |value: &Option<TokenStream>| match value {
            Some(value) => quote!(::core::option::Option::Some(#value)),
            None => quote!(::core::option::Option::None),
        };
        if let [_, second, ..] = kinds[..] {
            return Err(Error::new(second.span(), "a clock is of one kind"));
        }
        let kind = kinds.first().map(ToString::to_string);
        if let (Some(kind), Some(shift)) = (&kind, self.key("shift")) {
            return Err(Error::new(shift.span(), format!("only a periodic clock has a shift, not a `{kind}` clock")));
        }
        let setting = self.setting(kind.as_deref())?;
        match (kind.as_deref(), interval) {
            (None, None) => Err(Error::new(at, format!("when does the clock tick? {KINDS}"))),
            (None, Some(interval)) => {
                let shift = self.value("shift").map(|shift| span(shift, root)).transpose()?;
                let shift = option(&shift);
                Ok((quote!(#root::Timing::periodic(#interval, #shift, #root::Setting::#setting)), false))
            }
            (Some("changing"), Some(interval)) => Ok((quote!(#root::Timing::Changing(#interval)), true)),
            (Some("changing"), None) => {
                Err(Error::new(at, "a `changing` clock needs its first interval, as in `changing, interval = 0.1`"))
            }
            (Some("countdown"), interval) => {
                let interval = option(&interval);
                Ok((quote!(#root::Timing::Countdown(#interval)), true))
            }
            (_, Some(_)) => Err(Error::new(at, "a `triggered` clock has no interval: the importer activates it")),
            (_, None) => Ok((quote!(#root::Timing::Triggered), false)),
        }
    }
}

/// A length of time: a fraction of two whole numbers, or a number; an expression of type `fmu::clocks::Span`.
fn span(value: &Expr, root: &TokenStream) -> Result<TokenStream> {
    let whole = |value: &Expr| match value {
        Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => {
            number.base10_parse::<u64>().ok().filter(|&number| number > 0)
        }
        _ => None,
    };
    match value {
        Expr::Binary(ExprBinary { left, op: BinOp::Div(_), right, .. }) => match (whole(left), whole(right)) {
            (Some(counter), Some(resolution)) => Ok(quote!(#root::Span::Fraction(#counter, #resolution))),
            _ => Err(Error::new_spanned(value, "a fraction consists of two whole numbers above 0, as in `1 / 100`")),
        },
        Expr::Lit(ExprLit { lit: Lit::Int(_), .. }) if whole(value).is_some() => {
            let seconds = whole(value);
            Ok(quote!(#root::Span::Fraction(#seconds, 1)))
        }
        other => Ok(quote_spanned!(other.span()=> #root::Span::Decimal(#other))),
    }
}

fn is_clock(attribute: &Attribute) -> bool {
    attribute.path().is_ident("clock")
}

/// Moves the methods with `#[clock(…)]` out of the implementation. Returns the code that runs them; `None` if there are
/// none.
pub(crate) fn lift(
    items: &mut Vec<ImplItem>,
    model: &Type,
    kind: Kind,
    root: &TokenStream,
    errors: &mut Errors,
) -> Option<TokenStream> {
    let is_partition = |item: &ImplItem| matches!(item, ImplItem::Fn(method) if method.attrs.iter().any(is_clock));
    let methods: Vec<_> = items.extract_if(.., |item| is_partition(item)).collect();
    if methods.is_empty() {
        if kind == Kind::Continuous {
            items
                .push(ImplItem::Verbatim(quote!(type Schedules = [#root::Schedule; 0]; type Timers = #root::NoTimer;)));
        }
        return None;
    }
    let mut partitions = Vec::new();
    for item in methods {
        if let ImplItem::Fn(method) = item {
            partitions.extend(errors.keep(partition(method, root)));
        }
    }
    for item in items.iter() {
        if let ImplItem::Fn(function) = item
            && kind == Kind::Discrete
            && (function.sig.ident == "update" || function.sig.ident == "start")
        {
            let name = &function.sig.ident;
            let message =
                format!("a model with clocks has no `{name}`: its methods with `#[clock(…)]` compute the outputs");
            errors.add(Error::new_spanned(name, message));
        }
    }
    if let Some(last) = partitions.get(MOST) {
        errors.add(Error::new_spanned(&last.method.sig.ident, format!("a model can have at most {MOST} input clocks")));
    }
    let (code, members) = implementation(&partitions, model, root);
    if kind == Kind::Continuous {
        items.push(ImplItem::Verbatim(members));
        return Some(quote! {
            #code
            impl #root::Ticking for #model { type Of<'a> = #root::ContinuousTick<'a, Self>; }
        });
    }
    items.retain(|item| !matches!(item, ImplItem::Fn(function) if function.sig.ident == "update"));
    items.push(parse_quote! {
        fn update(&self, _: #root::Sample<'_, Self>) -> Self::Outputs {
            ::core::unreachable!("the clocks compute the outputs")
        }
    });
    Some(quote! {
        #code
        impl #root::Ticking for #model { type Of<'a> = #root::DiscreteTick<'a, Self>; }
        impl #root::Clocked for #model { #members }
    })
}

fn partition(mut method: ImplItemFn, root: &TokenStream) -> Result<Partition> {
    let mut clocks: Vec<_> = method.attrs.extract_if(.., |attribute| is_clock(attribute)).collect();
    let attribute = clocks.remove(0);
    if let Some(second) = clocks.first() {
        return Err(Error::new_spanned(second, "a method belongs to one clock; remove the second attribute"));
    }
    let keys = match &attribute.meta {
        Meta::List(list) => list.parse_args_with(Keys::parse)?,
        other => return Err(Error::new_spanned(other, format!("when does the clock tick? {KINDS}"))),
    };
    if method.sig.inputs.len() != 2 {
        let message =
            "a method with `#[clock(…)]` takes `&self` and the tick, as in `fn control(&self, tick: Tick<Self>)`";
        return Err(Error::new_spanned(&method.sig, message));
    }
    let description = doc(&method.attrs);
    if description.is_empty() {
        let message = "the doc comment is missing: it becomes the description of the clock";
        return Err(Error::new_spanned(&method.sig.ident, message));
    }
    let name = keys.name.as_ref().map_or_else(|| method.sig.ident.to_string(), LitStr::value);
    let (timing, is_timer) = keys.timing(method.sig.ident.span(), root)?;
    let priority = keys.priority()?;
    Ok(Partition { method, name, description, timing, is_timer, priority })
}

/// The methods with the enum of the clocks that they can start, and the members of a trait with clocks.
fn implementation(partitions: &[Partition], model: &Type, root: &TokenStream) -> (TokenStream, TokenStream) {
    let methods = partitions.iter().map(|partition| &partition.method);
    let clocks = partitions.iter().map(|Partition { name, description, timing, priority, .. }| {
        quote!(#root::InputClock { name: #name, description: #description, timing: #timing, priority: #priority })
    });
    let calls = partitions.iter().enumerate().map(|(number, partition)| {
        let method = &partition.method.sig.ident;
        quote!(#number => self.#method(tick),)
    });
    let count = partitions.len();
    let timers: Vec<_> = partitions.iter().enumerate().filter(|(_, partition)| partition.is_timer).collect();
    let (timer, declaration) = if timers.is_empty() {
        (quote!(#root::NoTimer), quote!())
    } else {
        let of = match model {
            Type::Path(path) => path.path.segments.last().map(|last| last.ident.to_string()).unwrap_or_default(),
            _ => String::new(),
        };
        let timer = format_ident!("{of}Clock");
        let doc = format!("The clocks that a tick of `{of}` can start.");
        let variants: Vec<_> = timers
            .iter()
            .map(|(_, partition)| {
                let name = heck::ToUpperCamelCase::to_upper_camel_case(&*partition.method.sig.ident.to_string());
                Ident::new(&name, partition.method.sig.ident.span())
            })
            .collect();
        let docs = timers.iter().map(|(_, partition)| &partition.description);
        let numbers = timers.iter().map(|(number, _)| number);
        let declaration = quote! {
            #[doc = #doc]
            #[allow(unreachable_pub, reason = "the model may be private")]
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub enum #timer { #(#[doc = #docs] #variants),* }
            impl ::core::convert::From<#timer> for usize {
                fn from(clock: #timer) -> Self {
                    match clock { #(#timer::#variants => #numbers),* }
                }
            }
        };
        (quote!(#timer), declaration)
    };
    let members = quote! {
        const CLOCKS: &'static [#root::InputClock] = &[#(#clocks),*];
        type Schedules = [#root::Schedule; #count];
        type Timers = #timer;
        #[inline]
        fn tick(&self, clock: usize, tick: #root::Tick<'_, Self>) {
            match clock {
                #(#calls)*
                _ => {}
            }
        }
    };
    (quote!(impl #model { #(#methods)* } #declaration), members)
}
