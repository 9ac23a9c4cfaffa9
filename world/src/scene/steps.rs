//! Steps as a person writes them: `steps 3-10, 14`.

use std::fmt;

/// A set of steps, as runs: first and last of each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Steps(Vec<(usize, usize)>);

/// More runs than these are not spelled out.
const SHOWN_RUNS: usize = 6;

impl Steps {
    /// Adds a step; they come in ascending order.
    pub fn push(&mut self, step: usize) {
        match self.0.last_mut() {
            Some((_, last)) if *last + 1 >= step => *last = step,
            _ => self.0.push((step, step)),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.iter().map(|(first, last)| last + 1 - first).sum()
    }

    /// The longest run of steps in a row.
    #[must_use]
    pub fn longest_run(&self) -> usize {
        self.0.iter().map(|(first, last)| last + 1 - first).max().unwrap_or(0)
    }

    /// The first, if there is one.
    #[must_use]
    pub fn first(&self) -> Option<usize> {
        self.0.first().map(|(first, _)| *first)
    }

    /// Whether `step` is among them.
    #[must_use]
    pub fn contains(&self, step: usize) -> bool {
        self.0.iter().any(|(first, last)| (*first..=*last).contains(&step))
    }
}

impl FromIterator<usize> for Steps {
    fn from_iter<I: IntoIterator<Item = usize>>(steps: I) -> Self {
        let mut all = Self::default();
        steps.into_iter().for_each(|step| all.push(step));
        all
    }
}

impl fmt::Display for Steps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = matches!(&self.0[..], [(first, last)] if first == last);
        f.write_str(if one { "step " } else { "steps " })?;
        for (index, (first, last)) in self.0.iter().take(SHOWN_RUNS).enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            if first == last { write!(f, "{comma}{first}")? } else { write!(f, "{comma}{first}-{last}")? }
        }
        match self.0.len().saturating_sub(SHOWN_RUNS) {
            0 => Ok(()),
            more => write!(f, " and {more} more runs"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(all: &[usize]) -> String {
        all.iter().copied().collect::<Steps>().to_string()
    }

    #[test]
    fn runs_are_joined_and_long_lists_cut() {
        assert_eq!(steps(&[7]), "step 7");
        assert_eq!(steps(&[3, 4, 5, 9]), "steps 3-5, 9");
        assert_eq!(steps(&[0, 2, 4, 6, 8, 10, 12, 14]), "steps 0, 2, 4, 6, 8, 10 and 2 more runs");
    }
}
