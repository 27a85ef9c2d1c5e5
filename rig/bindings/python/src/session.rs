//! A controller of the drives in Python: its part in a run, cycle by cycle. Messages cross as the bytes of their structures.

use std::{cell::RefCell, time::Duration};

use masseter_runtime::control::{self, Outcome, Tick, Waited};
use masseter_runtime::lifecycle::attach::attach;
use masseter_runtime::messages::{Command, Event, Message, State};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::law::{ParameterOfPython, SignalOfPython, declared};
use crate::{failed, not_attached, robot::RobotModel};

/// A part in a run. It belongs to the thread that made it.
#[pyclass(unsendable)]
pub(crate) struct Session {
    stage: Option<Stage>,
}

enum Stage {
    Attached(Box<masseter_runtime::lifecycle::ProcessContext>, masseter_runtime::named::Declared),
    Started(Box<control::Session>),
}

thread_local! {
    /// The session of this thread that waits without the interpreter. Only what may pass to other threads can be lent to such
    /// a wait, and a session may not.
    static WAITING: RefCell<Option<Stage>> = const { RefCell::new(None) };
}

type CycleOfPython<'py> = (u64, u64, Option<Bound<'py, PyBytes>>);

#[pymethods]
impl Session {
    #[new]
    fn new(
        rig: Option<&str>,
        signals: Vec<SignalOfPython>,
        parameters: Vec<ParameterOfPython>,
        has_own_motion: bool,
    ) -> PyResult<Self> {
        let declared = declared(signals, parameters, has_own_motion)?;
        let context = attach(rig).map_err(not_attached)?;
        Ok(Self { stage: Some(Stage::Attached(Box::new(context), declared)) })
    }

    fn start(&mut self, py: Python<'_>) -> PyResult<()> {
        self.detached(py, |stage| match stage.take() {
            Some(Stage::Attached(context, declared)) => {
                let session = control::Session::start(*context, declared).map_err(failed)?;
                *stage = Some(Stage::Started(Box::new(session)));
                Ok(())
            }
            other => {
                *stage = other;
                Err(failed("the session is started already, or over"))
            }
        })
    }

    #[getter]
    fn period_s(&self) -> PyResult<f64> {
        Ok(self.played()?.period_s())
    }

    /// The scenario as TOML.
    fn scenario(&self) -> PyResult<String> {
        Ok(self.played()?.to_toml())
    }

    fn robot(&self) -> PyResult<RobotModel> {
        RobotModel::of(self.played()?)
    }

    #[getter]
    fn is_stop_requested(&self) -> bool {
        match &self.stage {
            Some(Stage::Attached(context, _)) => context.stop.is_made(),
            Some(Stage::Started(session)) => session.is_stop_requested(),
            None => true,
        }
    }

    fn wait<'py>(&mut self, py: Python<'py>, timeout_s: Option<f64>) -> PyResult<Option<CycleOfPython<'py>>> {
        let timeout = timeout_s.map(Duration::try_from_secs_f64).transpose().map_err(failed)?;
        py.check_signals()?;
        let wait = |stage: &mut Option<Stage>| started(stage)?.wait(timeout).map_err(failed);
        let waited = match timeout {
            // A mere look is over before the interpreter would be given away.
            Some(Duration::ZERO) => wait(&mut self.stage),
            _ => self.detached(py, wait),
        };
        Ok(match waited? {
            Waited::TimedOut => None,
            Waited::Cycle { tick: Tick { cycle, now_ns }, reading } => {
                Some((cycle, now_ns, reading.map(|reading| PyBytes::new(py, reading.body()))))
            }
        })
    }

    fn parameters(&mut self) -> PyResult<Vec<f64>> {
        Ok(started(&mut self.stage)?.parameters().to_vec())
    }

    fn publish(&mut self, command: &[u8], state: &[u8], signals: Vec<f64>) -> PyResult<()> {
        let (command, state) = (message::<Command>(command)?, message::<State>(state)?);
        let session = started(&mut self.stage)?;
        session.signals_mut().iter_mut().zip(signals).for_each(|(place, value)| *place = value);
        session.publish(&command, &state).map_err(failed)
    }

    fn publish_event(&mut self, event: &[u8]) -> PyResult<()> {
        let event = message::<Event>(event)?;
        started(&mut self.stage)?.publish_event(&event).map_err(failed)
    }

    fn finish(&mut self, is_safe_stop: bool) -> PyResult<()> {
        let outcome = if is_safe_stop { Outcome::SafeStop } else { Outcome::Finished };
        self.end()?.finish(outcome).map_err(failed)
    }

    fn fail(&mut self, reason: &str) -> PyResult<()> {
        self.end()?.fail(reason).map_err(failed)
    }
}

impl Session {
    /// Calls `work` while other threads of Python run.
    fn detached<T: Send>(&mut self, py: Python<'_>, work: impl FnOnce(&mut Option<Stage>) -> T + Send) -> T {
        WAITING.set(self.stage.take());
        let result = py.detach(|| WAITING.with_borrow_mut(work));
        self.stage = WAITING.take();
        result
    }

    /// The scenario of the run.
    fn played(&self) -> PyResult<&masseter_scenario::Scenario> {
        Ok(match self.stage.as_ref().ok_or_else(over)? {
            Stage::Attached(context, _) => &context.scenario,
            Stage::Started(session) => &session.context().scenario,
        })
    }

    fn end(&mut self) -> PyResult<control::Session> {
        started(&mut self.stage)?;
        match self.stage.take() {
            Some(Stage::Started(session)) => Ok(*session),
            _ => Err(over()),
        }
    }
}

fn started(stage: &mut Option<Stage>) -> PyResult<&mut control::Session> {
    match stage {
        Some(Stage::Started(session)) => Ok(session),
        Some(Stage::Attached(..)) => Err(failed("the session is not started: call start first")),
        None => Err(over()),
    }
}

fn over() -> PyErr {
    failed("the session is over")
}

fn message<M: Message>(bytes: &[u8]) -> PyResult<M> {
    M::from_body(bytes).ok_or_else(|| failed(format!("{} bytes are no {}", bytes.len(), M::TYPE_NAME)))
}
