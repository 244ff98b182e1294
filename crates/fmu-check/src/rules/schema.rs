//! Elements and attributes in the XML schema of each version.

use super::{Finding, Report};
use fmu_import::description::FmiVersion;
use fmu_import::xml::Element;

/// Attributes and children of an element in the schema of FMI 2.0; `None` if the schema does not contain the element.
fn known_2(element: &str) -> Option<(&'static str, &'static str)> {
    const TYPES: &str = "Real Integer Boolean String Enumeration";
    Some(match element {
        "fmiModelDescription" => (
            "fmiVersion modelName guid description author version copyright license generationTool \
             generationDateAndTime variableNamingConvention numberOfEventIndicators",
            "ModelExchange CoSimulation UnitDefinitions TypeDefinitions LogCategories DefaultExperiment \
             VendorAnnotations ModelVariables ModelStructure",
        ),
        "CoSimulation" => (
            "modelIdentifier needsExecutionTool canHandleVariableCommunicationStepSize canInterpolateInputs \
             maxOutputDerivativeOrder canRunAsynchronuously canBeInstantiatedOnlyOncePerProcess \
             canNotUseMemoryManagementFunctions canGetAndSetFMUstate canSerializeFMUstate \
             providesDirectionalDerivative",
            "SourceFiles",
        ),
        "ModelExchange" => (
            "modelIdentifier needsExecutionTool completedIntegratorStepNotNeeded \
             canBeInstantiatedOnlyOncePerProcess canNotUseMemoryManagementFunctions canGetAndSetFMUstate \
             canSerializeFMUstate providesDirectionalDerivative",
            "SourceFiles",
        ),
        "SourceFiles" => ("", "File"),
        "File" => ("name", ""),
        "UnitDefinitions" => ("", "Unit"),
        "Unit" => ("name", "BaseUnit DisplayUnit"),
        "BaseUnit" => ("kg m s A K mol cd rad factor offset", ""),
        "DisplayUnit" => ("name factor offset", ""),
        "TypeDefinitions" => ("", "SimpleType"),
        "SimpleType" => ("name description", TYPES),
        "Real" => (
            "declaredType quantity unit displayUnit relativeQuantity min max nominal unbounded start derivative \
             reinit",
            "",
        ),
        "Integer" => ("declaredType quantity min max start", ""),
        "Boolean" | "String" => ("declaredType start", ""),
        "Enumeration" => ("declaredType quantity min max start", "Item"),
        "Item" => ("name value description", ""),
        "LogCategories" => ("", "Category"),
        "Category" => ("name description", ""),
        "DefaultExperiment" => ("startTime stopTime tolerance stepSize", ""),
        "VendorAnnotations" | "Annotations" => ("", "Tool"),
        "ModelVariables" => ("", "ScalarVariable"),
        "ScalarVariable" => (
            "name valueReference description causality variability initial canHandleMultipleSetPerTimeInstant",
            "Real Integer Boolean String Enumeration Annotations",
        ),
        "ModelStructure" => ("", "Outputs Derivatives InitialUnknowns"),
        "Outputs" | "Derivatives" | "InitialUnknowns" => ("", "Unknown"),
        "Unknown" => ("index dependencies dependenciesKind", ""),
        _ => return None,
    })
}

