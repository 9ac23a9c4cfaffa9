//! A planner of one's own: along the reference line, no faster than the limit, and to a halt behind whoever is in the way.
use std::sync::Arc;

use clap::Parser;
use wire::node::{NodeError, Options, Planner, StepInput, serve_planner};
use world::{observation::Briefing, plan::PlanState, plan::UncheckedPlan};

fn follow_the_line(step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
    let (seen, window) = (step.observation, &step.observation.window);
    let (here, _) = window.nearest(seen.av.position()).ok_or("there is no line")?;
    let agents = seen.agents.iter().filter_map(|agent| window.nearest(agent.state.position()));
    let ahead = agents.filter(|(at, aside)| *at > here && *aside < 2.5).map(|(at, _)| at).min();
    let room = ahead.map_or(100.0, |at| 0.1 * (at - here) as f64 - 10.0); // metres to stop in
    let goal = (2.0 * 1.2 * room.max(0.0)).sqrt().min(window.speed_limit_at(here).max(5.0));
    let (mut driven, mut speed) = (0.0, seen.av.speed());
    let state = |_| {
        speed += (goal - speed).clamp(-0.4, 0.15); // m/s in 0.1 s
        driven += 0.1 * speed;
        let pose = window.line.pose((here + (10.0 * driven) as usize).min(window.line.len() - 1));
        PlanState { x: pose.x, y: pose.y, heading: pose.heading, speed }
    };
    Ok(UncheckedPlan { step: seen.step, states: (0..50).map(state).collect(), ..Default::default() })
}

fn main() -> Result<(), NodeError> {
    let start = |_: &Briefing| Ok(Box::new(follow_the_line) as Box<dyn Planner>);
    serve_planner(&Options::parse(), Arc::new(start)).map(drop)
}
