//! The attribute `#[var(…)]`, doc comments, and the path of the crate `fmu`.

use proc_macro2::{Span, TokenStream};
use quote::{ToTokens, quote, quote_spanned};
use syn::parse::ParseStream;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{
    Attribute, DeriveInput, Error, Expr, ExprLit, ExprPath, Field, GenericArgument, Ident, Lit, LitStr, Meta, Path,
    PathArguments, Result, Token, Type, UnOp,
};

use crate::errors::Errors;
use crate::unit::Unit;

/// Source of the name, unit and description of a variable.
pub(crate) enum Source {
    /// A `Definition`, shared by several models.
    Definition(ExprPath),
    /// A name that is written in the attribute.
    Name(LitStr),
}

/// `#[var(source, key = value, flag, …)]`. Without a source, the variable has the name of its field.
pub(crate) struct Variable {
    pub(crate) source: Source,
    keys: Vec<(Ident, Option<Expr>)>,
    pub(crate) aliases: Vec<Alias>,
    /// True if the attribute is present.
    pub(crate) is_explicit: bool,
}

/// Another name of the variable: `alias("name", display = "ft", description = "…")`.
pub(crate) struct Alias {
    pub(crate) name: LitStr,
    display: Option<LitStr>,
    description: Option<LitStr>,
}

impl Alias {
    fn parse(input: ParseStream<'_>, key: &Ident) -> Result<Self> {
        if !input.peek(syn::token::Paren) {
            let message = "write the name in parentheses, as in `alias(\"height_ft\", display = \"ft\")`";
            return Err(Error::new(key.span(), message));
        }
        let content;
        syn::parenthesized!(content in input);
        let name: LitStr =
            content.parse().map_err(|e| Error::new(e.span(), "expected the name of the alias as a string"))?;
        check_name(&name)?;
        let mut alias = Self { name, display: None, description: None };
        while !content.is_empty() {
            content.parse::<Token![,]>()?;
            if content.is_empty() {
                break;
            }
            let key: Ident = content.parse()?;
            let value = match key.to_string().as_str() {
                "display" => &mut alias.display,
                "description" => &mut alias.description,
                _ => {
                    let message = format!("`{key}` is not a key of an alias; expected one of display, description");
                    return Err(Error::new(key.span(), message));
                }
            };
            content.parse::<Token![=]>()?;
            if value.replace(content.parse()?).is_some() {
                return Err(Error::new(key.span(), format!("`{key}` is given twice")));
            }
        }
        Ok(alias)
    }

