//! Methods and their settings.

use super::layout::{File, MethodEntry};
use crate::{cma_es, genetic, pacsa};
use fmu_import::names::suggestion;
use fmu_system::problem::Collector;
use fmu_system::spanned::Spanned;
use std::ops::RangeInclusive;

/// Largest population. Its doublings in CMA-ES do not overflow.
const MAX_POPULATION: i64 = 100_000;

/// A method and its settings.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Method {
    /// Name of the method and of its folder.
    pub name: String,
    /// Title.
    pub title: String,
    /// Title without the seed, shared by the runs of a `[[search]]` with several seeds.
    pub group: String,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Kind and settings.
    #[serde(flatten)]
    pub search: Search,
}

/// Kind of a method, and its settings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(tag = "kind", content = "settings", rename_all = "snake_case")]
pub enum Search {
    /// Parallel adaptive clonal selection.
    Pacsa(pacsa::Settings),
    /// Genetic algorithm.
    Ga(genetic::Settings),
    /// Covariance matrix adaptation.
    Cmaes(cma_es::Settings),
}

pub(super) fn methods(file: &File, problems: &mut Collector) -> Vec<Method> {
    if file.methods.is_empty() {
        problems.add(0..0, "a study needs at least one [[search]]");
    }
    let seed_of = |seed: &Spanned<i64>, problems: &mut Collector| {
        u64::try_from(*seed.get_ref()).unwrap_or_else(|_| {
            problems.add(seed.span(), format!("seed is {}, expected 0 or more", seed.get_ref()));
            0
        })
    };
    let common = file.seed.as_ref().map_or(1, |seed| seed_of(seed, problems));
    let mut methods: Vec<Method> = Vec::new();
    for entry in &file.methods {
        let mut settings = Settings { entry, known: Vec::new(), problems };
        let (title, search) = match entry.kind.as_str() {
            "pacsa" => ("PACSA", Search::Pacsa(settings.pacsa())),
            "ga" => ("GA", Search::Ga(settings.ga())),
            "cmaes" => ("CMA-ES", Search::Cmaes(settings.cmaes())),
            other => {
                let help = suggestion(other, ["pacsa", "ga", "cmaes"]);
                problems.add_with_help(
                    entry.kind.span(),
                    format!("unknown method `{other}`, expected pacsa, ga or cmaes"),
                    help,
                );
                continue;
            }
        };
        settings.finish();
        let name = entry.name.as_ref().unwrap_or(&entry.kind);
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if name.is_empty() || !name.chars().all(plain) {
            problems.add(name.span(), "the name of a method must consist of a-z, 0-9 and _");
        }
        let group = entry.title.clone().unwrap_or_else(|| title.to_string());
        let one = |seed, name: String, title: String| Method { name, title, group: group.clone(), seed, search };
        let runs = match (&entry.seed, &entry.seeds) {
            (Some(_), Some(seeds)) => {
                problems.add(seeds.span(), "a method has a seed or seeds, not both");
                continue;
            }
            (_, Some(seeds)) => {
                if seeds.is_empty() {
                    problems.add(seeds.span(), "seeds is empty");
                }
                let seeds = seeds.iter().map(|seed| seed_of(seed, problems));
                seeds
                    .map(|seed| one(seed, format!("{}_{seed}", name.get_ref()), format!("{group}, seed {seed}")))
                    .collect()
            }
            (Some(seed), None) => vec![one(seed_of(seed, problems), name.get_ref().clone(), group.clone())],
            (None, None) => vec![one(common, name.get_ref().clone(), group.clone())],
        };
        for run in runs {
            if methods.iter().any(|m| m.name == run.name) {
                problems.add(name.span(), format!("the method `{}` appears twice; give it a name", run.name));
            }
            methods.push(run);
        }
    }
    methods
}

struct Settings<'a> {
    entry: &'a MethodEntry,
    known: Vec<&'static str>,
    problems: &'a mut Collector,
}

