//! Each step, in Parquet.

use std::path::Path;

use results::columns::Columns;
use results::parquet::{self, ParquetError};

use super::{Checked, Figures, Step};

/// Writes the steps of all episodes of these runs under `path`.
///
/// # Errors
/// [`ParquetError`] where the disk fails.
pub fn write(path: &Path, runs: &[Figures]) -> Result<(), ParquetError> {
    let batch = |run: &str, driver: &str, scene: &str, checked: &Checked| {
        let steps = &checked.steps;
        let mut table = Columns::default();
        table.text("run", steps.iter().map(|_| run));
        table.text("driver", steps.iter().map(|_| driver));
        table.text("scene", steps.iter().map(|_| scene));
        table.count("step", steps.iter().map(|step| step.step));
        table.count("log_index", steps.iter().map(|step| step.log_index));
        table.flag("must_react", steps.iter().map(|step| !step.is_valid()));
        table.flag("drives_through", steps.iter().map(Step::is_driven_through));
        table.count("reacted", steps.iter().map(|step| step.reacted));
        let tracks = |step: &Step| step.reacting.iter().map(|agent| agent.track.to_string()).collect::<Vec<_>>();
        table.text("tracks", steps.iter().map(|step| tracks(step).join(" ")));
        let least = |step: &Step| step.reacting.iter().map(|agent| agent.time).reduce(f64::min);
        table.maybe("least_time_s", steps.iter().map(least));
        table.maybe("from_log_m", steps.iter().map(|step| step.from_log));
        table.maybe("from_path_m", steps.iter().map(|step| step.from_path));
        table.batch()
    };
    let nothing = Checked { steps: Vec::new(), without: Vec::new() };
    let schema = batch("", "", "", &nothing)?.schema();
    let batches = runs.iter().flat_map(|run| {
        let folder = run.folder.display().to_string();
        run.driven().map(move |(scene, checked)| Ok(batch(&folder, &run.driver, scene, checked)?))
    });
    parquet::write(path, schema, batches)
}
