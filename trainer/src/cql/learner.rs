//! One step on a batch, in d3rlpy's order: alpha, critics, temperature, policy, targets.
//!
//! A batch goes in groups, each on a tape of its own; what they give is summed in their order, so that the bytes are the same for any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use super::loss::{Squashed, bellman_target, conservative_gap, uniform_log_density};
use super::networks::{CRITICS, Networks, Placed};
use super::settings::Settings;
use super::state::{Learned, State};
use crate::draw::{Draw, Purpose};
use crate::tape::{Spare, Tape, Var};
use crate::windows::Transition;

/// Transitions of a group.
const GROUP: usize = 16;
/// Alpha's most, as in d3rlpy.
const MOST_ALPHA: f64 = 1e6;

/// Transitions of one step, side by side.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// One after another.
    pub transitions: Vec<Transition>,
}

/// Random numbers of a step: for each transition and number of an action, standard normal but for `anywhere`, which is uniform in [-1, 1).
#[derive(Clone, Debug, Default)]
pub struct Noise {
    /// For the sampled actions of the policy now.
    pub now: Vec<f32>,
    /// For those of the policy a step later.
    pub next: Vec<f32>,
    /// The sampled actions anywhere.
    pub anywhere: Vec<f32>,
    /// For the action that the policy is judged by.
    pub actor: Vec<f32>,
}

impl Noise {
    /// That of step `step`.
    #[must_use]
    pub fn draw(settings: &Settings, transitions: usize, actions: usize, step: u64) -> Self {
        let mut draw = Draw::new(settings.seed, Purpose::Actions, step);
        let one = transitions * actions;
        let many = one * settings.n_action_samples;
        let mut normal = |count: usize| (0..count).map(|_| draw.normal() as f32).collect();
        let (now, next, actor) = (normal(many), normal(many), normal(one));
        Self { now, next, actor, anywhere: (0..many).map(|_| draw.within(1.0) as f32).collect() }
    }
}

/// What a step was about.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report(pub [f64; Report::NAMES.len()]);

impl Report {
    /// What each number is: both critics' mean squared Bellman errors together; the mean gap; what the conservative term adds to the critics' loss;
    /// alpha and temperature after the step; the policy's loss; the mean value of logged actions; the mean log density of the policy's.
    pub const NAMES: [&'static str; 8] =
        ["bellman", "gap", "conservative", "alpha", "temperature", "actor", "value", "log_density"];

    /// Whether all of them are numbers.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }
}

/// A group's forward pass of the critics.
struct Judged<'a> {
    tape: Tape<'a, f32>,
    /// What each critic said, of the logged action and of all sampled ones.
    values: [Var; CRITICS],
    /// Slopes of the sum of squared errors and of the gap, by the same.
    slopes: [[Vec<f64>; 2]; CRITICS],
    bellman: f64,
    gaps: [f64; CRITICS],
    logged: f64,
}

/// A group's forward pass of the policy.
struct Acted<'a> {
    tape: Tape<'a, f32>,
    outputs: [Var; 2],
    drawn: Vec<Squashed>,
    /// Slopes of the lesser critic's value by the actions.
    by_action: Vec<f32>,
    log_density: f64,
    value: f64,
}

