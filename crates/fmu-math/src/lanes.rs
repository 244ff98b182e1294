//! Polynomials, and macros that define a function and its array version from kernels.

/// Defines a function of one number and its array version.
///
/// `near` is the fast path. Arguments for which `far` sets the highest bit take the general path: `full` if `outside`
/// sets the highest bit, otherwise `kernel`. `near` and `kernel` are bit-identical. The array version is inlined,
/// because a call would pass arguments and results through memory.
macro_rules! function_near {
    ($(#[$doc:meta])* $name:ident, $each:ident, $far:expr, $near:expr, $outside:expr, $kernel:expr, $full:expr) => {
        /// The general path, not inlined to keep libraries small.
        mod $each {
            use super::*;

            #[inline(never)]
            pub(super) fn single(x: f64) -> f64 {
                if $outside(x) >> 63 == 0 { $kernel(x) } else { crate::bits::canonical($full(x)) }
            }

            #[inline(never)]
            fn two(x: [f64; 2]) -> [f64; 2] {
                if ($outside(x[0]) | $outside(x[1])) >> 63 == 0 { x.map($kernel) } else { x.map(single) }
            }

            #[inline(never)]
            pub(super) fn far(x: &mut [f64]) {
                let mut pairs = x.chunks_exact_mut(2);
                for pair in &mut pairs {
                    pair.copy_from_slice(&two([pair[0], pair[1]]));
                }
                for last in pairs.into_remainder() {
                    *last = single(*last);
                }
            }
        }

        $(#[$doc])*
        #[inline(never)]
        #[must_use]
        pub fn $name(x: f64) -> f64 {
            if $far(x) >> 63 == 0 { $near(x) } else { $each::single(x) }
        }

        #[doc = concat!("[`", stringify!($name), "`] of each element, bit-identical.")]
        #[inline(always)]
        #[must_use]
        pub fn $each<const N: usize>(x: [f64; N]) -> [f64; N] {
            let mut any = 0;
            for &x in &x {
                any |= $far(x);
            }
            if any >> 63 == 0 {
                x.map($near)
            } else {
                // A copy, because the compiler would keep a borrowed array in memory instead of registers.
                let mut copy: [f64; N] = core::array::from_fn(|i| x[i]);
                $each::far(&mut copy);
                core::array::from_fn::<_, N, _>(|i| copy[i])
            }
        }
    };
}

/// Like [`function_near`], for two numbers. The kernel returns its result and the value of `outside`.
macro_rules! function2_near {
    ($(#[$doc:meta])* $name:ident, $each:ident, $a:ident, $b:ident, $far:expr, $near:expr, $kernel:expr, $full:expr) => {
        mod $each {
            use super::*;

            #[inline(never)]
            pub(super) fn single(a: f64, b: f64) -> f64 {
                let (value, outside) = $kernel(a, b);
                if outside >> 63 == 0 { value } else { crate::bits::canonical($full(a, b)) }
            }

            /// Replaces `a` by the result.
            #[inline(never)]
            pub(super) fn far(a: &mut [f64], b: &[f64]) {
                a.iter_mut().zip(b).for_each(|(a, b)| *a = single(*a, *b));
            }
        }

        $(#[$doc])*
        #[inline(never)]
        #[must_use]
        pub fn $name($a: f64, $b: f64) -> f64 {
            if $far($a, $b) >> 63 == 0 { $near($a, $b) } else { $each::single($a, $b) }
        }

        #[doc = concat!("[`", stringify!($name), "`] of each pair of elements, bit-identical.")]
        #[inline(always)]
        #[must_use]
        pub fn $each<const N: usize>($a: [f64; N], $b: [f64; N]) -> [f64; N] {
            let mut any = 0;
            for (a, b) in $a.iter().zip(&$b) {
                any |= $far(*a, *b);
            }
            if any >> 63 == 0 {
                core::array::from_fn(|i| $near($a[i], $b[i]))
            } else {
                // Copies for the same reason as in [`function_near`].
                let mut result: [f64; N] = core::array::from_fn(|i| $a[i]);
                $each::far(&mut result, &core::array::from_fn::<_, N, _>(|i| $b[i]));
                core::array::from_fn::<_, N, _>(|i| result[i])
            }
        }
    };
}

pub(crate) use {function_near, function2_near};

/// A polynomial of degree 5 in `z`, evaluated in pairs so that additions do not depend on each other.
#[inline(always)]
pub(crate) fn polynomial6(c: &[f64; 6], z: f64) -> f64 {
    let z2 = z * z;
    ((c[0] + c[1] * z) + z2 * (c[2] + c[3] * z)) + (z2 * z2) * (c[4] + c[5] * z)
}

#[inline(always)]
pub(crate) fn polynomial7(c: &[f64; 7], z: f64) -> f64 {
    let z2 = z * z;
    let high = (c[2] + c[3] * z) + z2 * ((c[4] + c[5] * z) + z2 * c[6]);
    (c[0] + c[1] * z) + z2 * high
}

#[inline(always)]
pub(crate) fn polynomial8(c: &[f64; 8], z: f64) -> f64 {
    let z2 = z * z;
    let low = (c[0] + c[1] * z) + z2 * (c[2] + c[3] * z);
    let high = (c[4] + c[5] * z) + z2 * (c[6] + c[7] * z);
    low + (z2 * z2) * high
}

#[inline(always)]
pub(crate) fn polynomial11(c: &[f64; 11], z: f64) -> f64 {
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = (c[0] + c[1] * z) + z2 * (c[2] + c[3] * z);
    let middle = (c[4] + c[5] * z) + z2 * (c[6] + c[7] * z);
    let high = (c[8] + c[9] * z) + z2 * c[10];
    low + z4 * (middle + z4 * high)
}

#[inline(always)]
pub(crate) fn polynomial13(c: &[f64; 13], z: f64) -> f64 {
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = (c[0] + c[1] * z) + z2 * (c[2] + c[3] * z);
    let middle = (c[4] + c[5] * z) + z2 * (c[6] + c[7] * z);
    let high = (c[8] + c[9] * z) + z2 * (c[10] + c[11] * z);
    (low + z4 * middle) + (z4 * z4) * (high + z4 * c[12])
}
