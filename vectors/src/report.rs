//! The worst deviation of each quantity, where it is, and whether it is within tolerance.

use std::fmt;

/// Something that is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// The largest deviation that still holds.
    pub tolerance: f64,
    /// Unit of the deviation: `m`, `rad` ..., `abs` or `rel` of several; empty where it counts differences.
    pub unit: &'static str,
}

impl Quantity {
    /// A number that may be off by `tolerance`.
    #[must_use]
    pub const fn within(name: &'static str, tolerance: f64, unit: &'static str) -> Self {
        Self { name, tolerance, unit }
    }

    /// Something that must be the same; its deviation counts differences.
    #[must_use]
    pub const fn exact(name: &'static str) -> Self {
        Self { name, tolerance: 0.0, unit: "" }
    }
}

/// The largest deviation so far.
#[derive(Clone, Debug, Default, PartialEq)]
struct Worst {
    deviation: f64,
    /// Where; empty if the quantity was never compared.
    place: String,
}

/// What came out of a comparison: a row for each quantity, a column for each way in which it was computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    cases: usize,
    columns: Vec<&'static str>,
    rows: Vec<(Quantity, Vec<Worst>)>,
    notes: Vec<String>,
}

impl Report {
    /// An empty report on these quantities, each computed in these ways (one name where there is but one way).
    #[must_use]
    pub fn new(columns: &[&'static str], quantities: &[Quantity]) -> Self {
        let row = |quantity: &Quantity| (*quantity, vec![Worst::default(); columns.len()]);
        Self { cases: 0, columns: columns.to_vec(), rows: quantities.iter().map(row).collect(), notes: vec![] }
    }

    /// Adds a line to be read with the table.
    pub fn note(&mut self, line: String) {
        self.notes.push(line);
    }

    /// Counts a case.
    pub fn count_case(&mut self) {
        self.cases += 1;
    }

    /// Adds a deviation, found at `place`, of a quantity as column `column` computes it. What is not a number is worst of all. A
    /// quantity that was not announced gets a row of its own.
    ///
    /// # Panics
    /// Where there is no such column.
    pub fn add(&mut self, column: usize, quantity: Quantity, deviation: f64, place: impl fmt::Display) {
        let row = self.rows.iter().position(|(known, _)| *known == quantity).unwrap_or_else(|| {
            self.rows.push((quantity, vec![Worst::default(); self.columns.len()]));
            self.rows.len() - 1
        });
        let worst = &mut self.rows[row].1[column];
        let deviation = if deviation.is_nan() { f64::INFINITY } else { deviation };
        if worst.place.is_empty() || deviation > worst.deviation {
            *worst = Worst { deviation, place: place.to_string() };
        }
    }

    /// Whether every deviation is within its tolerance, and every quantity was compared.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.rows.iter().all(row_holds)
    }
}

fn row_holds((quantity, worst): &(Quantity, Vec<Worst>)) -> bool {
    worst.iter().all(|worst| !worst.place.is_empty() && worst.deviation <= quantity.tolerance)
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} cases; the worst deviation of each quantity, and where", self.cases)?;
        let mut table = vec![vec!["quantity".to_owned(), "tolerance".to_owned()]];
        table[0].extend(self.columns.iter().flat_map(|column| [(*column).to_owned(), "where".to_owned()]));
        for row in &self.rows {
            let (quantity, worst) = row;
            let tolerance = match quantity.tolerance {
                0.0 => "exact".to_owned(),
                tolerance => format!("{tolerance:.0e} {}", quantity.unit),
            };
            let mut cells = vec![quantity.name.to_owned(), tolerance];
            for Worst { deviation, place } in worst {
                let seen = !place.is_empty();
                cells.push(if seen { format!("{deviation:.1e}") } else { "-".to_owned() });
                cells.push(if seen { place.clone() } else { "never compared".to_owned() });
            }
            cells.push(if row_holds(row) { String::new() } else { "OUT".to_owned() });
            table.push(cells);
        }
        let columns = table.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| table.iter().filter_map(|row| Some(row.get(column)?.chars().count())).max();
        let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
        for row in &table {
            let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
            writeln!(f, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
        }
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        write!(f, "{}", if self.holds() { "all within tolerance" } else { "OUT OF TOLERANCE" })
    }
}

