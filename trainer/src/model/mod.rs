//! The network of the paper (section III-B; `network.md` 5) on a tape: what `network::inference` computes, with a way back.
//!
//! Exact short cuts (`network.md` 5.9): each different point of a map is encoded once, an LSTM runs on the agents of its type, whoever is not
//! there shares one row, keys are folded into queries, values are projected after pooling.
//!
//! | file | what |
//! | --- | --- |
//! | `layout` | parameters by name |
//! | `crew` | which rows of the tape are whom |
//! | `map` | what agents see of lanes and crosswalks |

mod crew;
mod layout;
mod map;

use network::constants::{COST_WEIGHTS, HEADS, HISTORY, MAP_HEADS, STATE, WIDTH};
use network::weights::Variant;

use crate::tape::Activation::{self, Elu, Relu};
use crate::tape::{LstmLayer, Scalar, Slot, Tape, Var};
use crate::windows::Sketch;

pub use layout::Layout;

use crew::Crew;

/// What comes out for a few sketches.
#[derive(Clone, Debug)]
pub struct Outputs {
    /// In each future the AV's controls [sketches, 100].
    pub plans: Vec<Var>,
    /// In each future the offsets of neighbours that are there [neighbours, 150].
    pub offsets: Vec<Var>,
    /// Which neighbour a row of the offsets is: its sketch and its number, 0 to 9.
    pub neighbors: Vec<(usize, usize)>,
    /// In each future the scores [sketches, 1].
    pub scores: Vec<Var>,
    /// What the cost's weights come from [1, 9].
    pub cost: Option<Var>,
}

/// The network's forward pass over `sketches`.
pub fn forward<'a, T: Scalar>(
    tape: &mut Tape<'a, T>,
    layout: &Layout,
    values: &'a [T],
    sketches: &[&Sketch],
) -> Outputs {
    let mut net = Net { tape, layout, values };
    let crew = Crew::of(sketches);
    let encoded = net.histories(&crew, sketches);
    let agents = (0..2).fold(encoded, |agents, layer| net.interact(&crew, agents, layer));
    let seen = net.map(&crew, sketches, agents);
    let variant = layout.variant();
    let futures: Vec<Var> = (0..variant.futures()).map(|future| net.look(&crew, agents, &seen, future)).collect();
    let mut outputs = Outputs {
        plans: Vec::new(),
        offsets: Vec::new(),
        neighbors: crew.neighbors.iter().map(|(_, sample, neighbor)| (*sample, *neighbor)).collect(),
        scores: Vec::new(),
        cost: None,
    };
    for future in &futures {
        let feature = net.tape.beside(*future, agents);
        let own = net.tape.pick(feature, crew.avs.clone());
        outputs.plans.push(net.decoded("plan.control", own));
        if variant.predicts() {
            let others = net.tape.pick(feature, crew.neighbors.iter().map(|(row, ..)| *row).collect());
            outputs.offsets.push(net.decoded("predict.decode", others));
        }
    }
    if variant.predicts() {
        outputs.scores = net.scores(&crew, agents, &seen, &futures);
    }
    if variant == Variant::Joint {
        let one = net.tape.constant(1, 1, vec![T::ONE]);
        let hidden = net.linear("plan.cost.0", one, Relu);
        outputs.cost = Some(net.linear("plan.cost.2", hidden, Activation::None));
        debug_assert_eq!(outputs.cost.map(|cost| net.tape.value(cost).columns), Some(COST_WEIGHTS));
    }
    outputs
}

/// A network under way.
struct Net<'t, 'a, T: Scalar> {
    tape: &'t mut Tape<'a, T>,
    layout: &'t Layout,
    values: &'a [T],
}

