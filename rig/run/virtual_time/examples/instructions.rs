//! Does one part of a cycle as often as it is told, so that `scripts/instructions` can count its instructions:
//! `instructions PART CALLS`. What comes before the calls is the same for every number of them.
//!
//! Plant and controller first play a run together. Then one of them repeats its side of it alone.

use std::env;
use std::hint::black_box;

use anyhow::{bail, ensure};
use masseter_controller::kinematics::ForwardTracker;
use masseter_controller::motion_controller::MotionController;
use masseter_plan::RunPlan;
use masseter_plant::PlantError;
use masseter_plant::core::PlantCore;
use masseter_runtime::control::{Controller, Tick};
use masseter_runtime::lockstep::EPOCH_NS;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Message, Reading, State};
use masseter_runtime::realtime::Wake;
use masseter_scenario::Scenario;

/// Cycles of the motion, one a call.
const CYCLES: usize = 500;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = env::args().collect();
    let [_, part, calls] = &arguments[..] else { bail!("usage: instructions PART CALLS") };
    let calls: usize = calls.parse()?;
    ensure!(calls <= CYCLES, "the motion is prepared for {CYCLES} calls; use fewer");

    let plan = RunPlan::new(Scenario::default())?;
    let poses = (0..CYCLES).map(|cycle| plan.trajectory.pose_in_motion(cycle as f64 * 1e-3));
    match &part[..] {
        "inverse kinematics" => {
            let poses: Vec<_> = poses.collect();
            for pose in &poses[..calls] {
                black_box(plan.mechanism.inverse(black_box(pose))?);
            }
        }
        "forward kinematics" => {
            let joints: Vec<_> = poses.map(|pose| plan.mechanism.inverse(&pose)).collect::<Result<_, _>>()?;
            let mut tracker = ForwardTracker::new(plan.mechanism.clone());
            for joints in &joints[..calls] {
                black_box(tracker.update(black_box(&joints.actuators))?);
            }
        }
        "plant step" => {
            let (start, motion) = play(&plan)?;
            let mut plant = PlantCore::new(&plan.scenario, EPOCH_NS)?;
            for cycle in start.iter().chain(&motion[..calls]) {
                black_box(plant_step(&mut plant, &plan, cycle.sync, |_| cycle.command)?);
            }
        }
        "controller cycle" => {
            let (start, motion) = play(&plan)?;
            let mut controller = new_controller(&plan);
            for cycle in start.iter().chain(&motion[..calls]) {
                black_box(controller_cycle(&mut controller, &plan, cycle.sync, &cycle.reading));
            }
        }
        _ => bail!("no part '{part}'"),
    }
    Ok(())
}

/// What plant and controller exchanged in a cycle.
struct Played {
    sync: Wake,
    reading: Reading,
    command: Command,
}

/// The cycles of a run until the motion, and those of the motion.
fn play(plan: &RunPlan) -> anyhow::Result<(Vec<Played>, Vec<Played>)> {
    let mut plant = PlantCore::new(&plan.scenario, EPOCH_NS)?;
    let mut controller = new_controller(plan);
    let (mut start, mut motion) = (Vec::new(), Vec::new());
    let mut cycle = 0;
    while motion.len() < CYCLES {
        cycle += 1;
        let sync = Wake::on_time(cycle, EPOCH_NS + (cycle - 1) * plan.scenario.period_ns());
        let answer = |reading: &Reading| controller_cycle(&mut controller, plan, sync, reading);
        let played = plant_step(&mut plant, plan, sync, answer)?;
        ensure!(controller.outcome().is_none(), "the controller ended in cycle {cycle}");
        let is_moving = controller.state() == ControllerState::Running;
        if is_moving { &mut motion } else { &mut start }.push(played);
    }
    Ok((start, motion))
}

fn new_controller(plan: &RunPlan) -> MotionController {
    MotionController::new(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone())
}

/// Master, wires, drives and mechanism, from SYNC to the last frame.
fn plant_step(
    plant: &mut PlantCore,
    plan: &RunPlan,
    sync: Wake,
    answer: impl FnOnce(&Reading) -> Command,
) -> Result<Played, PlantError> {
    let read_ns = sync.woke_ns + plan.schedule.reading_by_ns;
    let mut reading = Reading::default();
    plant.begin_cycle(sync)?;
    plant.collect(read_ns)?;
    plant.fill_reading(&mut reading);
    reading.stamp(sync.cycle, read_ns);
    black_box((plant.truth(), plant.contact()));
    let command = answer(&reading);
    plant.apply(command.published_ns, Some(&command))?;
    plant.drain_frames().for_each(|frame| {
        black_box(frame);
    });
    plant.drain_events(&mut |event| {
        black_box(event);
    });
    Ok(Played { sync, reading, command })
}

fn controller_cycle(
    controller: &mut MotionController,
    plan: &RunPlan,
    sync: Wake,
    reading: &Reading,
) -> Command {
    let now_ns = sync.woke_ns + plan.schedule.controller_at_ns;
    let (mut command, mut state) = (Command::default(), State::default());
    controller.observe(Some(reading));
    controller.decide(Tick { cycle: sync.cycle, now_ns });
    controller.fill_command(&mut command);
    command.stamp(sync.cycle, now_ns);
    controller.fill_state(&mut state);
    black_box(state);
    command
}
