//! All jobs, one after the other: what is done is kept, and a job that dies takes only the cell
//! with it that was at work.

use std::path::{Path, PathBuf};

use super::contender::Contender;
use super::group::{GroupResult, Job, blank_entry};
use super::results::{Entry, FailedCell, Failure, FailureKind, Results, ResultsError, Settings};

/// How running a job ended.
#[derive(Debug)]
pub enum Outcome {
    /// With a result.
    Done(Box<GroupResult>),
    /// With an error that concerns all of it.
    Failed(String),
    /// The process died.
    Died {
        /// The contender that was at work, if any had begun.
        label: Option<String>,
        /// How.
        reason: String,
    },
}

/// Results that grow, in a folder.
#[derive(Debug)]
pub struct Session {
    out: PathBuf,
    results: Results,
}

impl Session {
    /// Begins with nothing; a file of earlier results is replaced once the first job is done.
    pub fn new(out: impl Into<PathBuf>, settings: Settings) -> Self {
        Self {
            out: out.into(),
            results: Results::new(settings),
        }
    }

    /// Goes on with the results in the folder, if there are any.
    ///
    /// # Errors
    /// They cannot be read, or were measured with other settings.
    pub fn resume(out: impl Into<PathBuf>, settings: Settings) -> Result<Self, ResultsError> {
        let mut session = Self::new(out, settings);
        let path = session.file();
        if !path.exists() {
            return Ok(session);
        }
        let kept = Results::read(&path)?;
        let what = difference(&kept.settings, &session.results.settings);
        if let Some(what) = what {
            return Err(ResultsError::Settings { path, what });
        }
        session.results.driver = kept.driver;
        session.results.references = kept.references;
        session.results.images = kept.images;
        session.results.failures = kept.failures;
        Ok(session)
    }

    /// `results.json`.
    pub fn file(&self) -> PathBuf {
        self.out.join("results.json")
    }

    /// The folder of the results.
    pub fn folder(&self) -> &Path {
        &self.out
    }

    /// What there is so far.
    pub fn results(&self) -> &Results {
        &self.results
    }

    /// Whether every cell of the job has its entry, a failure or not.
    pub fn is_done(&self, job: &Job) -> bool {
        let entries = || self.results.images.iter().filter(|entry| is_of(entry, job));
        (job.contenders.iter()).all(|label| entries().any(|entry| entry.label == *label))
    }

    /// Runs all jobs that are not done, and writes the results after each. `run_job` may be called
    /// again with a job that died, then with the cells that it died of marked as dead.
    ///
    /// # Errors
    /// The results cannot be written.
    pub fn run(
        &mut self,
        jobs: &[Job],
        run_job: &mut dyn FnMut(&Job) -> Outcome,
    ) -> Result<(), ResultsError> {
        for job in jobs {
            if !self.is_done(job) {
                let group = run_until_done(job, run_job);
                self.merge(job, group, jobs);
                self.results.write(&self.file())?;
            }
        }
        // Also where everything was done before.
        self.results.write(&self.file())
    }

    fn merge(&mut self, job: &Job, group: Result<GroupResult, Failure>, jobs: &[Job]) {
        let results = &mut self.results;
        results.images.retain(|entry| !is_of(entry, job));
        let scene = job.scene.display().to_string();
        (results.references).retain(|other| other.scene != scene || other.light_index != job.light);
        match group {
            Ok(group) => {
                results.references.push(group.reference);
                results.images.extend(group.entries);
            }
            Err(failure) => {
                let contenders = job.contenders.iter().filter_map(|label| label.parse().ok());
                results
                    .images
                    .extend(contenders.map(|contender: Contender| Entry {
                        failure: Some(failure.clone()),
                        ..blank_entry(job, &contender)
                    }));
            }
        }
        let place = |scene: &str, light: usize| {
            let same = |job: &Job| job.light == light && job.scene.display().to_string() == scene;
            jobs.iter().position(same)
        };
        (results.images).sort_by_key(|entry| place(&entry.scene, entry.light_index));
        (results.references).sort_by_key(|entry| place(&entry.scene, entry.light_index));
        if results.driver.is_none() {
            results.driver = results.images.iter().find_map(|entry| entry.driver.clone());
        }
        let failed = results.images.iter().filter_map(|entry| {
            Some(FailedCell {
                scene: entry.scene.clone(),
                light: entry.light.clone(),
                light_index: entry.light_index,
                label: entry.label.clone(),
                failure: entry.failure.clone()?,
            })
        });
        results.failures = failed.collect();
    }
}