impl<'a, T: Scalar> Net<'_, 'a, T> {
    /// A parameter by its name.
    fn parameter(&mut self, name: &str) -> Var {
        let (rows, columns, place) = self.layout.place(name);
        self.tape.parameter(rows, columns, &self.values[place.clone()], place)
    }

    /// The projection of queries (0), keys (1) or values (2): its weight and its bias.
    fn projection(&mut self, name: &str, which: usize) -> (Var, Var) {
        let (_, _, weight) = self.layout.place(&format!("{name}.in_proj_weight"));
        let (_, _, bias) = self.layout.place(&format!("{name}.in_proj_bias"));
        let weight = weight.start + which * WIDTH * WIDTH..weight.start + (which + 1) * WIDTH * WIDTH;
        let bias = bias.start + which * WIDTH..bias.start + (which + 1) * WIDTH;
        (
            self.tape.parameter(WIDTH, WIDTH, &self.values[weight.clone()], weight),
            self.tape.parameter(1, WIDTH, &self.values[bias.clone()], bias),
        )
    }

    fn linear(&mut self, name: &str, x: Var, activation: Activation) -> Var {
        let (weight, bias) = (self.parameter(&format!("{name}.weight")), self.parameter(&format!("{name}.bias")));
        self.tape.linear(x, weight, Some(bias), activation)
    }

    fn norm(&mut self, name: &str, x: Var) -> Var {
        let (weight, bias) = (self.parameter(&format!("{name}.weight")), self.parameter(&format!("{name}.bias")));
        self.tape.norm(x, weight, bias)
    }

    /// A single query of each slot to the rows it may look at (5.5, 5.6), without what follows.
    fn attention(&mut self, name: &str, heads: usize, queries: Var, rows: Var, slots: Vec<Slot>) -> Var {
        let (weight, bias) = self.projection(name, 0);
        let query = self.tape.linear(queries, weight, Some(bias), Activation::None);
        let (keys, _) = self.projection(name, 1);
        let folded = self.tape.folded_queries(query, keys, heads);
        let pooled = self.tape.pooled(folded, rows, heads, slots);
        let (weight, bias) = self.projection(name, 2);
        let values = self.tape.pooled_values(pooled, weight, bias, heads);
        self.linear(&format!("{name}.out_proj"), values, Activation::None)
    }

    /// Norm, wide layer, norm; no residual (5.5).
    fn feed_forward(&mut self, name: &str, x: Var) -> Var {
        let x = self.norm(&format!("{name}.0"), x);
        let wide = self.linear(&format!("{name}.1"), x, Relu);
        let wide = self.tape.dropout(wide);
        let x = self.linear(&format!("{name}.4"), wide, Activation::None);
        self.norm(&format!("{name}.5"), x)
    }

    /// Each row of the crew, encoded by its type's LSTM (5.1).
    fn histories(&mut self, crew: &Crew, sketches: &[&Sketch]) -> Var {
        let mut parts = Vec::new();
        let mut order = vec![0; crew.rows.len()];
        let mut done = 0;
        for kind in ["vehicle", "pedestrian", "cyclist"] {
            let members: Vec<usize> = (0..crew.rows.len()).filter(|row| crew.rows[*row].kind == kind).collect();
            if members.is_empty() {
                continue;
            }
            let mut histories = Vec::with_capacity(HISTORY * members.len() * STATE);
            for step in 0..HISTORY {
                for member in &members {
                    let row = crew.rows[*member].state(sketches, step);
                    histories.extend(row.iter().map(|value| T::of(f64::from(*value))));
                }
            }
            let layers = [0, 1].map(|layer| {
                let mut part = |part: &str| self.parameter(&format!("{kind}_net.motion.{part}_l{layer}"));
                LstmLayer {
                    input: part("weight_ih"),
                    hidden: part("weight_hh"),
                    input_bias: part("bias_ih"),
                    hidden_bias: part("bias_hh"),
                }
            });
            parts.push(self.tape.lstm(histories, members.len(), HISTORY, layers));
            members.iter().enumerate().for_each(|(index, member)| order[*member] = done + index);
            done += members.len();
        }
        let all = self.tape.stack(parts);
        self.tape.pick(all, order)
    }

    /// A layer in which agents look at each other (5.4).
    fn interact(&mut self, crew: &Crew, x: Var, layer: usize) -> Var {
        let name = |part: &str| format!("agent_agent.interaction_net.layers.{layer}.{part}");
        let (weight, bias) =
            (self.parameter(&name("self_attn.in_proj_weight")), self.parameter(&name("self_attn.in_proj_bias")));
        let projected = self.tape.linear(x, weight, Some(bias), Activation::None);
        let seen = crew.rows.iter().map(|row| row.is_seen).collect();
        let heard = self.tape.among(projected, HEADS, crew.samples.clone(), seen);
        let heard = self.linear(&name("self_attn.out_proj"), heard, Activation::None);
        let heard = self.tape.dropout(heard);
        let x = self.tape.sum(x, heard);
        let x = self.norm(&name("norm1"), x);
        let wide = self.linear(&name("linear1"), x, Relu);
        let wide = self.tape.dropout(wide);
        let more = self.linear(&name("linear2"), wide, Activation::None);
        let more = self.tape.dropout(more);
        let x = self.tape.sum(x, more);
        self.norm(&name("norm2"), x)
    }

    /// What each agent makes of the map in a future (5.6).
    fn look(&mut self, crew: &Crew, agents: Var, seen: &map::Seen, future: usize) -> Var {
        let slots = (0..crew.rows.len()).map(|row| Slot { query: row, rows: seen.unmasked[row].clone() }).collect();
        let name = format!("agent_map.map_attention.attention.{future}");
        let answers = self.attention(&name, MAP_HEADS, agents, seen.answers, slots);
        self.feed_forward("agent_map.map_attention.ffn", answers)
    }

    /// A decoder of two layers (5.7).
    fn decoded(&mut self, name: &str, x: Var) -> Var {
        let x = self.tape.dropout(x);
        let hidden = self.linear(&format!("{name}.1"), x, Elu);
        self.linear(&format!("{name}.3"), hidden, Activation::None)
    }

    /// Scores of the futures (5.8); nothing but this head learns from them.
    fn scores(&mut self, crew: &Crew, agents: Var, seen: &map::Seen, futures: &[Var]) -> Vec<Var> {
        let map = self.most(seen.answers, crew.samples.iter().map(|rows| seen.all[rows.clone()].concat()).collect());
        let of_rows = |rows: &std::ops::Range<usize>| rows.clone().map(|row| row as u32).collect::<Vec<u32>>();
        let together = self.most(agents, crew.samples.iter().map(of_rows).collect());
        let pooled = self.tape.beside(map, together);
        let pooled = self.tape.dropout(pooled);
        let reduced = self.linear("score.reduce.1", pooled, Elu);
        let mut scores = Vec::new();
        for future in futures {
            let pooled = self.most(*future, crew.samples.iter().map(of_rows).collect());
            let both = self.tape.beside(reduced, pooled);
            let both = self.tape.dropout(both);
            let hidden = self.linear("score.decode.1", both, Elu);
            // The tensors' numbers leave no place for a dropout before the last layer, though the text has one.
            scores.push(self.linear("score.decode.3", hidden, Activation::None));
        }
        scores
    }

    /// The largest of each column over groups of rows, as a constant.
    fn most(&mut self, x: Var, groups: Vec<Vec<u32>>) -> Var {
        let matrix = self.tape.value(x);
        let width = matrix.columns;
        let mut pooled = Vec::with_capacity(groups.len() * width);
        for rows in &groups {
            for column in 0..width {
                let column = rows.iter().map(|row| matrix.data[*row as usize * width + column]);
                pooled.push(column.reduce(|a, b| if b > a { b } else { a }).unwrap_or(T::ZERO));
            }
        }
        self.tape.constant(groups.len(), width, pooled)
    }
}