/// The largest |got - wanted|, each over the scale that `scale` gives the wanted number; infinite where one is not a number or
/// there are not as many of the one as of the other.
#[must_use]
pub fn worst_deviation(got: impl IntoIterator<Item = f64>, wanted: &[f64], scale: impl Fn(f64) -> f64) -> f64 {
    let mut worst = 0.0;
    let mut got = got.into_iter();
    for wanted in wanted {
        let Some(got) = got.next() else { return f64::INFINITY };
        let deviation = (got - wanted).abs() / scale(*wanted);
        if deviation.is_nan() {
            return f64::INFINITY;
        }
        if deviation > worst {
            worst = deviation;
        }
    }
    if got.next().is_none() { worst } else { f64::INFINITY }
}

/// The scale of an absolute deviation.
#[must_use]
pub fn absolute(_: f64) -> f64 {
    1.0
}

/// The scale of a relative deviation.
#[must_use]
pub fn relative(wanted: f64) -> f64 {
    wanted.abs().max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH: Quantity = Quantity::within("length", 1e-6, "m");
    const FLAGS: Quantity = Quantity::exact("flags");

    #[test]
    fn a_report_holds_when_all_is_compared_and_within_tolerance() {
        let mut report = Report::new(&["ours"], &[LENGTH, FLAGS]);
        report.add(0, LENGTH, 1e-6, "here");
        assert!(!report.holds(), "flags were never compared");
        report.add(0, FLAGS, 0.0, "here");
        assert!(report.holds());
        report.add(0, FLAGS, 1.0, "there");
        assert!(!report.holds());
    }

    #[test]
    fn the_table_shows_the_worst_and_where() {
        let mut report = Report::new(&["sweep", "dense"], &[LENGTH, FLAGS]);
        for (case, off) in [("first", 1e-9), ("second", 3e-8), ("third", 2e-8)] {
            report.count_case();
            report.add(0, LENGTH, off, format_args!("{case} case"));
            report.add(1, LENGTH, f64::NAN, case);
        }
        let lines: Vec<String> = report.to_string().lines().map(str::to_owned).collect();
        assert_eq!(
            lines,
            [
                "3 cases; the worst deviation of each quantity, and where",
                "quantity  tolerance  sweep   where           dense  where",
                "length    1e-6 m     3.0e-8  second case     inf    first           OUT",
                "flags     exact      -       never compared  -      never compared  OUT",
                "OUT OF TOLERANCE",
            ]
        );
    }

    #[test]
    fn notes_stand_between_the_table_and_the_verdict() {
        let mut report = Report::new(&["ours"], &[LENGTH]);
        report.add(0, LENGTH, 0.0, "here");
        report.note("left out: 2 steps".to_owned());
        assert!(report.to_string().ends_with("\nleft out: 2 steps\nall within tolerance"), "{report}");
    }

    #[test]
    fn a_quantity_that_was_not_announced_counts_too() {
        let mut report = Report::new(&["ours"], &[]);
        assert!(report.holds());
        report.add(0, FLAGS, 2.0, "here");
        assert!(!report.holds());
    }

    #[test]
    fn deviations_are_taken_over_the_wanted_scale_and_lengths_must_agree() {
        assert_eq!(worst_deviation([1.0, 4.0], &[1.5, 2.0], absolute), 2.0);
        assert_eq!(worst_deviation([1.0, 4.0], &[2.0, 3.2], relative), 0.5);
        for got in [&[1.0][..], &[1.0, 2.0, 3.0], &[f64::NAN, 2.0]] {
            assert_eq!(worst_deviation(got.iter().copied(), &[1.0, 2.0], absolute), f64::INFINITY);
        }
    }
}