impl Settings<'_> {
    fn number(&mut self, name: &'static str, usual: f64, range: RangeInclusive<f64>, whole: bool) -> f64 {
        self.known.push(name);
        let Some((_, written)) = self.entry.settings.iter().find(|(key, _)| key.get_ref() == name) else {
            return usual;
        };
        let value = match written.get_ref() {
            toml::Value::Integer(v) => Some(*v as f64),
            toml::Value::Float(v) if !whole => Some(*v),
            _ => None,
        };
        match value {
            Some(value) if range.contains(&value) => value,
            _ => {
                let kind = if whole { "a whole number" } else { "a number" };
                let message = format!(
                    "{name} is {}, expected {kind} from {} to {}",
                    written.get_ref(),
                    range.start(),
                    range.end()
                );
                self.problems.add(written.span(), message);
                usual
            }
        }
    }

    fn share(&mut self, name: &'static str, usual: f64) -> f64 {
        self.number(name, usual, 0.0..=1.0, false)
    }

    fn count(&mut self, name: &'static str, usual: usize, range: RangeInclusive<i64>) -> usize {
        // Whole and within the range, so the conversions are exact.
        let range = *range.start() as f64..=*range.end() as f64;
        self.number(name, usual as f64, range, true) as usize
    }

    fn generations(&mut self, usual: u32) -> u32 {
        self.number("generations", f64::from(usual), 1.0..=1e9, true) as u32
    }

    fn pacsa(&mut self) -> pacsa::Settings {
        let usual = pacsa::Settings::default();
        let population = self.count("population", usual.population, 2..=MAX_POPULATION);
        let most = population as i64;
        let updates = most as f64 - 1.0;
        let settings = pacsa::Settings {
            population,
            selected: self.count("selected", usual.selected.min(population), 1..=most),
            clone_scale: self.count("clone_scale", usual.clone_scale, 1..=MAX_POPULATION),
            most_clones: self.count("most_clones", usual.most_clones, 1..=MAX_POPULATION),
            mutation_max: self.share("mutation_max", usual.mutation_max),
            mutation_min: self.share("mutation_min", usual.mutation_min),
            updates_max: self.number("updates_max", usual.updates_max.min(updates), 1.0..=updates, false),
            updates_min: self.number("updates_min", usual.updates_min.min(updates), 0.0..=updates, false),
            generations: self.generations(usual.generations),
        };
        self.ordered(["mutation_min", "mutation_max"], [settings.mutation_min, settings.mutation_max]);
        self.ordered(["updates_min", "updates_max"], [settings.updates_min, settings.updates_max]);
        settings
    }

    fn ordered(&mut self, names: [&str; 2], [min, max]: [f64; 2]) {
        let written = names.iter().find_map(|name| self.entry.settings.iter().find(|(key, _)| key.get_ref() == name));
        if let Some((_, value)) = written.filter(|_| min > max) {
            self.problems.add(value.span(), format!("{} is {min:?}, expected at most {} {max:?}", names[0], names[1]));
        }
    }

    fn ga(&mut self) -> genetic::Settings {
        let usual = genetic::Settings::default();
        let population = self.count("population", usual.population, 2..=MAX_POPULATION);
        genetic::Settings {
            population,
            crossover: self.share("crossover", usual.crossover),
            mutation: self.share("mutation", usual.mutation),
            elite: self.count("elite", usual.elite, 0..=population as i64 - 1),
            generations: self.generations(usual.generations),
        }
    }

    fn cmaes(&mut self) -> cma_es::Settings {
        let usual = cma_es::Settings::default();
        let given = self.entry.settings.keys().any(|key| key.get_ref() == "population");
        let population = self.count("population", 2, 2..=MAX_POPULATION);
        cma_es::Settings {
            population: given.then_some(population),
            step_size: self.number("step_size", usual.step_size, 1e-6..=10.0, false),
        }
    }

    fn finish(self) {
        for key in self.entry.settings.keys().filter(|key| !self.known.contains(&key.as_str())) {
            let help = suggestion(key.get_ref(), self.known.iter().copied());
            let message = format!(
                "{} has no setting `{}`, expected one of: {}",
                self.entry.kind.get_ref(),
                key.get_ref(),
                self.known.join(", ")
            );
            self.problems.add_with_help(key.span(), message, help);
        }
    }
}
