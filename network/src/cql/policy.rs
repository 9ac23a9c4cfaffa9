//! The policy: its weights in and out of files, and what it does, fast.

use safetensors::tensor::SafeTensors;

use super::ACTIONS;
use super::shape::Shape;
use crate::inference::functions::tanh;
use crate::inference::product::{End, Kernel, Linear, ROWS, Rows};
use crate::weights::{Precision, TensorLayout, WeightsError, file};

/// A policy ready to act; threads may share it, each with a [`Workspace`] of its own.
#[derive(Debug)]
pub struct Policy {
    shape: Shape,
    convolutions: Vec<Linear>,
    dense: Linear,
    mean: Linear,
}

/// Room for what comes between picture and action.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    picture: Vec<f32>,
    patches: Vec<f32>,
    seen: Vec<f32>,
    next: Vec<f32>,
}

impl Policy {
    /// Reads the bytes of a file, in single or half precision.
    ///
    /// # Errors
    /// [`WeightsError`] names the tensor, what is expected and what is there.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let shape = Shape::driver();
        let file = SafeTensors::deserialize(bytes).map_err(|error| WeightsError::Format(error.to_string()))?;
        let layout = shape.policy(false);
        let mut tensors = Vec::new();
        for TensorLayout { name, shape } in &layout {
            let view = file.tensor(name);
            let view = view.map_err(|_| WeightsError::Missing { name: name.clone(), shape: shape.clone() })?;
            file::check_shape(name, shape, &view)?;
            tensors.push(file::numbers(name, &view)?);
        }
        let mut names = file.names();
        names.sort_unstable();
        match names.into_iter().find(|name| layout.iter().all(|own| own.name != *name)) {
            Some(name) => Err(WeightsError::Unknown { name: name.to_owned() }),
            None => Ok(Self::of(shape, &tensors)),
        }
    }

    /// The policy of these tensors, each with the numbers of its layout.
    fn of(shape: Shape, tensors: &[Vec<f32>]) -> Self {
        let kernel = Kernel::new();
        let layer = |number: usize| {
            let (weight, bias) = (&tensors[2 * number], &tensors[2 * number + 1]);
            let inputs = weight.len() / bias.len();
            Linear::new(kernel, (bias.len(), inputs), |n, k| weight[n * inputs + k], |n| bias[n])
        };
        let count = shape.convolutions.len();
        Self { convolutions: (0..count).map(layer).collect(), dense: layer(count), mean: layer(count + 1), shape }
    }

    /// What it does where it sees this picture: the most likely action, each number in [-1, 1].
    #[must_use]
    pub fn act(&self, picture: &[u8], room: &mut Workspace) -> [f32; ACTIONS] {
        let Workspace { picture: numbers, patches, seen, next } = room;
        numbers.clear();
        numbers.extend(picture.iter().map(|value| f32::from(*value) / 255.0));
        std::mem::swap(numbers, seen);
        let grids = self.shape.grids();
        let mut stride = self.shape.channels;
        for (number, (layer, linear)) in self.shape.convolutions.iter().zip(&self.convolutions).enumerate() {
            let ([side, channels], [out, _]) = (grids[number], grids[number + 1]);
            patches.clear();
            for (row, column) in (0..out * out).map(|place| (place / out, place % out)) {
                for y in 0..layer.kernel {
                    let first = ((row * layer.stride + y) * side + column * layer.stride) * stride;
                    for x in 0..layer.kernel {
                        patches.extend_from_slice(&seen[first + x * stride..][..channels]);
                    }
                }
            }
            let rows = (out * out).next_multiple_of(ROWS);
            patches.resize(rows * layer.kernel * layer.kernel * channels, 0.0);
            next.resize(rows * linear.stride(), 0.0);
            linear.apply_packed(patches, out * out, next, End::Relu);
            std::mem::swap(seen, next);
            stride = linear.stride();
        }
        let [out, channels] = grids[grids.len() - 1];
        patches.clear();
        for place in 0..out * out {
            patches.extend_from_slice(&seen[place * stride..][..channels]);
        }
        patches.resize(ROWS * self.shape.flat(), 0.0);
        next.resize(ROWS * self.dense.stride(), 0.0);
        self.dense.apply_packed(patches, 1, next, End::Relu);
        seen.resize(ROWS * self.mean.stride(), 0.0);
        let rows = Rows { numbers: next, stride: self.dense.stride() };
        self.mean.apply(rows, 1, seen, self.mean.stride(), End::Sum);
        std::array::from_fn(|index| tanh(seen[index]))
    }
}

