//! How large a difference must be for so many pairs to show it.

use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::LEVEL;

/// How often a difference of the detectable size is found.
pub const POWER: f64 = 0.8;

/// The mean of paired differences that a two-sided test at 5 % finds four times out of five, where those differences spread (standard
/// deviation) as these do: (t(0.975) + t(0.8)) s / sqrt(n), Student's t with n - 1 degrees of freedom. None of fewer than two values,
/// or of values that do not spread: how they would is not known then.
#[must_use]
pub fn detectable_mean(differences: &[f64]) -> Option<f64> {
    let pairs = differences.len();
    let freedom = pairs.checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    let mean = differences.iter().sum::<f64>() / pairs as f64;
    let squares: f64 = differences.iter().map(|value| (value - mean) * (value - mean)).sum();
    let spread = (squares / freedom).sqrt();
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
    let quantiles = student.inverse_cdf(1.0 - LEVEL / 2.0) + student.inverse_cdf(POWER);
    Some(quantiles * spread / (pairs as f64).sqrt()).filter(|found| found.is_finite() && *found > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_pairs_students_t_is_cauchys_and_known() {
        // tan(pi (p - 1/2)); a spread of 1/sqrt(2) over 0 and 1.
        let wanted = (libm::tan(0.475 * std::f64::consts::PI) + libm::tan(0.3 * std::f64::consts::PI)) / 2.0;
        let found = detectable_mean(&[0.0, 1.0]).unwrap();
        assert!((found - wanted).abs() < 1e-9 * wanted, "{found} {wanted}");
    }

    #[test]
    fn of_many_pairs_it_is_2_8_standard_errors() {
        let differences: Vec<f64> = (0..100_000).map(|at| f64::from(at % 2)).collect();
        let error = 0.5 / 100_000.0_f64.sqrt();
        assert!((detectable_mean(&differences).unwrap() / error - 2.8016).abs() < 1e-3);
    }

    #[test]
    fn without_a_spread_nothing_is_known() {
        assert_eq!(detectable_mean(&[]), None);
        assert_eq!(detectable_mean(&[1.0]), None);
        assert_eq!(detectable_mean(&[1.0, 1.0, 1.0]), None);
    }
}