fn known_3(element: &str) -> Option<(&'static str, &'static str)> {
    macro_rules! variable {
        ($attributes:literal, $children:literal) => {
            (
                concat!(
                    "name valueReference description causality variability canHandleMultipleSetPerTimeInstant clocks \
                     intermediateUpdate previous declaredType initial ",
                    $attributes
                ),
                concat!("Annotations Dimension", $children, " Alias"),
            )
        };
    }
    macro_rules! interface {
        ($attributes:literal) => {
            (
                concat!(
                    "modelIdentifier needsExecutionTool canBeInstantiatedOnlyOncePerProcess canGetAndSetFMUState \
                     canSerializeFMUState providesDirectionalDerivatives providesAdjointDerivatives \
                     providesPerElementDependencies ",
                    $attributes
                ),
                "Annotations",
            )
        };
    }
    Some(match element {
        "fmiModelDescription" => (
            "fmiVersion modelName instantiationToken description author version copyright license generationTool \
             generationDateAndTime variableNamingConvention",
            "ModelExchange CoSimulation ScheduledExecution UnitDefinitions TypeDefinitions LogCategories \
             DefaultExperiment ModelVariables ModelStructure Annotations",
        ),
        "CoSimulation" => interface!(
            "canHandleVariableCommunicationStepSize fixedInternalStepSize maxOutputDerivativeOrder \
             recommendedIntermediateInputSmoothness providesIntermediateUpdate mightReturnEarlyFromDoStep \
             canReturnEarlyAfterIntermediateUpdate hasEventMode providesEvaluateDiscreteStates"
        ),
        "ModelExchange" => interface!("needsCompletedIntegratorStep providesEvaluateDiscreteStates"),
        "ScheduledExecution" => interface!(""),
        "UnitDefinitions" => ("", "Unit"),
        "Unit" => ("name", "BaseUnit DisplayUnit Annotations"),
        "BaseUnit" => ("kg m s A K mol cd rad factor offset", ""),
        "DisplayUnit" => ("name factor offset inverse", "Annotations"),
        "TypeDefinitions" => (
            "",
            "Float32Type Float64Type Int8Type UInt8Type Int16Type UInt16Type Int32Type UInt32Type Int64Type UInt64Type \
             BooleanType StringType BinaryType EnumerationType ClockType",
        ),
        "Float32Type" | "Float64Type" => {
            ("name description quantity unit displayUnit relativeQuantity unbounded min max nominal", "Annotations")
        }
        "Int8Type" | "UInt8Type" | "Int16Type" | "UInt16Type" | "Int32Type" | "UInt32Type" | "Int64Type"
        | "UInt64Type" => ("name description quantity min max", "Annotations"),
        "BooleanType" | "StringType" => ("name description", "Annotations"),
        "BinaryType" => ("name description mimeType maxSize", "Annotations"),
        "EnumerationType" => ("name description quantity min max", "Annotations Item"),
        "Item" => ("name value description", "Annotations"),
        "ClockType" => (
            "name description canBeDeactivated priority intervalVariability intervalDecimal shiftDecimal \
             supportsFraction resolution intervalCounter shiftCounter",
            "Annotations",
        ),
        "LogCategories" => ("", "Category"),
        "Category" => ("name description", "Annotations"),
        "DefaultExperiment" => ("startTime stopTime tolerance stepSize", "Annotations"),
        "ModelVariables" => (
            "",
            "Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Enumeration Clock",
        ),
        "Float32" | "Float64" => variable!(
            "quantity unit displayUnit relativeQuantity unbounded min max nominal start derivative reinit",
            ""
        ),
        "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64" | "UInt64" | "Enumeration" => {
            variable!("quantity min max start", "")
        }
        "Boolean" => variable!("start", ""),
        "String" => variable!("", " Start"),
        "Binary" => variable!("mimeType maxSize", " Start"),
        "Clock" => (
            "name valueReference description causality variability canHandleMultipleSetPerTimeInstant clocks declaredType \
             canBeDeactivated priority intervalVariability intervalDecimal shiftDecimal supportsFraction resolution \
             intervalCounter shiftCounter",
            "Annotations Alias",
        ),
        "Start" => ("value", ""),
        "Dimension" => ("start valueReference", ""),
        "Alias" => ("name description displayUnit", ""),
        "Annotations" => ("", "Annotation"),
        "Annotation" => ("type", ""),
        "ModelStructure" => ("", "Output ContinuousStateDerivative ClockedState InitialUnknown EventIndicator"),
        "Output" | "ContinuousStateDerivative" | "ClockedState" | "InitialUnknown" | "EventIndicator" => {
            ("valueReference dependencies dependenciesKind", "Annotations")
        }
        _ => return None,
    })
}

/// Reports elements and attributes that are not in the schema. Returns the number of compared elements.
pub(super) fn schema(element: &Element, fmi: FmiVersion, report: Report<'_>) -> usize {
    // Tool-specific elements have their own schema.
    let is_foreign = matches!(element.name.as_str(), "Tool" | "Annotation");
    let known = match fmi {
        FmiVersion::V2 => known_2(&element.name),
        FmiVersion::V3 => known_3(&element.name),
    };
    let Some((attributes, children)) = known.filter(|_| !is_foreign) else { return 0 };
    let mut compared = 1;
    let is_among = |list: &str, name: &str| list.split(' ').any(|known| known == name);
    let subject = || format!("<{}>, line {}", element.name, element.place.line);
    for name in element.attribute_names() {
        // Skips declarations of namespaces, and attributes from other namespaces, whose names contain a colon.
        if !is_among(attributes, name) && !name.contains(':') && name != "xmlns" {
            report(Finding::error(subject(), format!("FMI {fmi} has no attribute `{name}` here")));
        }
    }
    let order: Vec<&str> = children.split(' ').collect();
    let mut before: Option<(usize, &str)> = None;
    for child in &element.children {
        let Some(place) = order.iter().position(|known| *known == child.name) else {
            report(Finding::error(subject(), format!("FMI {fmi} has no element <{}> here", child.name)));
            continue;
        };
        match before {
            Some((last, name)) if place < last && !is_any_order(&element.name, &child.name) => {
                let message = format!("has <{}> after <{name}>, which must come first in FMI {fmi}", child.name);
                report(Finding::error(format!("{}, child in line {}", subject(), child.place.line), message));
            }
            _ => before = Some((place, &child.name)),
        }
        compared += schema(child, fmi, report);
    }
    if element.children.is_empty() && must_have_children(&element.name, fmi) {
        let message = format!("is empty; FMI {fmi} requires an element in it: leave it out");
        report(Finding::error(subject(), message));
    }
    compared
}

/// Returns true if the children of an element are a choice that repeats, or a child has no fixed position.
fn is_any_order(element: &str, child: &str) -> bool {
    matches!(element, "ModelVariables" | "TypeDefinitions") || matches!(child, "ModelExchange" | "CoSimulation")
}

fn must_have_children(element: &str, fmi: FmiVersion) -> bool {
    let in_both = ["UnitDefinitions", "TypeDefinitions", "LogCategories", "ModelVariables", "Annotations"];
    let in_2 = ["SourceFiles", "VendorAnnotations", "Outputs", "Derivatives", "InitialUnknowns"];
    let in_3 = ["EnumerationType"];
    let of_version = if fmi == FmiVersion::V2 { &in_2[..] } else { &in_3 };
    in_both.contains(&element) || of_version.contains(&element)
}
