//! An episode: a run of a scenario that begins with its motion, goes on step by step, and ends with the motion or a safe stop.

use anyhow::{bail, ensure};
use masseter_judge::{EventRecord, Watch, requirements::check_requirements};
use masseter_plan::{RunPlan, read_scenario_with, set_keys};
use masseter_runtime::{control::Controller, messages::codes::ControllerState};
use masseter_virtual_time::{Run, RunSnapshot};

use crate::agent::{ActionKind, Agent, Exchange, Exchanged};

/// What all episodes of an environment have in common.
#[derive(Debug, Clone)]
pub(crate) struct Settings {
    pub(crate) scenario: Option<std::path::PathBuf>,
    /// Each `KEY=VALUE`.
    pub(crate) set: Vec<String>,
    pub(crate) kind: ActionKind,
    /// Names of signals.
    pub(crate) observe: Vec<String>,
    pub(crate) reward: Reward<String>,
    pub(crate) cycles_per_step: u32,
}

/// What the reward of a step is, by names or by places.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Reward<N> {
    None,
    /// The mean of a signal over the cycles of the step, with this sign.
    Signal(N, f64),
    /// The margin of a requirement so far.
    Requirement(N),
}

/// Why no step follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Over {
    SafeStop,
    /// The motion is over, or was stopped in order.
    Motion,
    /// A step was left in the middle.
    Broken,
}

/// What a step came to, beside the observation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step {
    pub(crate) reward: f64,
    pub(crate) over: Option<Over>,
}

pub(crate) struct Episode {
    kind: ActionKind,
    cycles_per_step: u32,
    exchange: Exchange,
    run: Run<Watch>,
    has_detour: bool,
    places: Vec<usize>,
    reward: Reward<usize>,
    now: Now,
}

/// What changes in a step, beside the run.
#[derive(Debug, Clone)]
struct Now {
    /// The values of the observed signals; one without a value keeps the last one.
    observed: Vec<f64>,
    reward: f64,
    over: Option<Over>,
}

/// An instant of an episode, to go back to.
pub(crate) struct Branch {
    run: RunSnapshot<Watch>,
    exchange: Exchange,
    exchanged: Exchanged,
    now: Now,
}

/// The plan of an episode.
pub(crate) fn plan(settings: &Settings, set: &[String], seed: Option<u64>) -> anyhow::Result<RunPlan> {
    let set = [&settings.set, set].concat();
    let scenario = read_scenario_with(settings.scenario.as_deref(), |scenario| {
        set_keys(scenario, None, &set)?;
        scenario.seed = seed.unwrap_or(scenario.seed);
        Ok(())
    })?;
    ensure!(
        scenario.can.is_virtual(),
        "the scenario has the interfaces {}; an environment has simulated buses: leave can.interfaces out",
        scenario.can.interfaces.join(", ")
    );
    settings.kind.check(&scenario)?;
    RunPlan::new(scenario)
}

impl Episode {
    /// Before the first cycle.
    pub(crate) fn new(settings: &Settings, plan: &RunPlan, exchange: Exchange) -> anyhow::Result<Self> {
        let agent = Agent::new(plan, settings.kind, exchange.clone());
        let declared = agent.declared();
        check_requirements(&plan.scenario, Some(&declared))?;
        let mut watch = Watch::new(&plan.scenario, &declared);
        let places: Vec<_> =
            settings.observe.iter().map(|name| watch.choose(name)).collect::<Result<_, _>>()?;
        let reward = match &settings.reward {
            Reward::None => Reward::None,
            Reward::Signal(name, sign) => Reward::Signal(watch.choose(name)?, *sign),
            Reward::Requirement(name) => Reward::Requirement(watch.requirement(name)?),
        };
        Ok(Self {
            kind: settings.kind,
            cycles_per_step: settings.cycles_per_step,
            exchange,
            run: Run::with_controller(plan, Box::new(agent), watch)?,
            has_detour: plan.scenario.force_control.is_some(),
            now: Now { observed: vec![0.0; places.len()], reward: 0.0, over: None },
            places,
            reward,
        })
    }

