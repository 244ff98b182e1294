//! `Rod`: heat conduction, stiff and with many states. The README has the equations.

use fmu::prelude::*;

/// Defines a rod with a given number of cells.
#[doc(hidden)]
#[macro_export]
macro_rules! rod {
    ($(#[$doc:meta])* $name:ident, $cells:expr) => {
        /// Parameters of the rod.
        #[derive(Parameters)]
        pub struct $name {
            /// Thermal diffusivity (m2/s)
            #[var(start = 0.05, positive)]
            diffusivity: f64,
            /// Length (m)
            #[var(start = 1.0, positive)]
            length: f64,
        }

        /// Temperatures.
        #[derive(State)]
        pub struct X<T> {
            /// Temperature above the ends (K)
            #[var(start = 100.0, nominal = 100.0)]
            pub cell: [T; $cells],
        }

        /// Measured output.
        #[derive(Outputs)]
        pub struct Y<T> {
            /// Mean temperature above the ends (K)
            pub mean: T,
        }

        $(#[$doc])*
        #[fmu::model(stop_time = 2.0, step_size = 0.01, solver = Rosenbrock { tolerance: 1e-8 })]
        impl Continuous for $name {
            type State<T: Scalar> = X<T>;
            type Outputs<T: Scalar> = Y<T>;
            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
                let x = &at.state.cell;
                let width = self.length / $cells as f64;
                let rate = self.diffusivity / (width * width);
                let cell = std::array::from_fn(|i| {
                    // The temperature of an end is the mean of the temperatures of the outermost cell and of its mirror
                    // image.
                    let left = if i == 0 { -x[0] } else { x[i - 1] };
                    let right = if i == $cells - 1 { -x[i] } else { x[i + 1] };
                    (left - x[i] * 2.0 + right) * rate
                });
                X { cell }
            }
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
                Y { mean: at.state.cell.iter().copied().sum::<T>() / $cells as f64 }
            }
        }
    };
}

/// Number of cells.
pub const CELLS: usize = 500;

rod! {
    /// Rod that is suddenly cold at both ends: stiff, with many states
    Rod, CELLS
}

/// Mean temperature of a rod with `cells` cells after `time` s, in K, for the start values of the parameters. Closed
/// form: the modes sin((2 i + 1) k pi/(2 N)) decay at the rates 4 a/dx^2 sin^2(k pi/(2 N)), and only modes with odd k
/// contribute.
#[must_use]
pub fn mean(cells: usize, time: f64) -> f64 {
    let n = cells as f64;
    let modes = (1..=cells).step_by(2).map(|k| {
        let sine = fmu::math::sin(k as f64 * std::f64::consts::PI / (2.0 * n));
        let weight = if k == cells { 1.0 } else { 2.0 };
        weight / (n * sine).powi(2) * fmu::math::exp(-4.0 * 0.05 * (n * sine).powi(2) * time)
    });
    100.0 * modes.sum::<f64>()
}
