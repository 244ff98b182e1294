//! The pages of the guide: their Rust blocks are compiled and run as doctests.

macro_rules! pages {
    ($($name:ident = $file:literal,)*) => {$(
        #[cfg(doctest)]
        #[doc = include_str!($file)]
        pub mod $name {}
    )*};
}

pages! {
    readme = "../../README.md",
    introduction = "src/introduction.md",
    first_model = "src/first-model.md",
    variables = "src/variables.md",
    models = "src/models.md",
    events = "src/events.md",
    clocks = "src/clocks.md",
    sizes = "src/sizes.md",
    solvers = "src/solvers.md",
    resources = "src/resources.md",
    testing = "src/testing.md",
    interfaces = "src/interfaces.md",
    lab = "src/lab.md",
    platforms = "src/platforms.md",
    scenarios = "src/scenarios.md",
    ssp = "src/ssp.md",
    swapping = "src/swapping.md",
    optimal_control = "src/optimal-control.md",
    steady_states = "src/steady-states.md",
    comparison = "src/comparison.md",
    convergence = "src/convergence.md",
    untrusted = "src/untrusted.md",
    studies = "src/studies.md",
    assess = "src/assess.md",
    attributes = "src/attributes.md",
    coming_from = "src/coming-from.md",
}
