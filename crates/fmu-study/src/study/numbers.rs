//! Numbers that must be positive.

use fmu_system::problem::Collector;
use fmu_system::spanned::Spanned;

pub(super) fn positive(value: &Spanned<f64>, name: &str, problems: &mut Collector) -> f64 {
    let number = *value.get_ref();
    if !(number.is_finite() && number > 0.0) {
        problems.add(value.span(), format!("{name} is {number:?}, expected above 0"));
    }
    number
}

pub(super) fn at_least_1(value: &Spanned<i64>, name: &str, problems: &mut Collector) -> u64 {
    match u64::try_from(*value.get_ref()) {
        Ok(number) if number > 0 => number,
        _ => {
            problems.add(value.span(), format!("{name} is {}, expected at least 1", value.get_ref()));
            1
        }
    }
}
