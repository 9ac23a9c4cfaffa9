//! Sines, cosines and tangents of many angles at once, by vector instructions: to the bit those of `libm`, one at a time.
//!
//! The same operations in the same order as there (FreeBSD's `k_sin.c`, `k_cos.c`, `k_tan.c` and the first round of
//! `e_rem_pio2.c`), without branches. What would take another branch there is left to `libm` itself: angles that are tiny,
//! large, or near a bound between two of its cases.

/// Sine and cosine of each angle (rad) into the other two, which are as long.
#[inline(always)]
pub fn sincos_all(angles: &[f64], sines: &mut [f64], cosines: &mut [f64]) {
    for ((angle, sine), cosine) in angles.iter().zip(&mut *sines).zip(&mut *cosines) {
        (*sine, *cosine) = sincos(*angle);
    }
    for ((angle, sine), cosine) in angles.iter().zip(sines).zip(cosines) {
        if sine.is_nan() {
            (*sine, *cosine) = libm::sincos(*angle);
        }
    }
}

/// Tangent of each angle (rad) into the other, which is as long.
#[inline(always)]
pub fn tan_all(angles: &[f64], tangents: &mut [f64]) {
    for (angle, tangent) in angles.iter().zip(&mut *tangents) {
        *tangent = tan(*angle);
    }
    for (angle, tangent) in angles.iter().zip(tangents) {
        if tangent.is_nan() {
            *tangent = libm::tan(*angle);
        }
    }
}

/// Smaller angles (rad) are their own sine and tangent there.
const TINY: f64 = 2e-8;

/// Sine and cosine; NaN where they are another case.
#[inline(always)]
#[allow(clippy::excessive_precision, reason = "as in the source")]
fn sincos(x: f64) -> (f64, f64) {
    /// Adding it rounds to an integer, which is then in the lowest bits.
    const TO_INTEGER: f64 = 1.5 / f64::EPSILON;
    const PIO2_1: f64 = 1.57079632673412561417e+00;
    const PIO2_1T: f64 = 6.07710050650619224932e-11;
    const S: [f64; 6] = [
        -1.66666666666666324348e-01,
        8.33333333332248946124e-03,
        -1.98412698298579493134e-04,
        2.75573137070700676789e-06,
        -2.50507602534068634195e-08,
        1.58969099521155010221e-10,
    ];
    const C: [f64; 6] = [
        4.16666666666666019037e-02,
        -1.38888888888741095749e-03,
        2.48015872894767294178e-05,
        -2.75573143513906633035e-07,
        2.08757232129817482790e-09,
        -1.13596475577881948265e-11,
    ];
    // x is n quarter turns and y + rest.
    let shifted = x * std::f64::consts::FRAC_2_PI + TO_INTEGER;
    let n = shifted - TO_INTEGER;
    let (most, less) = (x - n * PIO2_1, n * PIO2_1T);
    let y = most - less;
    let rest = (most - y) - less;

    let z = y * y;
    let w = z * z;
    let r = S[1] + z * (S[2] + z * S[3]) + z * w * (S[4] + z * S[5]);
    let v = z * y;
    let whole = y + v * (S[0] + z * r);
    let reduced = y - ((z * (0.5 * rest - v * r) - rest) - v * S[0]);
    let sine = if n == 0.0 { whole } else { reduced };

    let r = z * (C[0] + z * (C[1] + z * C[2])) + w * w * (C[3] + z * (C[4] + z * C[5]));
    let half = 0.5 * z;
    let w = 1.0 - half;
    let cosine = w + (((1.0 - w) - half) + (z * r - y * rest));

    let quarters = shifted.to_bits();
    let swap = 0_u64.wrapping_sub(quarters & 1);
    let (s, c) = (sine.to_bits(), cosine.to_bits());
    let sine = f64::from_bits(((s & !swap) | (c & swap)) ^ ((quarters & 2) << 62));
    let cosine = f64::from_bits(((c & !swap) | (s & swap)) ^ ((quarters.wrapping_add(1) & 2) << 62));

    // Near no bound between the cases, and little is lost by the reduction.
    let far = y.abs();
    let plain = (x.abs() >= TINY) & (x.abs() < 7.0) & (far < 0.78) & ((n == 0.0) | (far > 1e-3));
    (if plain { sine } else { f64::NAN }, cosine)
}

/// Tangent; NaN where it is another case.
#[inline(always)]
#[allow(clippy::excessive_precision, reason = "as in the source")]
fn tan(x: f64) -> f64 {
    const T: [f64; 13] = [
        3.33333333333334091986e-01,
        1.33333333333201242699e-01,
        5.39682539762260521377e-02,
        2.18694882948595424599e-02,
        8.86323982359930005737e-03,
        3.59207910759131235356e-03,
        1.45620945432529025516e-03,
        5.88041240820264096874e-04,
        2.46463134818469906812e-04,
        7.81794442939557092300e-05,
        7.14072491382608190305e-05,
        -1.85586374855275456654e-05,
        2.59073051863633712884e-05,
    ];
    let z = x * x;
    let w = z * z;
    let r = T[1] + w * (T[3] + w * (T[5] + w * (T[7] + w * (T[9] + w * T[11]))));
    let v = z * (T[2] + w * (T[4] + w * (T[6] + w * (T[8] + w * (T[10] + w * T[12])))));
    let s = z * x;
    let r = z * (s * (r + v)) + s * T[0];
    let plain = (x.abs() >= TINY) & (x.abs() < 0.674);
    if plain { x + r } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_4;

    use proptest::prelude::*;

    use super::*;

    fn assert_same(angles: &[f64]) {
        let (mut sines, mut cosines, mut tangents) =
            (vec![0.0; angles.len()], vec![0.0; angles.len()], vec![0.0; angles.len()]);
        sincos_all(angles, &mut sines, &mut cosines);
        tan_all(angles, &mut tangents);
        for (i, angle) in angles.iter().enumerate() {
            let all = [sines[i], cosines[i], tangents[i]];
            let (sine, cosine) = libm::sincos(*angle);
            let one = [sine, cosine, libm::tan(*angle)];
            assert_eq!(all.map(f64::to_bits), one.map(f64::to_bits), "{angle:e}: {all:?} {one:?}");
        }
    }

    #[test]
    fn every_kind_of_angle_has_the_bits_of_libm() {
        let special = [0.0, -0.0, 1e-300, 1e-9, 1.4e-8, 2e-8, 0.674, 0.6744, 0.78, 7.0, 1e5, 1e22, f64::INFINITY];
        let signed: Vec<f64> = special.iter().flat_map(|angle| [*angle, -*angle]).collect();
        assert_same(&signed);
        // Around each eighth of a turn, from a rounding away to a few hundredths.
        for eighth in -9..=9 {
            let bound = FRAC_PI_4 * f64::from(eighth);
            let near = (0..60).map(|k| libm::exp2(-f64::from(k)) * 0.1).flat_map(|by| [bound + by, bound - by]);
            assert_same(&near.collect::<Vec<_>>());
        }
        assert_same(&(-80_000..80_000).map(|k| f64::from(k) * 1e-4).collect::<Vec<_>>());
    }

    proptest! {
        #[test]
        fn any_angle_has_the_bits_of_libm(near in prop::collection::vec(-8.0..8.0, 300), any in any::<[f64; 4]>()) {
            assert_same(&near);
            let small: Vec<f64> = near.iter().map(|angle| angle / 16.0).collect();
            assert_same(&small);
            assert_same(&any.map(|angle| if angle.is_nan() { 0.0 } else { angle }));
        }
    }
}