    /// An expression of type `Alias`. `unit` is the unit of the variable, if it is a literal.
    fn tokens(&self, root: &TokenStream, content: Content, unit: Option<&Unit>) -> Result<TokenStream> {
        let Self { name, display, description } = self;
        let display = match (display, unit) {
            (None, _) => quote!(::core::option::Option::None),
            (Some(display), _) if matches!(content, Content::Integer | Content::Binary | Content::Other) => {
                return Err(Error::new(display.span(), "only real variables have a display unit"));
            }
            (Some(display), Some(unit)) => {
                let display = unit.display(&display.value(), display.span())?;
                let display = unit.display_tokens(root, &display);
                quote!(::core::option::Option::Some(#display))
            }
            (Some(display), None) => {
                quote!(::core::option::Option::Some(#root::named_display_unit(#display)))
            }
        };
        let description = description.as_ref().map_or_else(String::new, LitStr::value);
        Ok(quote!(#root::Alias { name: #name.into(), description: #description.into(), display: #display }))
    }
}

/// Kind of values in a type, derived from its tokens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    Real,
    Integer,
    Binary,
    /// Boolean, String.
    Other,
    /// An enumeration, an alias, or a mistake; only the compiler can resolve it.
    Unknown,
}

impl Variable {
    fn parse(input: ParseStream<'_>, field: &Field) -> Result<Self> {
        let mut source = None;
        if input.peek(LitStr) {
            let name: LitStr = input.parse()?;
            check_name(&name)?;
            source = Some(Source::Name(name));
        } else if !is_key(input) {
            source = Some(Source::Definition(input.parse().map_err(|e| {
                Error::new(e.span(), "expected the name of the variable as a string, a definition, or keys")
            })?));
        }
        let mut keys: Vec<(Ident, Option<Expr>)> = Vec::new();
        let mut aliases = Vec::new();
        if source.is_some() && !input.is_empty() {
            input.parse::<Token![,]>()?;
        }
        while !input.is_empty() {
            let key: Ident = input.parse()?;
            if key == "alias" {
                aliases.push(Alias::parse(input, &key)?);
                keys.push((key, None));
            } else if keys.iter().any(|(known, _)| *known == key) {
                return Err(Error::new(key.span(), format!("`{key}` is given twice")));
            } else {
                let has_value = input.parse::<Option<Token![=]>>()?.is_some();
                let value = if has_value { Some(ungrouped(input.parse()?)) } else { None };
                keys.push((key, value));
            }
            if !input.is_empty() {
                input.parse::<Token![,]>()?;
            }
        }
        let source = match source {
            Some(source) => source,
            None => Source::of(field)?,
        };
        Ok(Self { source, keys, aliases, is_explicit: true })
    }

    pub(crate) fn of(field: &Field) -> Result<Self> {
        let mut found = None;
        for attribute in field.attrs.iter().filter(|attribute| attribute.path().is_ident("var")) {
            if found.is_some() {
                return Err(Error::new_spanned(
                    attribute,
                    "a field declares one variable; remove the second attribute",
                ));
            }
            let parse = |input: ParseStream<'_>| Self::parse(input, field);
            found = Some(match &attribute.meta {
                Meta::Path(_) => Self { is_explicit: true, ..Self::named_as(field)? },
                _ => attribute.parse_args_with(parse)?,
            });
        }
        found.map_or_else(|| Self::named_as(field), Ok)
    }

    /// A variable with the name of the field, without keys.
    fn named_as(field: &Field) -> Result<Self> {
        Ok(Self { source: Source::of(field)?, keys: Vec::new(), aliases: Vec::new(), is_explicit: false })
    }

    /// The value of a key; `None` if the key is absent.
    pub(crate) fn value(&self, key: &str) -> Result<Option<&Expr>> {
        match self.keys.iter().find(|(known, _)| known == key) {
            Some((_, Some(value))) => Ok(Some(value)),
            Some((known, None)) => Err(Error::new(known.span(), format!("`{key}` needs a value, as in `{key} = …`"))),
            None => Ok(None),
        }
    }

    pub(crate) fn flag(&self, key: &str) -> Result<bool> {
        match self.keys.iter().find(|(known, _)| known == key) {
            Some((known, Some(_))) => Err(Error::new(known.span(), format!("`{key}` is a flag and takes no value"))),
            other => Ok(other.is_some()),
        }
    }

    /// Returns the identifier of a key, if the key is present.
    pub(crate) fn key(&self, key: &str) -> Option<&Ident> {
        self.keys.iter().map(|(known, _)| known).find(|known| *known == key)
    }

    /// The prefix of a nested struct, empty for `flatten`; `None` if the field is a variable.
    pub(crate) fn nested(&self, field: &Field) -> Result<Option<String>> {
        let only = |key: &Ident, others: &[(Ident, Option<Expr>)]| match others
            .iter()
            .find(|(other, _)| other != key && other != "terminal" && other != "rule")
        {
            Some((other, _)) => {
                Err(Error::new(other.span(), "a nested struct takes no other keys; set them on its fields"))
            }
            None => Ok(()),
        };
        if let Some(key) = self.key("flatten") {
            self.flag("flatten")?;
            only(key, &self.keys)?;
            return Ok(Some(String::new()));
        }
        let Some((key, value)) = self.keys.iter().find(|(key, _)| key == "nested") else { return Ok(None) };
        only(key, &self.keys)?;
        match value {
            None => Ok(Some(field.ident.as_ref().map_or_else(String::new, ToString::to_string))),
            Some(Expr::Lit(ExprLit { lit: Lit::Str(prefix), .. })) => {
                check_name(prefix)?;
                Ok(Some(prefix.value()))
            }
            Some(other) => Err(Error::new_spanned(other, "expected a prefix as a string, as in `nested = \"front\"`")),
        }
    }

    /// The terminal that a nested struct is, an expression of type `fmu::Terminal`; `None` without the key `terminal`.
    pub(crate) fn terminal(&self, root: &TokenStream, doc: &str) -> Result<Option<TokenStream>> {
        let text = |key, example| match self.value(key)? {
            Some(Expr::Lit(ExprLit { lit: Lit::Str(text), .. })) if check_name(text).is_ok() => Ok(Some(text)),
            Some(other) => {
                let message = format!("`{key}` must be a string of one line, as in `{key} = \"{example}\"`");
                Err(Error::new_spanned(other, message))
            }
            None => Ok(None),
        };
        let (name, rule) = (text("terminal", "shaft")?, text("rule", "plug")?);
        match (name, rule) {
            (None, Some(rule)) => Err(Error::new(rule.span(), "only a terminal has a `rule`; add `terminal = \"…\"`")),
            (_, Some(rule))
                if !["plug", "bus", "sequence", "none"].contains(&&*rule.value()) && !rule.value().contains('.') =>
            {
                let message =
                    "`rule` must be plug, bus, sequence, none, or a reversed domain name such as `org.example.rule`";
                Err(Error::new(rule.span(), message))
            }
            (None, None) => Ok(None),
            (Some(name), rule) => {
                let rule = rule.map_or_else(|| "plug".to_owned(), LitStr::value);
                Ok(Some(quote!(#root::Terminal { name: #name, rule: #rule, description: #doc, member: 0 })))
            }
        }
    }

    /// Rejects keys that are not in `allowed`.
    pub(crate) fn allow(&self, allowed: &[&str]) -> Result<()> {
        let mut errors = Errors::default();
        for (key, _) in self.keys.iter().filter(|(key, _)| !allowed.iter().any(|name| key == name)) {
            let text = key.to_string();
            let near = allowed.iter().find(|name| strsim::damerau_levenshtein(name, &text) <= 2);
            let hint = near.map_or_else(
                || format!("expected one of {}", allowed.join(", ")),
                |near| format!("did you mean `{near}`?"),
            );
            let message = match text.as_str() {
                "unit" => "only real variables have a unit".to_owned(),
                "positive" if allowed.contains(&"tunable") => {
                    format!("`{key}` requires a number: this variable has no limits")
                }
                "min" | "max" if allowed.contains(&"start") && !allowed.contains(&"local") => {
                    format!("`{key}` requires a number: this variable has no limits")
                }
                "min" | "max" => format!("`{key}` is only allowed on parameters, inputs and outputs"),
                "positive" | "tunable" => format!("`{key}` is only allowed on parameters"),
                "fmi" if allowed.contains(&"local") => {
                    "a continuous state exists in all versions of FMI; remove `fmi`".to_owned()
                }
                "local" | "calculated" => format!("`{key}` is only allowed on continuous states"),
                "quantity" => "`quantity` is only allowed on numbers".to_owned(),
                "relative_quantity" | "unbounded" => format!("`{key}` is only allowed on real variables"),
                "constant" => "`constant` is only allowed on outputs and derived parameters".to_owned(),
                "intermediate" => "`intermediate` is only allowed on real inputs".to_owned(),
                "mime" => "`mime` is only allowed on variables of type `Bytes`".to_owned(),
                "clock" => "`clock` is only allowed on inputs, outputs and fields of a discrete state".to_owned(),
                "terminal" | "rule" => format!("`{key}` is only allowed on nested structs of inputs and outputs"),
                "always_finite" => format!("`{key}` is only allowed on discrete states"),
                _ => format!("`{key}` is not a known key here; {hint}"),
            };
            errors.add(Error::new(key.span(), message));
        }
        errors.finish(())
    }

    /// Span for errors about the attribute.
    pub(crate) fn span(&self) -> Span {
        match &self.source {
            Source::Definition(path) => path.span(),
            Source::Name(name) => name.span(),
        }
    }

    /// The unit and the description of a variable without a definition. The unit is the value of a key, or it is in
    /// parentheses at the end of the doc comment, as in `Height of the road (m)`.
    fn unit_and_description<'a>(
        &self,
        root: &TokenStream,
        doc: &'a str,
        content: Content,
        name: &LitStr,
    ) -> Result<(Option<TokenStream>, Option<Unit>, &'a str)> {
        if let Some(unit) = self.value("unit")? {
            return match unit {
                Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => {
                    let unit = Unit::parse(&text.value(), text.span())?;
                    Ok((Some(unit.tokens(root)), Some(unit), doc))
                }
                Expr::Array(units) => {
                    let units: Vec<TokenStream> = units
                        .elems
                        .iter()
                        .map(|unit| match unit {
                            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => {
                                Unit::parse(&text.value(), text.span()).map(|unit| unit.tokens(root))
                            }
                            other => Ok(other.to_token_stream()),
                        })
                        .collect::<Result<_>>()?;
                    Ok((Some(quote!([#(#units),*])), None, doc))
                }
                other => Ok((Some(other.to_token_stream()), None, doc)),
            };
        }
        let in_parentheses = doc.strip_suffix(')').and_then(|doc| {
            // The denominator can also contain parentheses.
            let open = doc.rfind(" (")?;
            Some((&doc[..open], &doc[open + 2..]))
        });
        match in_parentheses {
            Some((description, unit)) if content == Content::Real => {
                let unit = Unit::parse(unit, name.span()).map_err(|error| {
                    Error::new(name.span(), format!("{error} (at the end of the doc comment of this field)"))
                })?;
                Ok((Some(unit.tokens(root)), Some(unit), description))
            }
            // The description of an Integer is not checked, because it can end in a letter that is also a unit: `1 (A)
            // to 8 (H)`.
            Some((_, unit))
                if matches!(content, Content::Other | Content::Binary) && Unit::parse(unit, name.span()).is_ok() =>
            {
                let message = format!(
                    "only real variables have a unit: the doc comment of this field ends with the unit `({unit})`"
                );
                Err(Error::new(name.span(), message))
            }
            None if content == Content::Real && !doc.is_empty() => Err(Error::new(
                name.span(),
                "the unit of measure is missing: end the doc comment with it, as in `/// Roll angle (rad)`, or write \
                 `unit = \"rad\"` (`(1)` for none)",
            )),
            _ => Ok((None, None, doc)),
        }
    }

    /// An expression of type `fmu::declare::Spec`.
    pub(crate) fn spec(&self, root: &TokenStream, doc: &str, content: Content, ty: &Type) -> Result<TokenStream> {
        let mut errors = Errors::default();
        let (mut unit, mut doc) = (None, doc);
        let mut set = Vec::new();
        let spec = match &self.source {
            Source::Definition(entry) => {
                if let Some(key) = self.key("unit") {
                    errors.add(Error::new(key.span(), "the definition already has a unit; remove `unit`"));
                }
                quote!(defined(&#entry))
            }
            Source::Name(name) => {
                if doc.is_empty() {
                    let message = "the doc comment is missing: it becomes the description of the variable";
                    errors.add(Error::new(name.span(), message));
                }
                let parts = errors.keep(self.unit_and_description(root, doc, content, name));
                let (tokens, parsed, description) = parts.unwrap_or((None, None, doc));
                (unit, doc) = (parsed, description);
                set.extend(tokens.map(|units| quote!(units = #root::Units::from(#units))));
                quote!(named(#name))
            }
        };
        if !doc.is_empty() {
            set.push(quote!(doc = #doc));
        }
        errors.keep(self.check_limits());
        for key in ["min", "max", "nominal"] {
            if let Some(Some(value)) = errors.keep(self.value(key)) {
                let span = value.span();
                let limit = if content == Content::Integer {
                    let key = Ident::new(&format!("whole_{key}"), span);
                    let ty = innermost(ty);
                    quote_spanned!(span=> #key = ::core::option::Option::Some(#root::whole_limit::<#ty>(#value)))
                } else {
                    let key = Ident::new(key, span);
                    quote_spanned!(span=> #key = ::core::option::Option::Some(#root::limit(#value)))
                };
                set.push(limit);
            }
        }
        if let Some(Some(display)) = errors.keep(self.value("display")) {
            match (display, &unit) {
                (Expr::Lit(ExprLit { lit: Lit::Str(name), .. }), Some(unit)) => {
                    if let Some(display) = errors.keep(unit.display(&name.value(), name.span())) {
                        let display = unit.display_tokens(root, &display);
                        set.push(quote!(display = ::core::option::Option::Some(#display)));
                    }
                }
                // The unit is a constant, so the display unit must be one of the display units that the constant lists.
                (display, _) => set.push(quote!(display_name = ::core::option::Option::Some(#display))),
            }
        }
        for (key, field) in [("description", "descriptions"), ("elements", "elements")] {
            if let Some(Some(value)) = errors.keep(self.value(key)) {
                let field = Ident::new(field, value.span());
                set.push(quote!(#field = &#value));
            }
        }
        if let Some(Some(clock)) = errors.keep(self.value("clock")) {
            let names = match clock {
                Expr::Array(names) => quote!(&#names),
                name => quote!(&[#name]),
            };
            set.push(quote_spanned!(clock.span()=> details.clocks = #names));
        }
        let sizes = errors.keep(self.sizes(ty)).unwrap_or_default();
        if !sizes.is_empty() {
            set.push(quote!(details.sizes = &[#(#sizes),*]));
        }
        if let Some(Some(mime)) = errors.keep(self.value("mime")) {
            set.push(quote_spanned!(mime.span()=> mime = #mime));
        }
        if let Some(only) = errors.keep(self.only_in(root)).flatten() {
            set.push(quote!(details.only = ::core::option::Option::Some(#only)));
        }
        if let Some(Some(quantity)) = errors.keep(self.value("quantity")) {
            set.push(quote_spanned!(quantity.span()=> details.quantity = #quantity));
        }
        for key in ["relative_quantity", "unbounded", "intermediate", "structural"] {
            if errors.keep(self.flag(key)) == Some(true) {
                let key = Ident::new(key, self.span());
                set.push(quote!(details.#key = true));
            }
        }
        if self.key("constant").is_some() {
            set.push(quote!(details.constant = true));
        }
        for alias in &self.aliases {
            if let Some(alias) = errors.keep(alias.tokens(root, content, unit.as_ref())) {
                set.push(quote!(aliases.push(#alias)));
            }
        }
        for key in ["tunable", "local", "calculated", "enumeration"] {
            if errors.keep(self.flag(key)) == Some(true) {
                let key = Ident::new(key, self.span());
                set.push(quote!(#key = true));
            }
        }
        if errors.keep(self.flag("positive")) == Some(true) {
            set.push(quote!(make_positive()));
        }
        errors.finish(quote!({
            #[allow(unused_mut)]
            let mut spec = #root::Spec::#spec;
            #(spec.#set;)*
            spec
        }))
    }

    /// The names of the structural parameters that are the lengths of an `Array`: one, or two for a matrix.
    pub(crate) fn sizes(&self, ty: &Type) -> Result<Vec<LitStr>> {
        let expected = dimensions(ty);
        let Some(size) = self.value("size")? else {
            return match expected {
                0 => Ok(Vec::new()),
                _ => Err(Error::new_spanned(
                    ty,
                    "the length is missing: name the structural parameter that is the length, as in \
                     `#[var(size = \"n\")]`; for a matrix, `size = [\"m\", \"n\"]`",
                )),
            };
        };
        let is_name = |name: &Expr| match name {
            Expr::Lit(ExprLit { lit: Lit::Str(name), .. }) => Some(name.clone()),
            _ => None,
        };
        let names: Option<Vec<LitStr>> = match size {
            Expr::Array(names) => names.elems.iter().map(is_name).collect(),
            name => is_name(name).map(|name| vec![name]),
        };
        names.filter(|names| names.len() == expected && (1..=2).contains(&expected)).ok_or_else(|| {
            let message = "`size` is the name of a structural parameter for an `Array<T, MAX>`, and two names for a \
                           `Matrix<T, MAX, MAX>`; other types have a fixed size";
            Error::new(size.span(), message)
        })
    }

    /// The only version of FMI that has the variable, an expression of type `fmu::calls::Version`.
    fn only_in(&self, root: &TokenStream) -> Result<Option<TokenStream>> {
        let Some(version) = self.value("fmi")? else { return Ok(None) };
        match literal(version) {
            Some(2.0) => Ok(Some(quote!(#root::calls::Version::Fmi2))),
            Some(3.0) => Ok(Some(quote!(#root::calls::Version::Fmi3))),
            _ => Err(Error::new(
                version.span(),
                "expected the only version that has the variable: `fmi = 2` or `fmi = 3`",
            )),
        }
    }

    /// Returns true if the attribute or the doc comment declares a unit other than the second.
    pub(crate) fn is_not_in_seconds(&self, doc: &str) -> bool {
        let text = match self.value("unit") {
            Ok(Some(Expr::Lit(ExprLit { lit: Lit::Str(text), .. }))) => text.value(),
            Ok(None) => match doc.strip_suffix(')').and_then(|doc| doc.rsplit_once(" (")) {
                Some((_, unit)) => unit.to_owned(),
                None => return false,
            },
            _ => return false,
        };
        matches!(self.source, Source::Name(_))
            && Unit::parse(&text, Span::call_site()).is_ok_and(|unit| !unit.is_second())
    }

    /// Rejects invalid literals: a nominal value that is not above 0, and limits in the wrong order.
    fn check_limits(&self) -> Result<()> {
        if let Some(nominal) = self.value("nominal")?
            && literal(nominal).is_some_and(|number| number <= 0.0)
        {
            let message = "the nominal value, the usual magnitude, must be above 0; omit it if it is unknown";
            return Err(Error::new(nominal.span(), message));
        }
        if let (Some(min), Some(max)) = (self.value("min")?, self.value("max")?)
            && let (Some(least), Some(greatest)) = (literal(min), literal(max))
            && least > greatest
        {
            return Err(Error::new(max.span(), format!("`max` must not be below `min`, which is {least}")));
        }
        Ok(())
    }

    /// Assertions that check constants as [`Self::check_limits`] checks literals. Only the compiler can evaluate
    /// constants.
    pub(crate) fn limit_assertions(&self) -> TokenStream {
        let constant = |key| self.value(key).ok().flatten().filter(|value| is_constant(value));
        let is_open = |value: &Expr| literal(value).is_none();
        let mut assertions = TokenStream::new();
        if let Some(nominal) = constant("nominal").filter(|nominal| is_open(nominal)) {
            assertions.extend(quote_spanned! {nominal.span().resolved_at(Span::call_site())=>
                const _: () = ::core::assert!((#nominal) as f64 > 0.0, "the nominal value must be above 0");
            });
        }
        if let (Some(min), Some(max)) = (constant("min"), constant("max"))
            && (is_open(min) || is_open(max))
        {
            assertions.extend(quote_spanned! {max.span().resolved_at(Span::call_site())=>
                const _: () = ::core::assert!((#min) as f64 <= (#max) as f64, "`max` must not be below `min`");
            });
        }
        assertions
    }

    /// Rejects a start value outside its limits if both are literals.
    pub(crate) fn check_start(&self, start: &Expr) -> Result<()> {
        if let Expr::Array(elements) = start {
            return elements.elems.iter().try_for_each(|element| self.check_start(element));
        }
        let Some(number) = literal(start) else { return Ok(()) };
        let min = self.value("min")?.and_then(literal).unwrap_or(f64::NEG_INFINITY);
        let max = self.value("max")?.and_then(literal).unwrap_or(f64::INFINITY);
        // Limits in the wrong order are reported separately.
        if min <= max && (number < min || number > max) {
            return Err(Error::new(start.span(), format!("the start value must be in [{min}, {max}]")));
        }
        if self.flag("positive")? && number <= 0.0 {
            return Err(Error::new(start.span(), "the start value must be above 0"));
        }
        Ok(())
    }
}

/// The expression without the invisible delimiters of a `macro_rules` fragment.
pub(crate) fn ungrouped(expression: Expr) -> Expr {
    match expression {
        Expr::Group(group) => ungrouped(*group.expr),
        other => other,
    }
}

/// Keys are in lower case; definitions are in upper case or have a path.
fn is_key(input: ParseStream<'_>) -> bool {
    let lower = |word: Ident| word.to_string().starts_with(|c: char| c.is_ascii_lowercase());
    !input.peek2(Token![::]) && input.fork().parse::<Ident>().is_ok_and(lower)
}

impl Source {
    fn of(field: &Field) -> Result<Self> {
        let ident = field.ident.as_ref().expect("the fields are named");
        let name = LitStr::new(ident.to_string().trim_start_matches("r#"), ident.span());
        check_name(&name)?;
        Ok(Self::Name(name))
    }
}

/// Rejects names that FMI does not allow: empty names, and names with control characters such as line breaks.
fn check_name(name: &LitStr) -> Result<()> {
    let text = name.value();
    if text.is_empty() {
        return Err(Error::new(
            name.span(),
            "the name of a variable must not be empty; omit it to use the name of the field",
        ));
    }
    if text.contains(char::is_control) {
        let message = "the name of a variable must not contain line breaks, tabs or other control characters";
        return Err(Error::new(name.span(), message));
    }
    Ok(())
}

/// The value of a literal number.
pub(crate) fn literal(expression: &Expr) -> Option<f64> {
    match expression {
        Expr::Lit(ExprLit { lit: Lit::Float(number), .. }) => number.base10_parse().ok(),
        Expr::Lit(ExprLit { lit: Lit::Int(number), .. }) => number.base10_parse().ok(),
        Expr::Unary(unary) if matches!(unary.op, UnOp::Neg(_)) => literal(&unary.expr).map(|value| -value),
        _ => None,
    }
}

/// Returns true if the compiler can evaluate an expression: literals, constants, and expressions of these.
pub(crate) fn is_constant(expression: &Expr) -> bool {
    match expression {
        Expr::Lit(_) | Expr::Path(_) => true,
        Expr::Unary(unary) => is_constant(&unary.expr),
        Expr::Paren(inner) => is_constant(&inner.expr),
        Expr::Binary(binary) => is_constant(&binary.left) && is_constant(&binary.right),
        _ => false,
    }
}

/// The doc comment as one line.
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

/// The named fields of a struct; none for a unit struct.
pub(crate) fn fields(input: &DeriveInput) -> Result<Punctuated<Field, Token![,]>> {
    match &input.data {
        syn::Data::Struct(syn::DataStruct { fields: syn::Fields::Named(fields), .. }) => Ok(fields.named.clone()),
        syn::Data::Struct(syn::DataStruct { fields: syn::Fields::Unit, .. }) => Ok(Punctuated::new()),
        _ => Err(Error::new(input.ident.span(), "expected a struct with named fields")),
    }
}

/// The name of a type, or of the element type of an array.
pub(crate) fn name_of(ty: &Type) -> Option<String> {
    match (element(ty), ty) {
        (Some(element), _) => name_of(element),
        (None, Type::Paren(inner)) => name_of(&inner.elem),
        (None, Type::Path(path)) => Some(path.path.segments.last()?.ident.to_string()),
        _ => None,
    }
}

/// The type of a variable, or of the elements of an array, even if it is nested.
fn innermost(ty: &Type) -> &Type {
    element(ty).map_or(ty, innermost)
}

/// The number of dimensions whose length is a structural parameter.
fn dimensions(ty: &Type) -> usize {
    let path = match ty {
        Type::Path(path) => path,
        Type::Group(inner) => return dimensions(&inner.elem),
        _ => return 0,
    };
    match path.path.segments.last().map(|segment| segment.ident.to_string()).as_deref() {
        Some("Matrix") => 2,
        Some("Array") => 1 + element(ty).map_or(0, dimensions),
        _ => 0,
    }
}

/// The element type of an array.
pub(crate) fn element(ty: &Type) -> Option<&Type> {
    match ty {
        Type::Array(array) => Some(&array.elem),
        Type::Group(inner) => element(&inner.elem),
        // The argument is a length, which can look like a type.
        Type::Path(path) if path.path.segments.last()?.ident == "Bytes" => None,
        Type::Path(path) => match &path.path.segments.last()?.arguments {
            PathArguments::AngleBracketed(arguments) => match arguments.args.first()? {
                GenericArgument::Type(ty) => Some(ty),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    }
}

/// Returns the kind of values in the type of a field; `number` is the type parameter.
pub(crate) fn content(ty: &Type, number: Option<&Ident>) -> Content {
    match name_of(ty).as_deref() {
        Some("f64" | "f32") => Content::Real,
        Some("i8" | "u8" | "i16" | "u16" | "i32" | "u32" | "i64" | "u64") => Content::Integer,
        Some("Bytes") => Content::Binary,
        Some("bool" | "String" | "Clock") => Content::Other,
        Some(name) if number.is_some_and(|number| number == name) => Content::Real,
        _ => Content::Unknown,
    }
}

/// The path of the items that generated code uses, in the crate `fmu` or as named by `#[fmu(crate = …)]`.
pub(crate) fn root(attributes: &[Attribute]) -> Result<TokenStream> {
    let Some(attribute) = attributes.iter().find(|attribute| attribute.path().is_ident("fmu")) else {
        return Ok(private(None));
    };
    attribute.parse_args_with(|input: ParseStream<'_>| {
        input.parse::<Token![crate]>()?;
        input.parse::<Token![=]>()?;
        Ok(private(Some(&input.parse()?)))
    })
}

/// The same path for a given crate path, by default `::fmu`.
pub(crate) fn private(root: Option<&Path>) -> TokenStream {
    root.map_or_else(|| quote!(::fmu::__private), |root| quote!(#root::__private))
}
