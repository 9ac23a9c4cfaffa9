//! A comparison for programs: every number, every scene.

use serde::Serialize;

use super::comparison::Comparison;
use super::gate::Gate;

/// A comparison and its gates as JSON; `docs/compare.md` names the fields.
///
/// # Errors
/// [`serde_json::Error`], of which none is known.
pub fn render(comparison: &Comparison, gates: &[Gate]) -> Result<String, serde_json::Error> {
    #[derive(Serialize)]
    struct Told<'a> {
        #[serde(flatten)]
        comparison: &'a Comparison,
        gates: &'a [Gate],
    }
    serde_json::to_string_pretty(&Told { comparison, gates }).map(|text| text + "\n")
}
