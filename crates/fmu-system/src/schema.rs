//! JSON Schemas of the files that people write, for editors.

use crate::scenario::Written;
use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema};
use serde_json::{Value, json};

/// Returns the schema of a file, as it is read. Editors of TOML understand draft 7.
pub fn of_file<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft07().with_transform(RecursiveTransform(remove_null));
    settings.into_generator().into_root_schema_for::<T>()
}

/// Returns the schema of a scenario.
pub fn scenario() -> Schema {
    of_file::<Written>()
}

/// TOML has no null: an optional key is left out.
fn remove_null(schema: &mut Schema) {
    let Some(object) = schema.as_object_mut() else { return };
    let null = json!("null");
    if let Some(Value::Array(kinds)) = object.get_mut("type") {
        kinds.retain(|kind| *kind != null);
        if let [only] = kinds.as_slice() {
            let only = only.clone();
            object.insert("type".to_owned(), only);
        }
    }
    if let Some(Value::Array(forms)) = object.get_mut("anyOf") {
        forms.retain(|form| form.get("type") != Some(&null));
        if let [only] = forms.as_slice() {
            let only = only.clone();
            object.remove("anyOf");
            // Draft 7 ignores keywords next to a `$ref`.
            object.insert("allOf".to_owned(), Value::Array(vec![only]));
        }
    }
}
