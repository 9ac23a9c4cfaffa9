//! What is asked of traffic alone: that bodies move as bodies can, and that nobody jumps when he is taken over.

use world::traffic::{Change, Moves, Taken};

use super::answers::{Answer, Driven};
use super::course::Course;
use super::rule::{Finding, Rule};

/// Who is farther (m) than this from where his speeds lead, at the step at which he is taken over, jumps.
const JUMP: f64 = 0.1;

/// Nobody brakes harder (m/s in a step) the moment he is taken over: 7.5 m/s^2.
const JOLT: f64 = 0.75;

/// Nobody turns by more (rad) in that step.
const SWERVE: f64 = 0.1;

/// Of courses that were driven to their end, how often agents were moved: the bounds of the sim hold for every move, or there were none.
#[must_use]
pub fn moves(driven: &[(&Course, Driven)]) -> Finding {
    let counts = answered(driven).map(|(_, _, moves)| moves.moves().len());
    let seen = format!("{} moves, each from where it was to where a body can be", counts.sum::<usize>());
    Finding::holds(Rule::Moves, seen)
}

/// Whether agents that are taken over go on as they were logged.
#[must_use]
pub fn hand_over(driven: &[(&Course, Driven)]) -> Finding {
    let (mut count, mut jumps, mut worst) = (0_usize, 0_usize, [0.0_f64; 3]);
    for (step, taken, moves) in answered(driven) {
        for (agent, moved) in taken.iter().zip(moves.moves()).filter(|(agent, _)| agent.since_step == step) {
            let Change { astray, speed, turn, .. } = Change::between(&agent.state, &moved.state);
            count += 1;
            jumps += usize::from(astray > JUMP || speed > JOLT || turn > SWERVE);
            worst = [worst[0].max(astray), worst[1].max(speed), worst[2].max(turn)];
        }
    }
    let [astray, speed, turn] = worst;
    let most = format!("{astray:.2} m, {speed:.2} m/s and {turn:.3} rad at most");
    match jumps {
        0 => Finding::holds(Rule::HandOver, format!("{count} agents are taken over, and none jumps: {most}")),
        _ if 2 * jumps > count => Finding::broken(Rule::HandOver, jumped(jumps, count, &most)),
        _ => Finding::doubtful(Rule::HandOver, jumped(jumps, count, &most)),
    }
}

fn jumped(jumps: usize, count: usize, most: &str) -> String {
    format!("{jumps} of {count} agents jump when they are taken over, by {most}")
}

/// Each step with who was taken over then, and the answer.
fn answered<'a>(driven: &'a [(&Course, Driven)]) -> impl Iterator<Item = (u32, &'a [Taken], &'a Moves)> {
    driven.iter().flat_map(|(course, driven)| {
        let asked = course.steps.iter().zip(&course.taken).zip(&driven.answers);
        asked.filter_map(|(((observation, _), taken), answer)| match answer {
            Answer::Moves(moves) => Some((observation.step, &taken[..], moves)),
            Answer::Plan(_) | Answer::Prediction(_) => None,
        })
    })
}

#[cfg(test)]
mod tests {
    use wire::keys::Role;
    use world::traffic::{TrafficMove, UncheckedMoves};

    use super::super::rule::Verdict;
    use super::*;

    /// Everybody goes straight on, but each so-manieth is put aside by so much (m) when he is taken over.
    fn verdict(aside: f64, every: usize) -> Verdict {
        let courses = Course::built_in(Role::Traffic).unwrap();
        let mut new = 0;
        let driven = courses.iter().map(|course| {
            let mut driven = Driven::default();
            for at in 0..course.steps.len() {
                let (observation, taken) = course.reacting(at, driven.answers.last()).unwrap();
                let mut moved = |agent: &Taken| {
                    let mut state = agent.state;
                    (state.x, state.y) = (state.x + 0.1 * state.velocity_x, state.y + 0.1 * state.velocity_y);
                    if agent.since_step == observation.step {
                        state.y += if new % every == 0 { aside } else { 0.0 };
                        new += 1;
                    }
                    TrafficMove { track: agent.track, state }
                };
                let moves = UncheckedMoves { step: observation.step, moves: taken.iter().map(&mut moved).collect() };
                driven.answers.push(Answer::Moves(moves.check(observation.step, &taken).unwrap()));
            }
            (course, driven)
        });
        hand_over(&driven.collect::<Vec<_>>()).verdict
    }

    #[test]
    fn who_jumps_when_he_is_taken_over_is_found() {
        assert_eq!(verdict(0.0, 1), Verdict::Holds);
        assert_eq!(verdict(0.3, 3), Verdict::Doubtful);
        assert_eq!(verdict(0.3, 1), Verdict::Broken);
    }
}
