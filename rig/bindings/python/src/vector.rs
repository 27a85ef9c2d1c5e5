//! Environments side by side, on threads that run without the interpreter. A run stays on its thread, and orders pass by channels.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::{sync::Arc, thread, time::Duration};

use anyhow::bail;
use bytemuck::cast_slice;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::env::{Arguments, raised};
use crate::episode::{self, Episode, Over, Settings};
use crate::{agent::Exchange, failed, floats};

/// Time between two looks at Ctrl-C.
const POLL: Duration = Duration::from_millis(20);

enum Order {
    /// The first environment of the thread gets this seed, each other one the next.
    Reset(u64),
    /// The actions of all of them.
    Step(Vec<f64>),
}

/// What the environments of a thread came to, in their order.
#[derive(Default)]
struct Rows {
    observed: Vec<f64>,
    rewards: Vec<f64>,
    terminated: Vec<bool>,
    truncated: Vec<bool>,
    events: Vec<Vec<String>>,
}

/// An environment that begins the next episode by itself, in the step after the last one.
struct Lane {
    exchange: Exchange,
    seed: u64,
    episode: Option<Episode>,
}

impl Lane {
    fn reset(&mut self, settings: &Settings, seed: u64, stop: &AtomicBool) -> anyhow::Result<&mut Episode> {
        self.episode = None;
        let plan = episode::plan(settings, &[], Some(seed))?;
        self.exchange.clear();
        let mut episode = Episode::new(settings, &plan, self.exchange.clone())?;
        episode.begin(&mut || unless_stopped(stop))?;
        self.seed = seed;
        Ok(self.episode.insert(episode))
    }
}

fn unless_stopped(stop: &AtomicBool) -> anyhow::Result<()> {
    if stop.load(Relaxed) {
        bail!("the environments were interrupted; call reset");
    }
    Ok(())
}

/// A thread with its environments.
struct Worker {
    orders: Sender<Order>,
    replies: Receiver<anyhow::Result<Rows>>,
    lanes: usize,
}

impl Worker {
    /// `all` is the number of environments on all threads.
    fn start(settings: Settings, lanes: usize, all: usize, stop: Arc<AtomicBool>) -> Self {
        let ((orders, orders_in), (replies_out, replies)) = (channel(), channel());
        thread::spawn(move || {
            let lane = || Lane { exchange: Exchange::new(), seed: 0, episode: None };
            let mut lanes: Vec<_> = std::iter::repeat_with(lane).take(lanes).collect();
            while let Ok(order) = orders_in.recv() {
                let rows = match order {
                    Order::Reset(seed) => reset(&mut lanes, &settings, seed, &stop),
                    Order::Step(actions) => step(&mut lanes, &settings, &actions, all, &stop),
                };
                if replies_out.send(rows).is_err() {
                    break;
                }
            }
        });
        Self { orders, replies, lanes }
    }
}

fn reset(lanes: &mut [Lane], settings: &Settings, seed: u64, stop: &AtomicBool) -> anyhow::Result<Rows> {
    let mut rows = Rows::default();
    for (place, lane) in lanes.iter_mut().enumerate() {
        let episode = lane.reset(settings, seed.wrapping_add(place as u64), stop)?;
        rows.observed.extend(episode.observed());
    }
    Ok(rows)
}

fn step(
    lanes: &mut [Lane],
    settings: &Settings,
    actions: &[f64],
    all: usize,
    stop: &AtomicBool,
) -> anyhow::Result<Rows> {
    let mut rows = Rows::default();
    let numbers = actions.len() / lanes.len().max(1);
    for (lane, action) in lanes.iter_mut().zip(actions.chunks_exact(numbers.max(1))) {
        let next_seed = lane.seed.wrapping_add(all as u64);
        let (episode, reward, over) = match lane.episode.take() {
            Some(mut episode) if episode.over().is_none() => {
                let step = episode.step(action, &mut || unless_stopped(stop));
                // What is refused leaves the episode as it was.
                let episode = lane.episode.insert(episode);
                let step = step?;
                (episode, step.reward, step.over)
            }
            Some(_) => (lane.reset(settings, next_seed, stop)?, 0.0, None),
            None => bail!("the environments were not reset; call reset first"),
        };
        rows.observed.extend(episode.observed());
        rows.rewards.push(reward);
        rows.terminated.push(over == Some(Over::SafeStop));
        rows.truncated.push(over == Some(Over::Motion));
        rows.events.push(episode.take_events());
    }
    Ok(rows)
}

