//! Each operation's derivative against central differences, in double precision.

use super::*;

/// Numbers of no pattern, between -1 and 1.
fn numbers(count: usize, salt: u64) -> Vec<f64> {
    let mut random = fastrand::Rng::with_seed(salt);
    (0..count).map(|_| 2.0 * random.f64() - 1.0).collect()
}

/// The gradient of `weights . f(parameters)` against differences, all parameters being matrices of these sizes in one row.
fn holds(sizes: &[(usize, usize)], f: impl for<'a> Fn(&mut Tape<'a, f64>, &[Var]) -> Var) {
    let count: usize = sizes.iter().map(|(rows, columns)| rows * columns).sum();
    let parameters = numbers(count, 7);
    let run = |parameters: &[f64]| {
        let mut tape = Tape::new(Some((11, 0.25)), Spare::default());
        let vars = place(&mut tape, parameters, sizes);
        let y = f(&mut tape, &vars);
        let weights = numbers(tape.value(y).data.len(), 3);
        let value: f64 = tape.value(y).data.iter().zip(&weights).map(|(y, w)| y * w).sum();
        let mut gradient = vec![0.0; count];
        tape.backward(vec![(y, weights)], &mut gradient);
        (value, gradient)
    };
    let (_, gradient) = run(&parameters);
    for index in 0..count {
        let at = |change: f64| {
            let mut moved = parameters.clone();
            moved[index] += change;
            run(&moved).0
        };
        let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!(
            (slope - gradient[index]).abs() < 1e-7 * (1.0 + slope.abs()),
            "{index}: {} is {slope}",
            gradient[index]
        );
    }
}

fn place<'a>(tape: &mut Tape<'a, f64>, parameters: &'a [f64], sizes: &[(usize, usize)]) -> Vec<Var> {
    let mut from = 0;
    sizes
        .iter()
        .map(|(rows, columns)| {
            let place = from..from + rows * columns;
            from = place.end;
            tape.parameter(*rows, *columns, &parameters[place.clone()], place)
        })
        .collect()
}

#[test]
fn linear_layers_and_products() {
    holds(&[(3, 4), (5, 4), (1, 5)], |tape, v| tape.linear(v[0], v[1], Some(v[2]), Activation::None));
    holds(&[(3, 4), (5, 4), (1, 5)], |tape, v| tape.linear(v[0], v[1], Some(v[2]), Activation::Relu));
    holds(&[(3, 4), (5, 4)], |tape, v| tape.linear(v[0], v[1], None, Activation::Elu));
    holds(&[(3, 4), (4, 2)], |tape, v| tape.product(v[0], v[1]));
    holds(&[(3, 4)], |tape, v| tape.activated(v[0], Activation::Relu));
}

#[test]
fn what_is_done_number_by_number() {
    holds(&[(3, 5), (3, 5)], |tape, v| tape.sum(v[0], v[1]));
    holds(&[(4, 5)], |tape, v| tape.dropout(v[0]));
    holds(&[(3, 9), (1, 9), (1, 9)], |tape, v| tape.norm(v[0], v[1], v[2]));
}

#[test]
fn rows() {
    holds(&[(3, 2)], |tape, v| tape.pick(v[0], vec![2, 0, 2]));
    holds(&[(3, 2), (1, 2)], |tape, v| tape.stack(vec![v[0], v[1], v[0]]));
    holds(&[(3, 2), (3, 4)], |tape, v| tape.beside(v[0], v[1]));
    holds(&[(2, 3), (2, 2)], |tape, v| {
        let part = |var, at, transposed| Part { var, at, transposed, first_is_fixed: false };
        tape.assembled(5, 6, vec![part(v[0], (1, 0), true), part(v[1], (0, 4), false)])
    });
}

#[test]
fn what_filters_see() {
    // Two pictures of 5 x 5 places of two numbers; filters overlap, and the last row and column are seen by none.
    let patches = Patches { side: 5, channels: 2, kernel: 2, stride: 1 };
    holds(&[(50, 2)], |tape, v| tape.patches(v[0], patches));
    holds(&[(50, 2)], |tape, v| tape.patches(v[0], Patches { kernel: 3, stride: 2, ..patches }));
    holds(&[(50, 2)], |tape, v| tape.patches(v[0], Patches { stride: 2, ..patches }));
    holds(&[(6, 2)], |tape, v| tape.reshaped(v[0], 3, 4));
}

#[test]
fn a_filter_sees_the_places_of_its_corner() {
    let mut tape = Tape::<f64>::new(None, Spare::default());
    let x = tape.constant(9, 1, (0..9).map(f64::from).collect());
    let y = tape.patches(x, Patches { side: 3, channels: 1, kernel: 2, stride: 1 });
    let rows: Vec<&[f64]> = tape.value(y).data.chunks(4).collect();
    assert_eq!(rows, [[0.0, 1.0, 3.0, 4.0], [1.0, 2.0, 4.0, 5.0], [3.0, 4.0, 6.0, 7.0], [4.0, 5.0, 7.0, 8.0]]);
}

#[test]
fn an_lstm() {
    let (inputs, hidden) = (3, 4);
    let layer = |inputs| [(4 * hidden, inputs), (4 * hidden, hidden), (1, 4 * hidden), (1, 4 * hidden)];
    let sizes: Vec<(usize, usize)> = layer(inputs).into_iter().chain(layer(hidden)).collect();
    holds(&sizes, |tape, v| {
        let layer = |v: &[Var]| LstmLayer { input: v[0], hidden: v[1], input_bias: v[2], hidden_bias: v[3] };
        tape.lstm(numbers(2 * 5 * 3, 5), 2, 5, [layer(&v[..4]), layer(&v[4..])])
    });
}

#[test]
fn attention_to_chosen_rows() {
    let slots = || {
        vec![
            Slot { query: 1, rows: vec![0, 2, 2] },
            Slot { query: 0, rows: vec![3, 1] },
            Slot { query: 1, rows: vec![1] },
        ]
    };
    holds(&[(2, 6), (4, 3)], |tape, v| tape.pooled(v[0], v[1], 2, slots()));
    holds(&[(2, 4), (4, 3)], |tape, v| tape.folded_queries(v[0], v[1], 2));
    holds(&[(3, 8), (4, 3), (1, 4)], |tape, v| tape.pooled_values(v[0], v[1], v[2], 2));
}

#[test]
fn attention_within_groups() {
    holds(&[(5, 12)], |tape, v| tape.among(v[0], 2, vec![0..2, 2..5], vec![true, true, true, false, true]));
}

#[test]
fn nothing_comes_through_what_is_detached_and_a_fixed_first_row_stays() {
    let parameters = numbers(6, 1);
    let mut tape = Tape::new(None, Spare::default());
    let vars = place(&mut tape, &parameters, &[(2, 2), (1, 2)]);
    let cut = tape.detached(vars[0]);
    let parts = vec![Part { var: vars[0], at: (0, 0), transposed: false, first_is_fixed: true }];
    let y = tape.assembled(2, 2, parts);
    let y = tape.sum(y, cut);
    let mut gradient = vec![0.0; 6];
    tape.backward(vec![(y, vec![1.0; 4])], &mut gradient);
    assert_eq!(gradient, [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
}
