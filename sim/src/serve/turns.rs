//! Whose turn it is: pure.
//!
//! Runs take turns by client, not by when they were asked for: next comes the client of whom the fewest runs are being driven, of these the one who
//! has waited longest since a run of theirs began, and of theirs the run that was asked for first. So who submits a hundred runs delays
//! another's by one, and not by a hundred. What was begun before the service was last stopped goes on before anything new begins; nothing
//! that is being driven is stopped for another.

use std::collections::BTreeMap;

/// A run that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waiting<'a> {
    /// Its name.
    pub name: &'a str,
    /// Whose it is.
    pub client: &'a str,
    /// When it was asked for, in order.
    pub order: u64,
    /// Whether some of it was driven before.
    pub begun: bool,
}

/// Who was served.
#[derive(Debug, Default)]
pub struct Turns {
    /// How many runs had begun when a client's last one did.
    last: BTreeMap<String, u64>,
    begun: u64,
}

impl Turns {
    /// All that wait, in the order in which they are to begin if nothing else happens; `driven` are the clients of the runs that are being driven.
    #[must_use]
    pub fn order<'a>(&self, waiting: &[Waiting<'a>], driven: &[&str]) -> Vec<Waiting<'a>> {
        let mut left = waiting.to_vec();
        let mut turns = Self { last: self.last.clone(), begun: self.begun };
        let mut of_client: BTreeMap<&str, usize> = BTreeMap::new();
        driven.iter().for_each(|client| *of_client.entry(client).or_default() += 1);
        let mut order = Vec::with_capacity(left.len());
        while let Some(place) = turns.next(&left, &of_client) {
            let next = left.swap_remove(place);
            turns.begin(next.client);
            *of_client.entry(next.client).or_default() += 1;
            order.push(next);
        }
        order
    }

    fn next(&self, waiting: &[Waiting<'_>], driven: &BTreeMap<&str, usize>) -> Option<usize> {
        let rank = |run: &Waiting<'_>| {
            let of_client = driven.get(run.client).copied().unwrap_or_default();
            (!run.begun, of_client, self.last.get(run.client).copied(), run.order)
        };
        (0..waiting.len()).min_by_key(|place| rank(&waiting[*place]))
    }

    /// Notes that a run of `client` begins.
    pub fn begin(&mut self, client: &str) {
        self.begun += 1;
        self.last.insert(client.to_owned(), self.begun);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NAMES: [&str; 12] = ["r0", "r1", "r2", "r3", "r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11"];

    fn waiting<'a>(clients: &[&'a str]) -> Vec<Waiting<'a>> {
        let run = |(at, client): (usize, &&'a str)| Waiting { name: NAMES[at], client, order: at as u64, begun: false };
        clients.iter().enumerate().map(run).collect()
    }

    fn names<'a>(order: &[Waiting<'a>]) -> Vec<&'a str> {
        order.iter().map(|run| run.name).collect()
    }

    #[test]
    fn clients_take_turns_however_many_runs_one_has_asked_for() {
        let turns = Turns::default();
        let runs = waiting(&["a", "a", "a", "a", "b", "c"]);
        assert_eq!(names(&turns.order(&runs, &[])), ["r0", "r4", "r5", "r1", "r2", "r3"]);
        assert_eq!(names(&turns.order(&runs, &["a"])), ["r4", "r5", "r0", "r1", "r2", "r3"]);
    }

    #[test]
    fn who_was_served_waits_until_others_were() {
        let mut turns = Turns::default();
        turns.begin("a");
        assert_eq!(names(&turns.order(&waiting(&["a", "b"]), &[])), ["r1", "r0"]);
        turns.begin("b");
        assert_eq!(names(&turns.order(&waiting(&["a", "b"]), &[])), ["r0", "r1"]);
    }

    #[test]
    fn what_was_begun_goes_on_first() {
        let mut runs = waiting(&["a", "b", "a"]);
        runs[2].begun = true;
        assert_eq!(names(&Turns::default().order(&runs, &[])), ["r2", "r1", "r0"]);
    }

    proptest! {
        /// While both have runs waiting, nobody begins two more than another.
        #[test]
        fn nobody_is_passed_over(clients in prop::collection::vec(prop::sample::select(vec!["a", "b", "c"]), 1..12)) {
            let runs = waiting(&clients);
            let order = Turns::default().order(&runs, &[]);
            prop_assert_eq!(order.len(), runs.len());
            for end in 0..order.len() {
                let begun = |client: &str| order[..=end].iter().filter(|run| run.client == client).count();
                let left = |client: &str| order[end + 1..].iter().any(|run| run.client == client);
                let of_those_who_wait: Vec<usize> = ["a", "b", "c"].into_iter().filter(|client| left(client)).map(begun).collect();
                if let (Some(most), Some(fewest)) = (of_those_who_wait.iter().max(), of_those_who_wait.iter().min()) {
                    prop_assert!(most - fewest <= 1);
                }
            }
            // Of one client, in the order in which they were asked for.
            for client in ["a", "b", "c"] {
                let orders: Vec<u64> = order.iter().filter(|run| run.client == client).map(|run| run.order).collect();
                prop_assert!(orders.is_sorted());
            }
        }
    }
}
