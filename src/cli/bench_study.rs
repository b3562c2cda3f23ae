//! `antumbra bench --study`: the tables of a file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::bench::{self, BenchArgs, BenchError};
use super::error::CliError;
use super::print_text;
use super::progress::Progress;
use crate::batch::scene_file::scenes_in;
use crate::bench::study::{self, Measured, Part, Study, Table};
use crate::bench::{Job, group, report};
use crate::capture::output::Output;

/// A part of a table, ready to be measured.
struct Work {
    /// Index of the table.
    table: usize,
    part: Part,
    blank: Job,
    jobs: Vec<Job>,
}

/// Lights of scenes that have been read, by index and name.
#[derive(Default)]
struct Lights(HashMap<PathBuf, Vec<(usize, String)>>);

impl Lights {
    fn of(&mut self, scene: &Path) -> Result<&[(usize, String)], CliError> {
        if !self.0.contains_key(scene) {
            let lights = group::lights(scene, None).map_err(CliError::Scene)?;
            self.0.insert(scene.into(), lights);
        }
        Ok(self.0.get(scene).map_or(&[], Vec::as_slice))
    }
}

/// Reads the file and all its scenes, then measures table by table. The page is written anew after
/// each part, so that it shows what there is.
pub(super) fn run(args: &BenchArgs, file: &Path) -> Result<(), CliError> {
    let study = Study::read(file).map_err(BenchError::from)?;
    let out = args.out.clone().unwrap_or_default();
    let mut lights = Lights::default();
    let mut all = Vec::new();
    for (at, table) in study.tables.iter().enumerate() {
        all.extend(works(args, file, at, table, &out, &mut lights)?);
    }
    bench::create(&out)?;
    let page = Output::File(out.join("study.md"));
    page.check()?;

    let mut measured: Vec<Vec<Measured>> = vec![Vec::new(); study.tables.len()];
    let progress = Progress::new(all.iter().map(|work| work.jobs.len() as u64).sum());
    for work in all {
        let folder = work.blank.out.clone();
        bench::create(&folder.join("images"))?;
        let mut session = bench::open(args, &work.blank, &folder)?;
        bench::measure(&mut session, &work.jobs, &progress)?;
        let results = session.results().clone();
        let html = Output::File(folder.join("report.html"));
        html.write(report::page(&results, &folder).as_bytes())?;
        let part = work.part;
        measured[work.table].push(Measured { part, results });
        page.write(study::page(&study, &measured).as_bytes())?;
    }
    drop(progress);
    print_text(&format!("{page}\n"))?;
    bench::write_table(args, measured.iter().flatten().map(|one| &one.results))?;
    let results = measured.iter().flatten().map(|measured| &measured.results);
    bench::judge(results, out.join("study.md"))
}

fn works(
    args: &BenchArgs,
    file: &Path,
    at: usize,
    table: &Table,
    out: &Path,
    lights: &mut Lights,
) -> Result<Vec<Work>, CliError> {
    let mut cells: Vec<(PathBuf, usize, String)> = Vec::new();
    for given in &table.scenes {
        for scene in scenes_in(&joined(file, given))? {
            if cells.iter().any(|(other, ..)| *other == scene) {
                continue;
            }
            let all = lights.of(&scene)?;
            let is_asked = |name: &String| table.light.as_ref().is_none_or(|light| light == name);
            let asked: Vec<_> = all.iter().filter(|(_, name)| is_asked(name)).collect();
            if asked.is_empty() {
                let have: Vec<&str> = all.iter().map(|(_, name)| name.as_str()).collect();
                return Err(BenchError::NoLight {
                    path: file.into(),
                    table: table.name.clone(),
                    scene: scene.display().to_string(),
                    light: table.light.clone().unwrap_or_default(),
                    have: have.join(", "),
                }
                .into());
            }
            let asked = asked.into_iter();
            cells.extend(asked.map(|(index, name)| (scene.clone(), *index, name.clone())));
        }
    }
    let labels: Vec<String> = (table.contenders().into_iter())
        .map(|contender| contender.label)
        .collect();
    let mut parts = table.parts();
    if let Some(size) = args.size {
        parts.iter_mut().for_each(|part| part.size = size.0);
        let mut kept: Vec<Part> = Vec::new();
        parts.retain(|part| {
            let is_new = !kept.contains(part);
            kept.push(*part);
            is_new
        });
    }
    let samples = args.samples.unwrap_or(table.samples);
    let works = parts.into_iter().map(|part| {
        let folder = out.join(&table.name).join(part.folder());
        let (size, scale) = (part.size, part.light_scale);
        let blank = bench::blank_job(args, labels.clone(), size, samples, scale, &folder);
        let job = |(scene, light, name): &(PathBuf, usize, String)| Job {
            scene: scene.clone(),
            light: *light,
            light_name: name.clone(),
            ..blank.clone()
        };
        let jobs = cells.iter().map(job).collect();
        Work {
            table: at,
            part,
            blank,
            jobs,
        }
    });
    Ok(works.collect())
}

/// A path from the folder of the file, with as few `..` as there can be: it is shown in results.
fn joined(file: &Path, given: &str) -> PathBuf {
    let mut folder = file.parent().unwrap_or(Path::new("")).to_path_buf();
    let mut rest = Path::new(given);
    while let Ok(after) = rest.strip_prefix("..") {
        let is_plain = folder.file_name().is_some() && !folder.is_symlink();
        if !is_plain {
            break;
        }
        folder.pop();
        rest = after;
    }
    folder.join(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_named_from_the_folder_of_the_file() {
        for (file, given, wanted) in [
            ("benches/studies/a.toml", "../../assets", "assets"),
            ("a.toml", "x.glb", "x.glb"),
            ("s/a.toml", "../../x.glb", "../x.glb"),
            ("../s/a.toml", "../../x.glb", "../../x.glb"),
            ("s/a.toml", "/x.glb", "/x.glb"),
        ] {
            assert_eq!(
                joined(Path::new(file), given),
                Path::new(wanted),
                "{file} {given}"
            );
        }
    }
}