#[pyclass(unsendable)]
pub(crate) struct VectorEnv {
    workers: Vec<Worker>,
    stop: Arc<AtomicBool>,
}

/// Observations and rewards; which episodes were terminated, and which truncated; and what happened in each.
type StepsOfPython<'py> = (Bound<'py, PyBytes>, Bound<'py, PyBytes>, Vec<bool>, Vec<bool>, Vec<Vec<String>>);

#[pymethods]
impl VectorEnv {
    #[new]
    fn new(arguments: Arguments, number: usize, threads: usize) -> PyResult<Self> {
        let settings = Settings::try_from(arguments)?;
        let stop = Arc::new(AtomicBool::new(false));
        let workers = (0..threads).map(|thread| {
            let lanes = number / threads + usize::from(thread < number % threads);
            Worker::start(settings.clone(), lanes, number, stop.clone())
        });
        Ok(Self { workers: workers.collect(), stop })
    }

    /// Begins an episode in each environment; returns the first observations.
    fn reset<'py>(&mut self, py: Python<'py>, seed: u64) -> PyResult<Bound<'py, PyBytes>> {
        let mut next = seed;
        for worker in &self.workers {
            worker.orders.send(Order::Reset(next)).map_err(gone)?;
            next = next.wrapping_add(worker.lanes as u64);
        }
        let rows = self.collect(py)?;
        Ok(PyBytes::new(py, cast_slice(&rows.observed)))
    }

    fn step<'py>(&mut self, py: Python<'py>, actions: &[u8], numbers: usize) -> PyResult<StepsOfPython<'py>> {
        let actions = floats(actions);
        let mut rest = actions.as_slice();
        for worker in &self.workers {
            let (own, others) = rest
                .split_at_checked(worker.lanes * numbers)
                .ok_or_else(|| failed("there are fewer actions than environments"))?;
            worker.orders.send(Order::Step(own.to_vec())).map_err(gone)?;
            rest = others;
        }
        let rows = self.collect(py)?;
        let (observed, rewards) = (cast_slice(&rows.observed), cast_slice(&rows.rewards));
        let (observed, rewards) = (PyBytes::new(py, observed), PyBytes::new(py, rewards));
        Ok((observed, rewards, rows.terminated, rows.truncated, rows.events))
    }
}

impl VectorEnv {
    /// The replies of all threads, of which each has an order. After Ctrl-C they end between two cycles.
    fn collect(&mut self, py: Python<'_>) -> PyResult<Rows> {
        let (mut all, mut error) = (Rows::default(), None);
        for Worker { replies, .. } in &mut self.workers {
            let reply = loop {
                let waiting = &mut *replies;
                match py.detach(move || waiting.recv_timeout(POLL)) {
                    Ok(reply) => break reply,
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(interrupt) = py.check_signals() {
                            self.stop.store(true, Relaxed);
                            error = Some(interrupt);
                        }
                    }
                    Err(RecvTimeoutError::Disconnected) => return Err(gone(())),
                }
            };
            match reply {
                Ok(rows) => {
                    all.observed.extend(rows.observed);
                    all.rewards.extend(rows.rewards);
                    all.terminated.extend(rows.terminated);
                    all.truncated.extend(rows.truncated);
                    all.events.extend(rows.events);
                }
                Err(refused) => {
                    error.get_or_insert_with(|| raised(refused));
                }
            }
        }
        self.stop.store(false, Relaxed);
        error.map_or(Ok(all), Err)
    }
}

fn gone<T>(_: T) -> PyErr {
    failed("a thread of the environments has ended: a fault of Masseter itself")
}
