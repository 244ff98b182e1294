//! Coefficients of the kernels, lowest first. Written by `tools/coefficients.py`: do not edit.

#![allow(clippy::excessive_precision, clippy::unreadable_literal, clippy::approx_constant)]

// pi/2 in three parts.
pub(crate) const PIO2_1: f64 = 1.5707963267923333;
pub(crate) const PIO2_2: f64 = 2.5633441515905732e-12;
pub(crate) const PIO2_3: f64 = 3.9455541665632055e-24;

// 2/pi
pub(crate) const TWO_OVER_PI: f64 = 0.6366197723675814;

// pi/4 in two parts.
pub(crate) const PIO4_HI: f64 = 0.7853981633974483;
pub(crate) const PIO4_LO: f64 = 3.061616997868383e-17;

// ln 2 in two parts.
pub(crate) const LN2_HI: f64 = 0.6931471805598903;
pub(crate) const LN2_LO: f64 = 5.497923018708371e-14;

// 1 / ln 2
pub(crate) const INV_LN2: f64 = 1.4426950408889634;

// 1/3 in two parts.
pub(crate) const THIRD_HI: f64 = 0.3333333333333333;
pub(crate) const THIRD_LO: f64 = 1.850371707708594e-17;

// (sin(r)/r - 1)/z, z = r^2, |r| <= pi/4. Relative error of the function below 2^-57.88.
#[rustfmt::skip]
pub(crate) const SIN: [f64; 6] = [
    -0.1666666666666663,
    0.008333333333321903,
    -0.0001984126982943917,
    2.755731357400289e-06,
    -2.505074084968086e-08,
    1.5895850296066635e-10,
];

// (cos(r) - 1 + z/2)/z^2, z = r^2, |r| <= pi/4. Relative error of the function below 2^-63.8.
#[rustfmt::skip]
pub(crate) const COS: [f64; 6] = [
    0.04166666666666659,
    -0.0013888888888872334,
    2.48015872884534e-05,
    -2.755731407532637e-07,
    2.087568785168629e-09,
    -1.1357910264424929e-11,
];

// (atan(t)/t - 1)/z, z = t^2, |t| <= 1/2. Relative error of the function below 2^-61.8.
#[rustfmt::skip]
pub(crate) const ATAN: [f64; 13] = [
    -0.3333333333333331,
    0.19999999999992585,
    -0.14285714284902803,
    0.11111111065995243,
    -0.09090907601880106,
    0.07692275922916114,
    -0.06666205731773196,
    0.05877666833144521,
    -0.05229253262929081,
    0.045866709621124026,
    -0.03705320767593768,
    0.02356491733916487,
    -0.008310842353202888,
];

// (asin(s)/s - 1)/z, z = s^2, |s| <= 1/2. Relative error of the function below 2^-59.77.
#[rustfmt::skip]
pub(crate) const ASIN: [f64; 13] = [
    0.1666666666666676,
    0.07499999999971174,
    0.044642857174112135,
    0.03038194273578786,
    0.02237221412861531,
    0.017351628227432116,
    0.013980620480784398,
    0.011400575398670357,
    0.01077086315672477,
    0.003741919380549942,
    0.021621309496905414,
    -0.020877916868953638,
    0.03255350820524457,
];

// (tanh(x)/x - 1)/z, z = x^2, |x| <= 0.55. Relative error of the function below 2^-60.55.
#[rustfmt::skip]
pub(crate) const TANH: [f64; 11] = [
    -0.333333333333333,
    0.13333333333326552,
    -0.053968253963713436,
    0.021869488384393978,
    -0.008863232576470165,
    0.003592091772255262,
    -0.0014555411609727226,
    0.0005884375015806997,
    -0.00023336371967479084,
    8.329081775125549e-05,
    -1.9478854475690415e-05,
];

// (exp(r) - 1 - r)/r^2, |r| <= ln(2)/2. Relative error of the function below 2^-61.33.
#[rustfmt::skip]
pub(crate) const EXPM1: [f64; 11] = [
    0.5,
    0.16666666666666677,
    0.04166666666666668,
    0.008333333333321447,
    0.0013888888888877447,
    0.0001984126988656001,
    2.4801587340615598e-05,
    2.755724378637557e-06,
    2.7557259200953077e-07,
    2.510918285038465e-08,
    2.0919505183972592e-09,
];

// ((ln(1 + s) - ln(1 - s))/s - 2)/z, z = s^2, s = (m - 1)/(m + 1), m from sqrt(1/2) to sqrt(2). Relative error of the function below 2^-59.41.
#[rustfmt::skip]
pub(crate) const LN: [f64; 7] = [
    0.6666666666666737,
    0.3999999999939863,
    0.28571428745551214,
    0.22222198273544116,
    0.1818357906686337,
    0.1531368752092411,
    0.14799487338447104,
];

// The terms of the same beyond z/3, relative to 2 s: 1/5 + z/7 + ... Relative error of the function below 2^-73.24.
#[rustfmt::skip]
pub(crate) const LN_TAIL: [f64; 8] = [
    0.19999999999999987,
    0.14285714285723347,
    0.1111111110860554,
    0.09090909452507559,
    0.07692277385673668,
    0.06668195091933483,
    0.05836735780160468,
    0.05999672317624725,
];
