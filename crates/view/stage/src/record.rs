//! Records a walk as a script.

use std::{
    fs::File,
    io::Write,
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use holo_picture::ViewSpec;

/// Least time between two recorded views. A replay of the script has to draw each view.
const EVERY: Duration = Duration::from_millis(100);

/// Writes shown views as a script's lines.
pub struct ScriptRecorder {
    file: File,
    last: Option<(Instant, String)>,
}

impl ScriptRecorder {
    /// Creates the script file. Views are added as they are shown.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path) -> Result<ScriptRecorder> {
        let file = File::create(path).with_context(|| format!("creating {}", path.display()))?;
        Ok(ScriptRecorder { file, last: None })
    }

    /// Records that `view` is shown since `now`. Writes it if the eye rests or enough time has
    /// passed.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn view(&mut self, view: &ViewSpec, now: Instant, is_at_rest: bool) -> Result<()> {
        let since = |last: &Instant| now.saturating_duration_since(*last);
        let line = holo_walk::options(view);
        if let Some((at, before)) = &self.last
            && (*before == line || (!is_at_rest && since(at) < EVERY))
        {
            return Ok(());
        }
        let seconds = self.last.as_ref().map_or(0.0, |(at, _)| since(at).as_secs_f64());
        writeln!(self.file, "{seconds:.3} view {line}").context("recording the walk")?;
        self.last = Some((now, line));
        Ok(())
    }

    /// Writes the last line, `quit`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn end(&mut self, now: Instant) -> Result<()> {
        let at = self.last.as_ref().map_or(now, |(at, _)| *at);
        let seconds = now.saturating_duration_since(at).as_secs_f64();
        writeln!(self.file, "{seconds:.3} quit").context("recording the walk")
    }
}

#[cfg(test)]
mod tests {
    use holo_script::{Command, Script};

    use super::*;

    #[test]
    fn a_recorded_walk_is_a_script() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("walk.txt");
        let start = Instant::now();
        let view = |x: f64| {
            let mut view = ViewSpec::default();
            view.apply_line(&format!("-vp {x} 0 0 -vd 0 1 0 -vu 0 0 1 -vh 60")).unwrap();
            view
        };
        let mut record = ScriptRecorder::create(&path).unwrap();
        for step in 0..100 {
            let now = start + step * Duration::from_millis(10);
            record.view(&view(f64::from(step)), now, false).unwrap();
        }
        let end = start + Duration::from_millis(1000);
        record.view(&view(99.0), end, true).unwrap();
        record.view(&view(99.0), end + Duration::from_secs(1), true).unwrap();
        record.end(end + Duration::from_secs(3)).unwrap();
        let script = Script::open(&path, &[]).unwrap();
        assert!((script.duration() - 4.0).abs() < 0.02, "{}", script.duration());
        let Script::Steps(steps) = script else { panic!("a file's steps are known") };
        let steps: Vec<_> = steps.map(|step| step.command).collect();
        assert_eq!(steps.len(), 12, "ten in the first second, where one rests, the end");
        assert_eq!(
            steps[10],
            Command::View(Box::new(ViewSpec {
                kind: Some(holo_picture::ViewKind::Perspective),
                ..view(99.0)
            }))
        );
        assert_eq!(steps[11], Command::Quit);
    }
}
