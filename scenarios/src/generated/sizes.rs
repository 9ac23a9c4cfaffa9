//! How large road users are: near the sizes of those in WOMD (medians over 27,658 tracks: 4.63 x 2.07 x 1.66 m; 2 % are over 6.5 m long).

use super::draw::Draw;

/// The AV's length, width and height (m), those of WOMD's own.
pub(super) const AV: [f64; 3] = [5.286, 2.332, 2.33];

/// A car, van, truck or bus.
pub(super) fn vehicle(draw: &mut Draw) -> [f64; 3] {
    match draw.between(0.0, 1.0) {
        kind if kind < 0.84 => {
            let [a, b] = [draw.normal(0.0, 1.0), draw.normal(0.0, 1.0)].map(|random| random.clamp(-2.2, 2.2));
            [4.6 + 0.18 * a, 2.05 + 0.05 * a + 0.05 * b, 1.62 + 0.05 * a + 0.1 * b]
        }
        kind if kind < 0.945 => {
            let size = draw.between(0.0, 1.0);
            [5.0 + 0.9 * size, 2.15 + 0.25 * size + draw.between(0.0, 0.12), 1.8 + 0.5 * size]
        }
        kind if kind < 0.985 => {
            let size = draw.between(0.0, 1.0);
            [6.4 + 2.6 * size, 2.35 + 0.2 * size, 2.4 + 0.8 * size]
        }
        _ => [draw.between(10.0, 12.0), 2.6, 3.2],
    }
}

/// A car: nothing longer than it can stand in a bay.
pub(super) fn car(draw: &mut Draw) -> [f64; 3] {
    let [a, b] = [draw.normal(0.0, 1.0), draw.normal(0.0, 1.0)].map(|random| random.clamp(-2.0, 2.0));
    [4.62 + 0.19 * a, 2.05 + 0.05 * a + 0.04 * b, 1.65 + 0.06 * a + 0.1 * b]
}

/// Somebody on a bicycle.
pub(super) fn bicycle(draw: &mut Draw) -> [f64; 3] {
    [draw.normal(1.86, 0.08).clamp(1.6, 2.05), draw.normal(0.85, 0.04).clamp(0.75, 0.95), draw.normal(1.78, 0.06)]
}
