//! The attributes of a field.

use proc_macro2::TokenStream;
use quote::{ToTokens, quote, quote_spanned};
use syn::parse::ParseStream;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Attribute, Error, Expr, ExprLit, ExprPath, Field, Ident, Lit, LitStr, Meta, Result, Token, UnOp};

/// How a variable gets its name, unit and description.
pub(crate) enum Source {
    /// An entry of a catalogue.
    Entry(ExprPath),
    /// Written in place.
    Name(LitStr),
}

/// `#[par(source, key = value, flag, …)]`; without a source the variable is named like its field.
pub(crate) struct Variable {
    pub(crate) source: Source,
    pub(crate) keys: Vec<(Ident, Option<Expr>)>,
}

impl Variable {
    fn parse(input: ParseStream<'_>, field: &Field) -> Result<Self> {
        let mut source = None;
        if input.peek(LitStr) {
            let name: LitStr = input.parse()?;
            check_name(&name)?;
            source = Some(Source::Name(name));
        } else if !is_key(input) {
            source = Some(Source::Entry(input.parse().map_err(|e| {
                Error::new(e.span(), "expected the name of the variable as a string, an entry of a catalogue, or keys")
            })?));
        }
        let mut keys: Vec<(Ident, Option<Expr>)> = Vec::new();
        if source.is_some() && !input.is_empty() {
            input.parse::<Token![,]>()?;
        }
        while !input.is_empty() {
            let key: Ident = input.parse()?;
            if keys.iter().any(|(known, _)| *known == key) {
                return Err(Error::new(key.span(), format!("`{key}` is given twice")));
            }
            let value = if input.parse::<Option<Token![=]>>()?.is_some() { Some(input.parse()?) } else { None };
            keys.push((key, value));
            if !input.is_empty() {
                input.parse::<Token![,]>()?;
            }
        }
        Ok(Self { source: source.map_or_else(|| Source::of(field), Ok)?, keys })
    }
}

/// Keys are in lower case, entries of a catalogue in upper case or behind a path.
fn is_key(input: ParseStream<'_>) -> bool {
    let lower = |word: Ident| word.to_string().starts_with(|c: char| c.is_ascii_lowercase());
    !input.peek2(Token![::]) && input.fork().parse::<Ident>().is_ok_and(lower)
}

impl Source {
    /// The name of the field.
    fn of(field: &Field) -> Result<Self> {
        let ident = field.ident.as_ref().expect("the fields are named");
        let name = LitStr::new(&ident.to_string(), ident.span());
        check_name(&name)?;
        Ok(Self::Name(name))
    }
}

/// Dotted words in lower snake case: what the naming convention "structured" and all importers accept.
fn check_name(name: &LitStr) -> Result<()> {
    let text = name.value();
    let word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    };
    if text.split('.').all(word) {
        return Ok(());
    }
    Err(Error::new(name.span(), "a variable's name is made of dotted words in lower snake case, as in `tire.friction`"))
}

impl Variable {
    /// The attribute of a field, of which at most one of `names` may be there, and which one it is.
    pub(crate) fn of(field: &Field, names: &[&str]) -> Result<(Option<String>, Self)> {
        let mut found = None;
        for attribute in &field.attrs {
            let Some(name) = names.iter().find(|name| attribute.path().is_ident(name)) else { continue };
            if found.is_some() {
                return Err(Error::new_spanned(attribute, "a field is one variable; this attribute is one too many"));
            }
            let parse = |input: ParseStream<'_>| Self::parse(input, field);
            found = Some((Some((*name).to_owned()), attribute.parse_args_with(parse)?));
        }
        found.map_or_else(|| Ok((None, Self { source: Source::of(field)?, keys: Vec::new() })), Ok)
    }

    /// The value of a key.
    pub(crate) fn value(&self, key: &str) -> Result<Option<&Expr>> {
        match self.keys.iter().find(|(known, _)| known == key) {
            Some((_, Some(value))) => Ok(Some(value)),
            Some((known, None)) => Err(Error::new(known.span(), format!("`{key}` needs a value, as in `{key} = …`"))),
            None => Ok(None),
        }
    }

    /// Whether a flag is set.
    pub(crate) fn flag(&self, key: &str) -> Result<bool> {
        match self.keys.iter().find(|(known, _)| known == key) {
            Some((known, Some(_))) => Err(Error::new(known.span(), format!("`{key}` is a flag and takes no value"))),
            other => Ok(other.is_some()),
        }
    }

    /// Refuses keys that mean nothing here.
    pub(crate) fn allow(&self, allowed: &[&str]) -> Result<()> {
        match self.keys.iter().find(|(key, _)| !allowed.iter().any(|name| key == name)) {
            Some((key, _)) => Err(Error::new(
                key.span(),
                format!("`{key}` means nothing here; expected one of {}", allowed.join(", ")),
            )),
            None => Ok(()),
        }
    }

    /// The span errors about the whole attribute point at.
    pub(crate) fn span(&self) -> proc_macro2::Span {
        match &self.source {
            Source::Entry(path) => path.span(),
            Source::Name(name) => name.span(),
        }
    }

