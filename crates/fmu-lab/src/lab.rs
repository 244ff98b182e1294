//! Answers requests.

use crate::catalog::{self, Scenario};
use crate::columns::show_all;
use crate::fmus::{Fmus, name_of};
use crate::free::{Source, prepare, split};
use crate::metrics::{self, Recorded};
use crate::requests::{Driving, Failure, Request, Setup};
use crate::running::{Action, Running};
use crate::{adjust, export};
use fmu_import::description::Value;
use fmu_system::compat;
use fmu_system::plan::Plan;
use fmu_system::results;
use serde::Serialize;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};

/// The text of a response, or a failure, and the bytes of the body.
pub(crate) type Response = (Result<String, Failure>, Vec<u8>);

/// FMUs, scenarios, and the systems that run.
#[derive(Default)]
pub struct Lab {
    fmus: Fmus,
    paths: Vec<String>,
    scenarios: Vec<Scenario>,
    systems: Vec<Open>,
}

struct Open {
    plan: Plan,
    source: Source,
    running: Running,
    /// Names of the columns of the recording.
    names: Vec<String>,
}

impl Open {
    fn recorded(&self) -> Recorded<'_> {
        let Self { plan, source, running, .. } = self;
        Recorded { plan, source, simulation: &running.simulation, recording: &running.recording }
    }
}

fn json(response: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string(response).map_err(Failure::new)
}

impl Lab {
    pub(crate) fn respond(&mut self, request: &[u8], body: &[u8]) -> Response {
        let request = match serde_json::from_slice(request) {
            Ok(request) => request,
            Err(error) => return (Err(Failure::new(format!("the request cannot be read: {error}"))), Vec::new()),
        };
        let mut bytes = Vec::new();
        let response = self.answer(request, body, &mut bytes);
        (response, bytes)
    }

    fn answer(&mut self, request: Request, body: &[u8], bytes: &mut Vec<u8>) -> Result<String, Failure> {
        match request {
            Request::Start { descriptions, texts } => self.start(descriptions, texts),
            Request::Drop { name } => {
                let (name, description, module) = self.fmus.read(&name, body)?;
                *bytes = module;
                json(&json!({ "name": name, "description": description }))
            }
            Request::Add { name, description } => {
                self.fmus.add(name.clone(), description)?;
                self.fmus.dropped.push(name);
                let systems = compat::systems(&self.fmus.descriptions);
                json(&catalog::catalog(&self.fmus, &systems, &self.scenarios))
            }
            Request::Open { setup, modules } => self.open(&setup, &modules.into_iter().collect()),
            Request::Seek { time } => {
                for open in &mut self.systems {
                    open.running.seek(time)?;
                }
                // A system whose run has ended before this time stays at the end of its run.
                let times = self.systems.iter().map(|open| open.running.time());
                json(&json!({ "time": times.reduce(f64::max).unwrap_or(0.0) }))
            }
            Request::Set { system, adjustable, value } => {
                self.set(system, &adjustable, value).map(|()| "null".to_owned())
            }
            Request::Drive { driving } => self.drive(driving).map(|()| "null".to_owned()),
            Request::Metrics => json(&metrics::of(&self.systems.iter().map(Open::recorded).collect::<Vec<_>>())),
            Request::Csv { system } => {
                let open = self.system(system)?;
                results::push_csv(bytes, &open.names, &open.running.recording).map_err(Failure::new)?;
                json(&format!("{}.csv", open.plan.name))
            }
            Request::Ssp { system } => {
                let open = self.system(system)?;
                let (name, file) = export::ssp(&open.plan, &open.running, &self.fmus)?;
                *bytes = file;
                json(&name)
            }
            Request::Describe { fmu } => self.describe(&fmu),
        }
    }

    fn start(
        &mut self,
        descriptions: BTreeMap<String, String>,
        texts: BTreeMap<String, String>,
    ) -> Result<String, Failure> {
        for (name, text) in descriptions {
            self.fmus.add(name, text)?;
        }
        let is_scenario = |path: &&String| {
            path.starts_with("scenarios/") && path.ends_with(".toml") && path.matches('/').count() == 1
        };
        self.paths = texts.keys().filter(is_scenario).cloned().collect();
        #[cfg(target_family = "wasm")]
        for (path, text) in texts {
            fmu_import::limits::provide(path, text);
        }
        let systems = compat::systems(&self.fmus.descriptions);
        self.scenarios = catalog::scenarios(&self.paths, &self.fmus, &systems);
        json(&catalog::catalog(&self.fmus, &systems, &self.scenarios))
    }

