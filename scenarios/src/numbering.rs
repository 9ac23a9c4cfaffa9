//! Numbers for names: WOMD numbers tracks and map features, others name them by tokens.

use std::collections::{BTreeMap, BTreeSet};

/// Which number each name has. A name that is a number keeps it; others get the lowest that are free, in their order.
#[derive(Debug)]
pub(crate) struct Numbering {
    numbers: BTreeMap<String, i64>,
    taken: BTreeSet<i64>,
    next: i64,
    range: Range,
}

type Range = (i64, i64);

impl Numbering {
    /// Numbers of `names` from `next` on, but those that are numbers within `range` themselves.
    pub fn of(names: &[String], next: i64, range: Range) -> Self {
        let mut numbering = Self { numbers: BTreeMap::new(), taken: BTreeSet::new(), next, range };
        for name in names {
            if let Some(number) = numbering.own(name) {
                numbering.taken.insert(number);
                numbering.numbers.insert(name.clone(), number);
            }
        }
        for name in names {
            numbering.number(name);
        }
        numbering
    }

    /// The number that a name is: `007` is a name, and not the number 7.
    fn own(&self, name: &str) -> Option<i64> {
        let (least, most) = self.range;
        name.parse().ok().filter(|number: &i64| (least..=most).contains(number) && number.to_string() == name)
    }

    /// The number of `name`; a new one for a new name.
    pub fn number(&mut self, name: &str) -> i64 {
        if let Some(number) = self.numbers.get(name) {
            return *number;
        }
        let own = self.own(name).filter(|number| !self.taken.contains(number));
        let number = own.unwrap_or_else(|| {
            while self.taken.contains(&self.next) {
                self.next += 1;
            }
            self.next
        });
        self.taken.insert(number);
        self.numbers.insert(name.to_owned(), number);
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_and_tokens_get_what_is_free() {
        let names = ["AV", "0", "2", "token", "007", "4294967296"];
        let mut numbering = Numbering::of(&names.map(str::to_owned), 0, (0, i64::from(i32::MAX)));
        let numbers = names.map(|name| numbering.number(name));
        assert_eq!(numbers, [1, 0, 2, 3, 4, 5]);
        assert_eq!((numbering.number("9"), numbering.number("other")), (9, 6));
    }
}
