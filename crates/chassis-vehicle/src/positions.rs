//! Arrays whose elements are named after positions of wheels and axles.

use fmu::Scalar;

fmu::named_array! {
    /// The wheels of a three-axle vehicle; left wheels have even indices.
    pub SixWheels[6] {
        fl: "front left wheel",
        fr: "front right wheel",
        ml: "middle left wheel",
        mr: "middle right wheel",
        rl: "rear left wheel",
        rr: "rear right wheel",
    }
}

fmu::named_array! {
    /// The wheels of a two-axle vehicle; left wheels have even indices.
    pub FourWheels[4] {
        fl: "front left wheel",
        fr: "front right wheel",
        rl: "rear left wheel",
        rr: "rear right wheel",
    }
}

fmu::named_array! {
    /// The sides of a half car seen from the front, or the walking beams.
    pub Sides[2] {
        l: "left side",
        r: "right side",
    }
}

fmu::named_array! {
    /// The left side alone, for a control law that uses only one side.
    pub LeftSide[1] {
        l: "left side",
    }
}

fmu::named_array! {
    /// The wheels of the front axle.
    pub FrontWheels[2] {
        fl: "front left wheel",
        fr: "front right wheel",
    }
}

fmu::named_array! {
    /// The front left wheel alone, for a vehicle with the same road under all wheels.
    pub FrontLeftWheel[1] {
        fl: "front left wheel",
    }
}

fmu::named_array! {
    /// The suspension struts of a three-axle vehicle with walking beams at its rear axles; left struts have even
    /// indices.
    pub Struts[4] {
        fl: "front left strut",
        fr: "front right strut",
        rl: "left strut of the walking-beam suspension",
        rr: "right strut of the walking-beam suspension",
    }
}

fmu::named_array! {
    /// The axles of a two-axle vehicle.
    pub TwoAxles[2] {
        front: "front axle",
        rear: "rear axle",
    }
}

fmu::named_array! {
    /// The front axle alone, for a vehicle that steers only this axle.
    pub FrontAxle[1] {
        front: "front axle",
    }
}

fmu::named_array! {
    /// The axles of a three-axle vehicle.
    pub ThreeAxles[3] {
        front: "front axle",
        middle: "middle axle",
        rear: "rear axle",
    }
}

fmu::named_array! {
    /// The axles behind the front axle of a three-axle vehicle.
    pub RearAxles[2] {
        middle: "middle axle",
        rear: "rear axle",
    }
}

/// Sums over left and right elements side by side (see [`crate::arithmetic`]).
macro_rules! sum_of {
    ($name:ident: $first_left:literal $($left:literal)*, $first_right:literal $($right:literal)*) => {
        impl<T: Scalar> $name<T> {
            /// Sum of `f` over all indices: the sum over the left side plus the sum over the right side.
            #[inline]
            pub fn sum_of(f: impl Fn(usize) -> T) -> T {
                (f($first_left) $(+ f($left))*) + (f($first_right) $(+ f($right))*)
            }
        }
    };
}

sum_of!(SixWheels: 0 2 4, 1 3 5);
sum_of!(FourWheels: 0 2, 1 3);
sum_of!(Struts: 0 2, 1 3);

/// Axle (0, 1, 2) of wheel `i` in [`SixWheels`].
pub const fn axle_of(i: usize) -> usize {
    i / 2
}

/// +1 for a left wheel, -1 for a right one, in [`SixWheels`], [`FourWheels`] and [`Sides`].
pub const fn left_is_positive(i: usize) -> f64 {
    if i.is_multiple_of(2) { 1.0 } else { -1.0 }
}
