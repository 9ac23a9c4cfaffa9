//! Vectors of our own, built in: what an implementation in Python computes of situations that it makes up
//! (`checks/planner_vectors.py`, `vectors/README.md`).

macro_rules! vectors {
    ($($name:literal),* $(,)?) => { [$(($name, include_bytes!(concat!("../../vectors/", $name, ".npz")))),*] };
}

/// Name and `.npz` file of each case.
pub(super) const CASES: [(&str, &[u8]); 7] =
    vectors!["bend", "hard-braking", "merge", "right-turn", "standstill", "u-turn", "unsolvable"];
