//! The environment of Python: one episode after the other on the caller's thread. Numbers cross as the bytes of 64-bit floats.

use bytemuck::cast_slice;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::agent::{ActionKind, Exchange};
use crate::episode::{self, Branch, Episode, Over, Reward, Settings};
use crate::{failed, floats, law};

/// An error at the border: an exception of Python that came this far stays itself.
pub(crate) fn raised(error: anyhow::Error) -> PyErr {
    error.downcast::<PyErr>().unwrap_or_else(|error| failed(format!("{error:#}")))
}

/// What an environment is made of, as Python gives it.
#[derive(FromPyObject)]
pub(crate) struct Arguments {
    scenario: Option<std::path::PathBuf>,
    set: Vec<String>,
    action: String,
    observe: Vec<String>,
    reward: Option<(String, f64)>,
    requirement: Option<String>,
    cycles_per_step: u32,
}

impl TryFrom<Arguments> for Settings {
    type Error = PyErr;

    fn try_from(arguments: Arguments) -> PyResult<Self> {
        let Arguments { scenario, set, action, observe, reward, requirement, cycles_per_step } = arguments;
        if cycles_per_step == 0 {
            return Err(PyValueError::new_err("cycles_per_step is 0; use 1 or more"));
        }
        let reward = match (reward, requirement) {
            (None, None) => Reward::None,
            (Some((name, sign)), None) => Reward::Signal(name, sign),
            (None, Some(name)) => Reward::Requirement(name),
            (Some(_), Some(_)) => {
                return Err(PyValueError::new_err("give a reward or a requirement, not both"));
            }
        };
        let kind = ActionKind::named(&action).map_err(raised)?;
        Ok(Self { scenario, set, kind, observe, reward, cycles_per_step })
    }
}

/// Reward; whether the episode was terminated, and whether truncated; and what happened.
type StepOfPython<'py> = (Bound<'py, PyBytes>, f64, bool, bool, Vec<String>);

/// Where an episode began, to begin it again without its start.
struct Start {
    seed: Option<u64>,
    set: Vec<String>,
    branch: Branch,
}

#[pyclass(unsendable)]
pub(crate) struct Env {
    settings: Settings,
    exchange: Exchange,
    bounds: Vec<[f64; 2]>,
    seed: u64,
    period_s: f64,
    episode: Option<Episode>,
    start: Option<Start>,
}

/// An instant of an episode.
#[pyclass(unsendable, frozen)]
pub(crate) struct Snapshot(Branch);

#[pymethods]
impl Env {
    #[new]
    fn new(arguments: Arguments) -> PyResult<Self> {
        let settings = Settings::try_from(arguments)?;
        let plan = episode::plan(&settings, &[], None).map_err(raised)?;
        let exchange = Exchange::new();
        // Wrong names show before the first reset.
        Episode::new(&settings, &plan, exchange.clone()).map_err(raised)?;
        let (bounds, seed, period_s) =
            (settings.kind.bounds(&plan), plan.scenario.seed, plan.scenario.period_s());
        Ok(Self { settings, exchange, bounds, seed, period_s, episode: None, start: None })
    }

    /// The least and the largest values of an action.
    #[getter]
    fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        self.bounds.iter().map(|[low, high]| (*low, *high)).unzip()
    }

    #[getter]
    fn period_s(&self) -> f64 {
        self.period_s
    }

    /// The scenario's.
    #[getter]
    fn seed(&self) -> u64 {
        self.seed
    }

    /// Begins an episode; returns the first observation.
    fn reset<'py>(
        &mut self,
        py: Python<'py>,
        seed: Option<u64>,
        set: Vec<String>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        match (&self.start, &mut self.episode) {
            (Some(start), Some(episode)) if start.seed == seed && start.set == set => {
                episode.restore(&start.branch).map_err(raised)?;
            }
            _ => {
                // An episode without its start is none.
                (self.start, self.episode) = (None, None);
                self.begin(py, seed, set).map_err(raised)?;
            }
        }
        self.observed(py)
    }

    fn step<'py>(&mut self, py: Python<'py>, action: &[u8]) -> PyResult<StepOfPython<'py>> {
        let episode = self.episode.as_mut().ok_or_else(not_begun)?;
        let step = episode.step(&floats(action), &mut || Ok(py.check_signals()?)).map_err(raised)?;
        let observed = PyBytes::new(py, cast_slice(episode.observed()));
        let (is_terminated, is_truncated) =
            (step.over == Some(Over::SafeStop), step.over == Some(Over::Motion));
        Ok((observed, step.reward, is_terminated, is_truncated, episode.take_events()))
    }

    /// Why no step follows; None where one does.
    #[getter]
    fn over(&self) -> Option<&'static str> {
        match &self.episode {
            None => Some("the environment was not reset"),
            Some(episode) => episode.over().map(|over| match over {
                Over::SafeStop => "the controller stopped safely",
                Over::Motion => "the motion is over",
                Over::Broken => "a step was left in the middle",
            }),
        }
    }

    /// The last observation.
    fn observed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let episode = self.episode.as_ref().ok_or_else(not_begun)?;
        Ok(PyBytes::new(py, cast_slice(episode.observed())))
    }

    /// What a pose law would get in this cycle; None once the jaw does not move.
    fn demand(&self, py: Python<'_>) -> PyResult<Option<law::Demand>> {
        let episode = self.episode.as_ref().ok_or_else(not_begun)?;
        let demand = episode.exchanged().demand;
        Ok(demand.map(|demand| law::Demand::new(py, &demand, PyDict::new(py), PyDict::new(py).unbind())))
    }

    fn snapshot(&self) -> PyResult<Snapshot> {
        let episode = self.episode.as_ref().ok_or_else(not_begun)?;
        episode.branch().map(Snapshot).map_err(raised)
    }

    fn restore(&mut self, snapshot: &Snapshot) -> PyResult<()> {
        self.episode.as_mut().ok_or_else(not_begun)?.restore(&snapshot.0).map_err(raised)
    }
}

impl Env {
    fn begin(&mut self, py: Python<'_>, seed: Option<u64>, set: Vec<String>) -> anyhow::Result<()> {
        let plan = episode::plan(&self.settings, &set, seed)?;
        self.exchange.clear();
        let mut episode = Episode::new(&self.settings, &plan, self.exchange.clone())?;
        episode.begin(&mut || Ok(py.check_signals()?))?;
        self.start = Some(Start { seed, set, branch: episode.branch()? });
        self.episode = Some(episode);
        Ok(())
    }
}

fn not_begun() -> PyErr {
    failed("the environment was not reset; call reset first")
}