    /// Plays until the motion runs, and begins the cycle of the first action.
    pub(crate) fn begin(&mut self, go_on: &mut dyn FnMut() -> anyhow::Result<()>) -> anyhow::Result<()> {
        while self.exchange.get().state != ControllerState::Running {
            go_on()?;
            self.run.play_cycle()?;
            if matches!(self.exchange.get().state, ControllerState::SafeStop | ControllerState::Finished) {
                let events = self.take_events();
                bail!("the motion never began: {}", events.last().map_or("the rig stopped", String::as_str));
            }
        }
        self.run.begin_cycle()?;
        self.look();
        self.take_events();
        Ok(())
    }

    /// Plays the cycles of a step with an action; fewer if the motion ends.
    pub(crate) fn step(
        &mut self,
        action: &[f64],
        go_on: &mut dyn FnMut() -> anyhow::Result<()>,
    ) -> anyhow::Result<Step> {
        self.exchange.act(self.kind, action)?;
        self.now.over = Some(Over::Broken);
        let (mut sum, mut cycles) = (0.0, 0.0);
        let mut over = None;
        while over.is_none() && cycles < f64::from(self.cycles_per_step) {
            go_on()?;
            self.run.play_cycle()?;
            over = match self.exchange.get().state {
                ControllerState::Running => None,
                ControllerState::SafeStop => Some(Over::SafeStop),
                _ => Some(Over::Motion),
            };
            self.run.begin_cycle()?;
            cycles += 1.0;
            if let Reward::Signal(..) = self.reward {
                self.look();
                sum += self.now.reward;
            }
        }
        let reward = match self.reward {
            Reward::Signal(..) => sum / cycles,
            Reward::None | Reward::Requirement(_) => {
                self.look();
                self.now.reward
            }
        };
        self.now.over = over;
        Ok(Step { reward, over })
    }

    /// Takes the values of this cycle.
    fn look(&mut self) {
        // The controller alone knows the detour of a force control, and has stated the last cycle's.
        let desired = self.exchange.get().demand.filter(|_| !self.has_detour).map(|demand| demand.desired);
        let watch = self.run.sink_mut();
        let values = watch.values(desired);
        for (observed, place) in self.now.observed.iter_mut().zip(&self.places) {
            if values[*place].is_finite() {
                *observed = values[*place];
            }
        }
        self.now.reward = match self.reward {
            Reward::None => 0.0,
            Reward::Signal(place, sign) if values[place].is_finite() => sign * values[place],
            Reward::Signal(..) => self.now.reward,
            Reward::Requirement(place) => watch.margin(place).unwrap_or(0.0),
        };
    }

    pub(crate) fn observed(&self) -> &[f64] {
        &self.now.observed
    }

    pub(crate) fn over(&self) -> Option<Over> {
        self.now.over
    }

    pub(crate) fn exchanged(&self) -> Exchanged {
        self.exchange.get()
    }

    /// What happened since the last call, a line each.
    pub(crate) fn take_events(&mut self) -> Vec<String> {
        self.run.sink_mut().take_events().iter().map(line).collect()
    }

    pub(crate) fn branch(&self) -> anyhow::Result<Branch> {
        let run = self.run.snapshot()?;
        let (exchange, exchanged) = (self.exchange.clone(), self.exchange.get());
        Ok(Branch { run, exchange, exchanged, now: self.now.clone() })
    }

    pub(crate) fn restore(&mut self, branch: &Branch) -> anyhow::Result<()> {
        ensure!(
            self.exchange.is_of(&branch.exchange),
            "the snapshot is of another environment; take it from this one"
        );
        self.run.restore(&branch.run)?;
        self.exchange.set(&branch.exchanged);
        self.now.clone_from(&branch.now);
        Ok(())
    }
}

fn line(event: &EventRecord) -> String {
    let axis = event.axis.map_or_else(String::new, |axis| format!(" {axis}"));
    let text = event.text.as_deref().map_or_else(String::new, |text| format!(": {text}"));
    format!("{} {}: {}{axis}{text}", event.source, event.kind, event.cause)
}