/// The bytes of a policy's file: of its tensors the numbers, in the order of [`Shape::policy`].
///
/// # Errors
/// [`WeightsError`] where a number is not finite, or too large for half precision.
pub fn write(shape: &Shape, tensors: &[&[f32]], precision: Precision) -> Result<Vec<u8>, WeightsError> {
    let mut parts = Vec::new();
    let layout = shape.policy(false);
    for (TensorLayout { name, shape }, values) in layout.iter().zip(tensors) {
        if let Some(place) = values.iter().position(|value| !value.is_finite()) {
            return Err(WeightsError::NotFinite { name: name.clone(), place, value: values[place] });
        }
        parts.push(file::part(name, shape, values, precision)?);
    }
    file::serialize(&parts, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::formula_numbers;

    /// Weights without pattern, of about the size that layers begin with.
    fn tensors(shape: &Shape) -> Vec<Vec<f32>> {
        let layout = shape.policy(false);
        let numbers = layout.iter().map(|TensorLayout { name, shape }| {
            let size = 1.0 / (shape.last().copied().unwrap_or(1) as f32).sqrt();
            let count = shape.iter().product();
            formula_numbers(name).take(count).map(|value| size * value as f32).collect()
        });
        numbers.collect()
    }

    fn picture() -> Vec<u8> {
        (0..Shape::driver().picture()).map(|index| ((index * index / 7) % 256) as u8).collect()
    }

    /// The same by the definition: sums over filters, one number after another, in double precision.
    fn plainly(shape: &Shape, tensors: &[Vec<f32>], picture: &[u8]) -> Vec<f64> {
        let wide = |numbers: &[f32]| numbers.iter().map(|value| f64::from(*value)).collect::<Vec<f64>>();
        let mut seen: Vec<f64> = picture.iter().map(|value| f64::from(*value) / 255.0).collect();
        let [mut side, mut channels] = [shape.side, shape.channels];
        let mut layers = tensors.chunks(2).map(|pair| (wide(&pair[0]), wide(&pair[1])));
        for layer in &shape.convolutions {
            let (weight, bias) = layers.next().unwrap();
            let out = (side - layer.kernel) / layer.stride + 1;
            let mut next = vec![0.0; out * out * layer.filters];
            for (row, column, filter) in
                (0..next.len()).map(|i| (i / layer.filters / out, i / layer.filters % out, i % layer.filters))
            {
                let mut sum = bias[filter];
                for (y, x, c) in (0..layer.kernel * layer.kernel * channels)
                    .map(|i| (i / channels / layer.kernel, i / channels % layer.kernel, i % channels))
                {
                    let place = (row * layer.stride + y) * side + column * layer.stride + x;
                    let own = ((filter * layer.kernel + y) * layer.kernel + x) * channels + c;
                    sum += weight[own] * seen[place * channels + c];
                }
                next[(row * out + column) * layer.filters + filter] = sum.max(0.0);
            }
            (seen, side, channels) = (next, out, layer.filters);
        }
        for is_last in [false, true] {
            let (weight, bias) = layers.next().unwrap();
            let sums = bias.iter().zip(weight.chunks(seen.len())).map(|(bias, row)| {
                let sum: f64 = bias + row.iter().zip(&seen).map(|(w, x)| w * x).sum::<f64>();
                if is_last { libm::tanh(sum) } else { sum.max(0.0) }
            });
            seen = sums.collect();
        }
        seen
    }

    #[test]
    fn it_does_what_the_definition_says() {
        let (shape, picture) = (Shape::driver(), picture());
        let tensors = tensors(&shape);
        let parts: Vec<&[f32]> = tensors.iter().map(Vec::as_slice).collect();
        let policy = Policy::read(&write(&shape, &parts, Precision::Single).unwrap()).unwrap();
        let mut room = Workspace::default();
        let done = policy.act(&picture, &mut room);
        let wanted = plainly(&shape, &tensors, &picture);
        for (done, wanted) in done.iter().zip(&wanted) {
            assert!((f64::from(*done) - wanted).abs() < 1e-5, "{done} {wanted}");
        }
        assert!(wanted.iter().any(|value| (0.01..0.99).contains(&value.abs())), "{wanted:?}");
        assert_eq!(policy.act(&picture, &mut room), done, "the room is used again");
    }

    #[test]
    fn what_is_no_policy_is_told() {
        let shape = Shape::driver();
        let tensors = tensors(&shape);
        let mut parts: Vec<&[f32]> = tensors.iter().map(Vec::as_slice).collect();
        let told = |bytes: &[u8]| Policy::read(bytes).unwrap_err().to_string();
        assert!(told(b"{}").contains("no weights"));
        let short = write(&shape, &parts[..parts.len() - 1], Precision::Half).unwrap();
        assert!(told(&short).starts_with("tensor mean.bias is missing"));
        let (zero, none) = (vec![0.0; parts[0].len()], [f32::NAN; ACTIONS]);
        parts[0] = &zero;
        *parts.last_mut().unwrap() = &none;
        let error = write(&shape, &parts, Precision::Half).unwrap_err().to_string();
        assert!(error.contains("mean.bias holds NaN"), "{error}");
    }
}
