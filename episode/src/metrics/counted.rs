//! Which steps of a drive its metrics are made of.

/// All steps of a drive, or some of them. What is felt is still filtered over the whole drive: a step that is left out says nothing, but
/// those beside it are what they were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted<'a>(Option<&'a [bool]>);

impl<'a> Counted<'a> {
    /// Every step.
    pub const ALL: Self = Self(None);

    /// The steps whose flag is set; those beyond the flags count.
    #[must_use]
    pub fn only(flags: &'a [bool]) -> Self {
        Self(Some(flags))
    }

    /// Whether no step is left out.
    #[must_use]
    pub fn is_all(self) -> bool {
        self.0.is_none_or(|flags| !flags.contains(&false))
    }

    /// Whether a step counts.
    #[must_use]
    pub fn has(self, step: usize) -> bool {
        self.0.is_none_or(|flags| flags.get(step).copied().unwrap_or(true))
    }

    /// What there is of the steps that count, where there is something of each; `first` is the step of the first.
    pub fn of<T>(self, first: usize, steps: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
        steps.into_iter().enumerate().filter(move |(index, _)| self.has(first + index)).map(|(_, value)| value)
    }
}