fn is_of(entry: &Entry, job: &Job) -> bool {
    entry.light_index == job.light && entry.scene == job.scene.display().to_string()
}

/// Runs a job again and again without the cells that it died of.
fn run_until_done(
    job: &Job,
    run_job: &mut dyn FnMut(&Job) -> Outcome,
) -> Result<GroupResult, Failure> {
    let mut job = job.clone();
    loop {
        match run_job(&job) {
            Outcome::Done(group) => return Ok(*group),
            Outcome::Failed(reason) => {
                return Err(Failure {
                    kind: FailureKind::Failed,
                    reason,
                });
            }
            Outcome::Died { label, reason } => {
                let failure = Failure {
                    kind: FailureKind::Crashed,
                    reason,
                };
                let is_new = |label: &String| {
                    job.contenders.contains(label) && job.dead.iter().all(|(dead, _)| dead != label)
                };
                match label.filter(is_new) {
                    Some(label) => job.dead.push((label, failure)),
                    None => return Err(failure),
                }
            }
        }
    }
}

/// What differs between settings that should be the same.
pub(super) fn difference(kept: &Settings, asked: &Settings) -> Option<String> {
    let size = |s: &Settings| format!("{}x{}", s.width, s.height);
    let pairs = [
        (
            "techniques",
            kept.techniques.join(";"),
            asked.techniques.join(";"),
        ),
        ("size", size(kept), size(asked)),
        ("repeat", kept.repeat.to_string(), asked.repeat.to_string()),
        (
            "samples",
            kept.samples.to_string(),
            asked.samples.to_string(),
        ),
        (
            "cell seconds",
            kept.cell_seconds.to_string(),
            asked.cell_seconds.to_string(),
        ),
        (
            "device",
            format!("{:?}", kept.device),
            format!("{:?}", asked.device),
        ),
        (
            "light scale",
            kept.light_scale.to_string(),
            asked.light_scale.to_string(),
        ),
    ];
    let differing = pairs.into_iter().find(|(_, kept, asked)| kept != asked);
    differing.map(|(what, kept, asked)| format!("{what} {kept}, not {asked}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::results::ReferenceEntry;

    fn settings() -> Settings {
        Settings {
            techniques: vec!["hard".into(), "rays:4".into()],
            width: 8,
            height: 8,
            repeat: 1,
            samples: 16,
            cell_seconds: 1.0,
            device: None,
            light_scale: 1.0,
        }
    }

    fn job(out: &Path, scene: &str) -> Job {
        Job {
            scene: scene.into(),
            case: None,
            light: 0,
            light_name: "lamp".into(),
            light_scale: 1.0,
            camera: None,
            contenders: settings().techniques,
            size: [8, 8],
            repeat: 1,
            samples: 16,
            cell_seconds: 1.0,
            device: None,
            out: out.into(),
            dead: Vec::new(),
        }
    }

    fn done(job: &Job) -> Outcome {
        let contenders = job.contenders.iter().filter_map(|label| label.parse().ok());
        let entries = contenders.map(|contender: Contender| {
            let dead = job.dead.iter().find(|(label, _)| *label == contender.label);
            Entry {
                failure: dead.map(|(_, failure)| failure.clone()),
                ..blank_entry(job, &contender)
            }
        });
        let entries = entries.collect();
        let reference = ReferenceEntry {
            scene: job.scene.display().to_string(),
            light: job.light_name.clone(),
            light_index: job.light,
            light_shape: "point".into(),
            width: 8,
            height: 8,
            samples: 16,
            standard_error: None,
            valid_pixels: 0,
            penumbra_pixels: 0,
            rays: 0,
            cast_ms: None,
            image: String::new(),
            valid_image: String::new(),
            case: None,
        };
        Outcome::Done(Box::new(GroupResult { reference, entries }))
    }

    type Done = Result<(), Box<dyn std::error::Error>>;

    #[test]
    fn an_interrupted_run_goes_on_where_it_was() -> Done {
        let folder = tempfile::tempdir()?;
        let out = folder.path();
        let jobs = [job(out, "b.gltf"), job(out, "a.gltf")];
        let mut ran = Vec::new();
        let mut session = Session::resume(out, settings())?;
        session.run(&jobs[1..], &mut |job| {
            ran.push(job.scene.clone());
            done(job)
        })?;
        let mut session = Session::resume(out, settings())?;
        assert!(session.is_done(&jobs[1]) && !session.is_done(&jobs[0]));
        session.run(&jobs, &mut |job| {
            ran.push(job.scene.clone());
            done(job)
        })?;
        assert_eq!(ran, ["a.gltf", "b.gltf"].map(PathBuf::from));
        // In the order of the jobs, whenever they ran.
        let results = Results::read(&session.file())?;
        let scenes: Vec<&str> = results.images.iter().map(|e| e.scene.as_str()).collect();
        assert_eq!(scenes, ["b.gltf", "b.gltf", "a.gltf", "a.gltf"]);
        assert_eq!(&results, session.results());

        // Without resuming all is measured anew.
        let mut count = 0;
        Session::new(out, settings()).run(&jobs, &mut |job| {
            count += 1;
            done(job)
        })?;
        assert_eq!(count, 2);
        let other = Settings {
            samples: 32,
            ..settings()
        };
        let error = Session::resume(out, other).err().map(|e| e.to_string());
        let error = error.unwrap_or_default();
        assert!(error.contains("samples 16, not 32"), "{error}");
        std::fs::write(out.join("results.json"), "{\"schema\": 2}")?;
        let error = Session::resume(out, settings())
            .err()
            .map(|e| e.to_string());
        assert!(error.unwrap_or_default().contains("schema 2"));
        Ok(())
    }

    #[test]
    fn a_crash_is_recorded_in_its_cell_and_the_rest_goes_on() -> Done {
        let folder = tempfile::tempdir()?;
        let out = folder.path();
        let jobs = [job(out, "a.gltf"), job(out, "b.gltf"), job(out, "c.gltf")];
        let mut calls = 0;
        let mut session = Session::new(out, settings());
        session.run(&jobs, &mut |job| {
            calls += 1;
            let died = |label: Option<&str>| Outcome::Died {
                label: label.map(String::from),
                reason: "signal 11".into(),
            };
            match (job.scene.to_str(), job.dead.len()) {
                (Some("a.gltf"), 0) => died(Some("hard")),
                // Before any cell, and in one that was not to run: nothing left to leave out.
                (Some("b.gltf"), _) => died(None),
                _ => done(job),
            }
        })?;
        assert_eq!(calls, 4);
        let results = session.results();
        assert_eq!(results.images.len(), 6);
        let failures = results.failures.iter();
        let failed: Vec<(&str, &str)> = failures.map(|f| (&*f.scene, &*f.label)).collect();
        let wanted = [("a.gltf", "hard"), ("b.gltf", "hard"), ("b.gltf", "rays:4")];
        assert_eq!(failed, wanted);
        let failure = &results.failures[0].failure;
        assert_eq!(
            (failure.kind, &*failure.reason),
            (FailureKind::Crashed, "signal 11")
        );
        assert_eq!(results.references.len(), 2);
        Ok(())
    }
}