    /// The unit of a variable that stands in no catalogue, and its description: the unit is a key, or it closes the
    /// doc comment in parentheses, as in `Height of the road (m)`.
    fn unit_and_description<'a>(&self, name: &LitStr, doc: &'a str) -> Result<(TokenStream, &'a str)> {
        if doc.is_empty() {
            return Err(Error::new(name.span(), "the doc comment is missing: it is the description of the variable"));
        }
        if let Some(unit) = self.value("unit")? {
            return Ok((unit.to_token_stream(), doc));
        }
        let in_parentheses = doc.strip_suffix(')').and_then(|doc| doc.rsplit_once(" ("));
        let Some((description, unit)) = in_parentheses else {
            return Err(Error::new(
                name.span(),
                "the unit of measure is missing: write it at the end of the doc comment, as in `/// Roll angle (rad)`, \
                 or as `unit = RAD` (`(1)` or `ONE` for none)",
            ));
        };
        // The compiler's message points at the name of the variable.
        let message = format!("fmi2::unit has no unit `{unit}`, with which the doc comment ends");
        let unit = quote_spanned!(name.span()=> const UNIT: ::fmi2::Unit = ::fmi2::unit::named(#unit, #message););
        Ok((quote!({ #unit UNIT }), description))
    }

    /// An expression of type `fmi2::declare::Spec` for a real variable.
    pub(crate) fn spec(&self, catalogue: &str, doc: &str) -> Result<TokenStream> {
        self.spec_and_unit(catalogue, doc).map(|(spec, _)| spec)
    }

    /// The same with an expression of type `fmi2::Unit`.
    pub(crate) fn spec_and_unit(&self, catalogue: &str, mut doc: &str) -> Result<(TokenStream, TokenStream)> {
        let unit;
        let mut spec = match &self.source {
            Source::Entry(entry) => {
                if let Some(unit) = self.value("unit")? {
                    return Err(Error::new(unit.span(), "an entry of a catalogue has its unit already"));
                }
                let catalogue = Ident::new(catalogue, entry.span());
                unit = quote!(#entry.unit);
                quote!(::fmi2::declare::Spec::#catalogue(&#entry))
            }
            Source::Name(name) => {
                (unit, doc) = self.unit_and_description(name, doc)?;
                quote!(::fmi2::declare::Spec::named(#name, #unit))
            }
        };
        if !doc.is_empty() {
            spec = quote!(#spec.doc(#doc));
        }
        for key in ["min", "max", "nominal"] {
            if let Some(value) = self.value(key)? {
                let key = Ident::new(key, value.span());
                spec = quote!(#spec.#key(#value));
            }
        }
        if let Some(display) = self.value("display")? {
            // The compiler's message points at the name of the display unit.
            let check =
                quote_spanned!(display.span()=> const _: () = ::fmi2::unit::require_display_unit(&#unit, #display););
            spec = quote!(#spec.display({ #check #display }));
        }
        if let Some(start) = self.value("start")? {
            spec = quote!(#spec.start(#start));
        }
        for key in ["positive", "tunable", "local"] {
            if self.flag(key)? {
                let key = Ident::new(key, self.span());
                spec = quote!(#spec.#key());
            }
        }
        Ok((spec, unit))
    }

    /// Refuses a start value outside its limits, as far as both are written as numbers.
    pub(crate) fn check_start(&self, start: &Expr) -> Result<()> {
        if let Expr::Array(places) = start {
            return places.elems.iter().try_for_each(|place| self.check_start(place));
        }
        let Some(number) = literal(start) else { return Ok(()) };
        let min = self.value("min")?.and_then(literal).unwrap_or(f64::NEG_INFINITY);
        let max = self.value("max")?.and_then(literal).unwrap_or(f64::INFINITY);
        if number < min || number > max {
            return Err(Error::new(start.span(), format!("the start value is not within its limits [{min}, {max}]")));
        }
        if self.flag("positive")? && number <= 0.0 {
            return Err(Error::new(start.span(), "the start value must be above 0"));
        }
        Ok(())
    }
}

/// The value of a number as written.
fn literal(expression: &Expr) -> Option<f64> {
    match expression {
        Expr::Lit(ExprLit { lit: Lit::Float(number), .. }) => number.base10_parse().ok(),
        Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => number.base10_parse().ok(),
        Expr::Unary(unary) if matches!(unary.op, UnOp::Neg(_)) => literal(&unary.expr).map(|value| -value),
        _ => None,
    }
}

/// The doc comment in one line.
pub(crate) fn doc(attributes: &[Attribute]) -> String {
    let lines =
        attributes.iter().filter(|attribute| attribute.path().is_ident("doc")).filter_map(|attribute| match &attribute
            .meta
        {
            Meta::NameValue(pair) => match &pair.value {
                Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        });
    lines.filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The fields of a struct with names.
pub(crate) fn fields(input: &syn::DeriveInput) -> Result<&Punctuated<Field, Token![,]>> {
    match &input.data {
        syn::Data::Struct(syn::DataStruct { fields: syn::Fields::Named(fields), .. }) => Ok(&fields.named),
        _ => Err(Error::new(input.ident.span(), "expected a struct with named fields")),
    }
}

/// Whether the type is this single word.
pub(crate) fn is_type(field: &Field, name: &str) -> bool {
    field.ty.to_token_stream().to_string() == name
}