    fn open(&mut self, setup: &Setup, modules: &BTreeSet<String>) -> Result<String, Failure> {
        let prepared = prepare(setup, &self.fmus, &self.scenarios)?;
        let components = || prepared.iter().flat_map(|system| &system.run.components);
        let needed: BTreeSet<String> = components().map(|component| name_of(&component.fmu).to_owned()).collect();
        let missing: Vec<String> = needed.difference(modules).cloned().collect();
        if !missing.is_empty() {
            return json(&json!({ "missing": missing }));
        }
        self.systems.clear();
        let first = prepared.first().ok_or_else(|| Failure::new("the setup has no system"))?;
        let (simulation, cones) = (first.simulation, first.cones.clone());
        let mut infos = Vec::new();
        for (index, mut system) in prepared.into_iter().enumerate() {
            let shown = show_all(&mut system.run, &self.fmus, &system.plant);
            let mut names: Vec<String> = system.plan.columns.iter().map(|column| column.name.clone()).collect();
            // A scenario defines its own columns. A maneuver records the signals of the vehicle and the driver only, so
            // the signals of the controllers are appended.
            if !matches!(system.source, Source::Scenario { .. }) {
                for one in &shown {
                    if !system.run.columns.contains(&Some(one.slot)) {
                        system.run.columns.push(Some(one.slot));
                        names.push(one.column.name.clone());
                    }
                }
            }
            let is_driven = system.driver.is_some();
            let components = system.run.components.iter();
            let speed = system.driver.as_ref().and_then(|driver| driver.slider());
            infos.push(json!({
                "title": system.title,
                "vehicle": system.vehicle,
                "components": components
                    .map(|component| json!({ "name": component.name, "fmu": name_of(&component.fmu) }))
                    .collect::<Vec<_>>(),
                "columns": shown.iter().map(|shown| &shown.column).collect::<Vec<_>>(),
                "adjustables": speed.into_iter().chain(adjust::of_run(&system.run, &self.fmus)).collect::<Vec<_>>(),
            }));
            let descriptions = &self.fmus.descriptions;
            let mut running = Running::new(index, &system.simulation, system.run, shown, system.driver, descriptions)?;
            running.ends_rolled_over = !matches!(system.source, Source::Scenario { .. });
            if is_driven {
                running.act(Action::Drive(Driving::default()))?;
            }
            self.systems.push(Open { plan: system.plan, source: system.source, running, names });
        }
        let row_every = self.systems.first().map_or(1, |open| open.running.row_every);
        let origin = needed.iter().filter_map(|name| {
            let description = self.fmus.descriptions.get(name)?;
            let version = description.version.as_deref().unwrap_or_default();
            Some(json!({ "fmu": name, "version": version, "guid": description.guid }))
        });
        let middle =
            |[begin, end, right, left]: &[f64; 4]| [[*begin, 0.5 * (right + left)], [*end, 0.5 * (right + left)]];
        json(&json!({
            "step": simulation.step,
            "stop": simulation.stop,
            "rowStep": simulation.step * row_every as f64,
            "systems": infos,
            "path": cones.iter().flat_map(middle).collect::<Vec<_>>(),
            "cones": cones,
            "origin": origin.collect::<Vec<_>>(),
        }))
    }

    fn system(&self, index: usize) -> Result<&Open, Failure> {
        self.systems.get(index).ok_or_else(|| Failure::new(format!("there is no system {index}")))
    }

    fn set(&mut self, system: Option<usize>, id: &str, value: f64) -> Result<(), Failure> {
        let (name, variable) = split(id)?;
        let mut is_found = false;
        for (index, open) in self.systems.iter_mut().enumerate() {
            let component = open.running.run.components.iter().find(|component| component.name == name);
            let Some(component) = component.filter(|_| system.is_none_or(|wanted| wanted == index)) else { continue };
            is_found = true;
            let variables = adjust::variables(component, variable);
            open.running.act(Action::Set { component: name.to_owned(), variables, value })?;
        }
        if is_found { Ok(()) } else { Err(Failure::new(format!("no system has `{id}`"))) }
    }

    fn drive(&mut self, driving: Driving) -> Result<(), Failure> {
        self.systems.iter_mut().try_for_each(|open| open.running.act(Action::Drive(driving)))
    }

    fn describe(&self, fmu: &str) -> Result<String, Failure> {
        let description = self.fmus.descriptions.get(fmu);
        let description = description.ok_or_else(|| Failure::new(format!("there is no FMU {fmu}")))?;
        let variables: Vec<_> = description
            .variables
            .iter()
            .map(|variable| {
                json!({
                    "name": variable.name,
                    "causality": format!("{:?}", variable.causality).to_lowercase(),
                    "unit": variable.unit.as_deref().unwrap_or_default(),
                    "start": variable.start.as_ref().map_or(String::new(), Value::text),
                    "description": variable.description.as_deref().unwrap_or_default(),
                })
            })
            .collect();
        json(&variables)
    }

    /// Advances a system; -1 if it has failed.
    pub(crate) fn advance(&mut self, system: usize, steps: u32) -> i32 {
        let done = self.systems.get_mut(system).and_then(|open| open.running.advance(steps));
        done.and_then(|done| i32::try_from(done).ok()).unwrap_or(-1)
    }

    pub(crate) fn time(&self, system: usize) -> f64 {
        self.systems.get(system).map_or(f64::NAN, |open| open.running.time())
    }

    pub(crate) fn rows(&self, system: usize) -> (usize, &[f64]) {
        self.systems.get(system).map_or((0, &[]), |open| open.running.rows())
    }

    pub(crate) fn rows_read(&mut self, system: usize) {
        if let Some(open) = self.systems.get_mut(system) {
            open.running.rows_read();
        }
    }

    pub(crate) fn fail(&mut self, system: usize, message: &str) {
        if let Some(open) = self.systems.get_mut(system) {
            open.running.fail(message);
        }
    }

    /// Returns the reason why a system cannot continue, as JSON.
    pub(crate) fn failure(&self, system: usize) -> String {
        let stopped = self.systems.get(system).and_then(|open| open.running.stopped.clone());
        stopped.map_or("null".to_owned(), |stopped| {
            json!({ "time": stopped.time, "component": stopped.component, "message": stopped.message }).to_string()
        })
    }
}