/// Learns from a batch.
pub fn step(networks: &Networks, settings: &Settings, state: &mut State, batch: &Batch, noise: &Noise) -> Report {
    let count = batch.transitions.len() as f64;
    let groups: Vec<Range<usize>> = (0..batch.transitions.len())
        .step_by(GROUP)
        .map(|first| first..(first + GROUP).min(batch.transitions.len()))
        .collect();
    let work = Work { networks, settings, batch, noise };
    state.step += 1;

    let judged: Vec<Judged<'_>> = groups.par_iter().map(|group| work.judge(state, group.clone())).collect();
    let sum = |of: fn(&Judged<'_>) -> f64| judged.iter().map(of).sum::<f64>() / count;
    let (bellman, logged) = (sum(|group| group.bellman), sum(|group| group.logged));
    let gap = sum(|group| group.gaps.iter().sum()) / CRITICS as f64;
    let excess = settings.conservative_weight * (gap - settings.alpha_threshold);
    let (rate, number) = (settings.alpha_learning_rate, state.step);
    let mut alpha = state.alpha.clone();
    let bounded = f64::from(libm::expf(alpha.values[0]));
    alpha.step(&[if bounded < MOST_ALPHA { -bounded * excess } else { 0.0 } as f32], rate, settings, number);
    let weight = f64::from(libm::expf(alpha.values[0])).min(MOST_ALPHA);
    let gradients: Vec<Vec<f32>> = judged
        .into_par_iter()
        .map(|group| {
            let mut gradient = vec![0.0; state.critics.values.len()];
            let from = group.values.iter().zip(&group.slopes).map(|(var, [bellman, gap])| {
                let slope = |(bellman, gap): (&f64, &f64)| {
                    ((bellman + weight * settings.conservative_weight * gap) / count) as f32
                };
                (*var, bellman.iter().zip(gap).map(slope).collect())
            });
            let from = from.collect();
            group.tape.backward(from, &mut gradient);
            gradient
        })
        .collect();
    let gradient = added(gradients, state.critics.values.len());
    state.alpha = alpha;
    state.critics.step(&gradient, settings.critic_learning_rate, settings, number);

    let acted: Vec<Acted<'_>> = groups.par_iter().map(|group| work.act(state, group.clone())).collect();
    let sum = |of: fn(&Acted<'_>) -> f64| acted.iter().map(of).sum::<f64>() / count;
    let (log_density, value) = (sum(|group| group.log_density), sum(|group| group.value));
    let mut temperature = state.temperature.clone();
    let target = log_density - networks.shape.actions as f64;
    let slope = -f64::from(libm::expf(temperature.values[0])) * target;
    temperature.step(&[slope as f32], settings.temp_learning_rate, settings, number);
    let heat = f64::from(libm::expf(temperature.values[0]));
    let gradients: Vec<Vec<f32>> = acted
        .into_par_iter()
        .map(|group| {
            let mut gradient = vec![0.0; state.policy.values.len()];
            let slopes = group.drawn.iter().zip(&group.by_action).map(|(drawn, by_action)| {
                drawn.back(-f64::from(*by_action) / count, heat / count).map(|slope| slope as f32)
            });
            let (by_mean, by_spread) = slopes.map(|[mean, spread]| (mean, spread)).unzip();
            let [mean, spread] = group.outputs;
            group.tape.backward(vec![(mean, by_mean), (spread, by_spread)], &mut gradient);
            gradient
        })
        .collect();
    let gradient = added(gradients, state.policy.values.len());
    state.temperature = temperature;
    state.policy.step(&gradient, settings.actor_learning_rate, settings, number);

    let tau = settings.tau as f32;
    for (target, value) in state.targets.iter_mut().zip(&state.critics.values) {
        *target = (1.0 - tau) * *target + tau * *value;
    }
    let conservative = weight * excess * CRITICS as f64;
    Report([bellman, gap, conservative, weight, heat, heat * log_density - value, logged, log_density])
}

/// What the policy does where it sees these pictures: the middle of its actions, squashed.
#[must_use]
pub fn greedy(networks: &Networks, policy: &Learned, pictures: &[&[u8]]) -> Vec<f32> {
    let mut tape = Tape::new(None, Spare::default());
    let placed = Placed::new(&mut tape, &networks.policy, &policy.values, false);
    let seen = networks.seen(&mut tape, pictures);
    let [mean, _] = networks.act(&mut tape, &placed, seen, pictures.len());
    tape.value(mean).data.iter().map(|value| libm::tanhf(*value)).collect()
}

fn added(gradients: Vec<Vec<f32>>, count: usize) -> Vec<f32> {
    let mut sum = vec![0.0; count];
    for gradient in gradients {
        sum.iter_mut().zip(&gradient).for_each(|(sum, more)| *sum += more);
    }
    sum
}

struct Work<'w> {
    networks: &'w Networks,
    settings: &'w Settings,
    batch: &'w Batch,
    noise: &'w Noise,
}

impl Work<'_> {
    /// Both critics of logged and sampled actions.
    fn judge<'a>(&self, state: &'a State, group: Range<usize>) -> Judged<'a> {
        let (networks, count) = (self.networks, group.len());
        let (samples, actions) = (self.settings.n_action_samples, networks.shape.actions);
        let transitions = &self.batch.transitions[group.clone()];
        let mut tape = Tape::new(None, Spare::default());
        let now: Vec<&[u8]> = transitions.iter().map(|transition| &*transition.state).collect();
        let next: Vec<&[u8]> = transitions.iter().map(|transition| &*transition.next).collect();
        let [now, next] = [now, next].map(|pictures| networks.seen(&mut tape, &pictures));
        let policy = Placed::new(&mut tape, &networks.policy, &state.policy.values, false);
        let [here, there] = [now, next]
            .map(|seen| networks.act(&mut tape, &policy, seen, count).map(|var| tape.value(var).data.to_vec()));

        let best: Vec<f32> = there[0].iter().map(|mean| libm::tanhf(*mean)).collect();
        let best = tape.constant(count, actions, best);
        let targets = self.critics(&mut tape, &state.targets, false, (next, count), (best, 1));
        let targets = targets.map(|var| tape.value(var).data.to_vec());

        let each = 1 + 3 * samples;
        let mut asked = Vec::with_capacity(count * each * actions);
        let mut densities = Vec::with_capacity(count * 3 * samples);
        for (index, transition) in transitions.iter().enumerate() {
            asked.extend_from_slice(&transition.action);
            let row = |values: &[f32]| values[index * actions..][..actions].to_vec();
            let first = (group.start + index) * samples * actions;
            let noise = |all: &[f32]| all[first..first + samples * actions].to_vec();
            for ([mean, spread], noise) in [(&here, noise(&self.noise.now)), (&there, noise(&self.noise.next))] {
                let (mean, spread) = (row(mean), row(spread));
                for noise in noise.chunks_exact(actions) {
                    let drawn = drawn(&mean, &spread, noise);
                    densities.push(drawn.iter().map(|drawn| drawn.log_density).sum::<f64>());
                    asked.extend(drawn.iter().map(|drawn| drawn.action as f32));
                }
            }
            asked.extend(noise(&self.noise.anywhere));
            densities.extend((0..samples).map(|_| uniform_log_density(actions)));
        }
        let asked = tape.constant(count * each, actions, asked);
        let values = self.critics(&mut tape, &state.critics.values, true, (now, count), (asked, each));
        let mut judged = Judged {
            values,
            slopes: [const { [const { Vec::new() }; 2] }; CRITICS],
            bellman: 0.0,
            gaps: [0.0; CRITICS],
            logged: 0.0,
            tape,
        };
        for (critic, values) in values.into_iter().enumerate() {
            let said: Vec<f64> = judged.tape.value(values).data.iter().map(|value| f64::from(*value)).collect();
            for (index, (transition, said)) in transitions.iter().zip(said.chunks_exact(each)).enumerate() {
                let worth = f64::from(targets[0][index].min(targets[1][index]));
                let reward =
                    f64::from(transition.distance) + if transition.goal { self.settings.goal_bonus } else { 0.0 };
                let error = said[0] - bellman_target(reward, transition.goal, self.settings.gamma, worth);
                let mut others = said[1..].to_vec();
                let densities = &densities[index * 3 * samples..][..3 * samples];
                judged.gaps[critic] += conservative_gap(&mut others, densities, said[0]);
                judged.bellman += error * error;
                judged.logged += said[0] / CRITICS as f64;
                let [bellman, gap] = &mut judged.slopes[critic];
                bellman.push(2.0 * error);
                bellman.resize(bellman.len() + each - 1, 0.0);
                gap.push(-1.0);
                gap.extend(others);
            }
        }
        judged
    }

    /// The policy's actions, and how much the lesser of the critics' values would grow with them.
    fn act<'a>(&self, state: &'a State, group: Range<usize>) -> Acted<'a> {
        let (networks, count, actions) = (self.networks, group.len(), self.networks.shape.actions);
        let pictures: Vec<&[u8]> =
            self.batch.transitions[group.clone()].iter().map(|transition| &*transition.state).collect();
        let mut tape = Tape::new(None, Spare::default());
        let seen = networks.seen(&mut tape, &pictures);
        let policy = Placed::new(&mut tape, &networks.policy, &state.policy.values, true);
        let outputs @ [mean, spread] = networks.act(&mut tape, &policy, seen, count);
        let noise = &self.noise.actor[group.start * actions..group.end * actions];
        let drawn = drawn(&tape.value(mean).data, &tape.value(spread).data, noise);
        let told: Vec<f32> = drawn.iter().map(|drawn| drawn.action as f32).collect();

        let mut judge = Tape::new(None, Spare::default());
        let seen = networks.seen(&mut judge, &pictures);
        let asked = judge.parameter(count, actions, &told, 0..told.len());
        let values = self.critics(&mut judge, &state.critics.values, false, (seen, count), (asked, 1));
        let said = values.map(|var| judge.value(var).data.to_vec());
        let lesser: Vec<usize> = said[0].iter().zip(&said[1]).map(|(one, other)| usize::from(other < one)).collect();
        let value = lesser.iter().enumerate().map(|(index, critic)| f64::from(said[*critic][index])).sum();
        let from = values.into_iter().enumerate().map(|(critic, var)| {
            (var, lesser.iter().map(|lesser| if *lesser == critic { 1.0 } else { 0.0 }).collect())
        });
        let (from, mut by_action) = (from.collect(), vec![0.0; told.len()]);
        judge.backward(from, &mut by_action);
        let log_density = drawn.iter().map(|drawn| drawn.log_density).sum();
        Acted { tape, outputs, drawn, by_action, log_density, value }
    }

    fn critics<'a>(
        &self,
        tape: &mut Tape<'a, f32>,
        values: &'a [f32],
        learned: bool,
        seen: (Var, usize),
        asked: (Var, usize),
    ) -> [Var; CRITICS] {
        std::array::from_fn(|number| {
            let placed = Placed::new(tape, self.networks.critic(number), values, learned);
            self.networks.value(tape, &placed, seen, asked)
        })
    }
}

fn drawn(mean: &[f32], spread: &[f32], noise: &[f32]) -> Vec<Squashed> {
    let all = mean.iter().zip(spread).zip(noise);
    all.map(|((mean, spread), noise)| Squashed::draw(f64::from(*mean), f64::from(*spread), f64::from(*noise))).collect()
}
