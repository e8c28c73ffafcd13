//! Ridge regression with rows held out in blocks: what a linear readout finds in features it has not seen.

/// Penalty a row, on standardised features.
const RIDGE: f64 = 1e-3;

/// Predictions of `targets` from `features` for every row, each made by a regression that has not seen the row's block.
///
/// # Shapes
/// - `features`: `[rows, dims]`, `targets`: `[rows, outputs]`, row-major; `blocks`: `[rows]`, below `count`
/// - output: `[rows, outputs]`
pub fn held_out(
    features: &[f32],
    dims: usize,
    targets: &[f32],
    outputs: usize,
    blocks: &[usize],
    count: usize,
) -> Vec<f64> {
    let (mean, scale) = standard(features, dims);
    let row = |index: usize| -> Vec<f64> {
        let values = &features[index * dims..(index + 1) * dims];
        let standardised =
            values.iter().zip(&mean).zip(&scale).map(|((x, mean), scale)| (f64::from(*x) - mean) * scale);
        standardised.chain([1.0]).collect()
    };
    let per_block: Vec<Products> = (0..count).map(|_| Products::new(dims + 1, outputs)).collect();
    let mut per_block = per_block;
    for (index, &block) in blocks.iter().enumerate() {
        per_block[block].add(&row(index), &targets[index * outputs..(index + 1) * outputs]);
    }
    let solve_without = |left_out: usize| {
        let mut all = Products::new(dims + 1, outputs);
        per_block
            .iter()
            .enumerate()
            .filter(|(block, _)| *block != left_out)
            .for_each(|(_, products)| all.merge(products));
        all.solve()
    };
    let weights: Vec<Vec<f64>> = (0..count).map(solve_without).collect();
    let mut predictions = Vec::with_capacity(blocks.len() * outputs);
    for (index, &block) in blocks.iter().enumerate() {
        let x = row(index);
        predictions
            .extend((0..outputs).map(|output| {
                x.iter().enumerate().map(|(i, x)| x * weights[block][i * outputs + output]).sum::<f64>()
            }));
    }
    predictions
}

/// R² of each output, 1 − residual sum of squares over total sum of squares; NaN where the target does not vary.
pub fn r_squared(predictions: &[f64], targets: &[f32], outputs: usize) -> Vec<f64> {
    let rows = (targets.len() / outputs) as f64;
    let of = |output: usize| {
        let pairs = || predictions.iter().zip(targets).skip(output).step_by(outputs);
        let mean = pairs().map(|(_, y)| f64::from(*y)).sum::<f64>() / rows;
        let total: f64 = pairs().map(|(_, y)| (f64::from(*y) - mean).powi(2)).sum();
        let residual: f64 = pairs().map(|(p, y)| (p - f64::from(*y)).powi(2)).sum();
        if total > 1e-9 * rows { 1.0 - residual / total } else { f64::NAN }
    };
    (0..outputs).map(of).collect()
}

fn standard(features: &[f32], dims: usize) -> (Vec<f64>, Vec<f64>) {
    let rows = (features.len() / dims.max(1)).max(1) as f64;
    let column = |dim: usize| features.iter().skip(dim).step_by(dims).map(|x| f64::from(*x));
    let mean: Vec<f64> = (0..dims).map(|dim| column(dim).sum::<f64>() / rows).collect();
    let scale = (0..dims).map(|dim| {
        let variance = column(dim).map(|x| (x - mean[dim]).powi(2)).sum::<f64>() / rows;
        if variance > 1e-12 { variance.sqrt().recip() } else { 0.0 }
    });
    let scale = scale.collect();
    (mean, scale)
}

/// `XᵀX` and `XᵀY`.
struct Products {
    size: usize,
    outputs: usize,
    rows: f64,
    xx: Vec<f64>,
    xy: Vec<f64>,
}

impl Products {
    fn new(size: usize, outputs: usize) -> Self {
        Self { size, outputs, rows: 0.0, xx: vec![0.0; size * size], xy: vec![0.0; size * outputs] }
    }

    fn add(&mut self, x: &[f64], y: &[f32]) {
        self.rows += 1.0;
        for (i, a) in x.iter().enumerate() {
            let xx = &mut self.xx[i * self.size..(i + 1) * self.size];
            xx.iter_mut().zip(x).for_each(|(sum, b)| *sum += a * b);
            let xy = &mut self.xy[i * self.outputs..(i + 1) * self.outputs];
            xy.iter_mut().zip(y).for_each(|(sum, y)| *sum += a * f64::from(*y));
        }
    }

    fn merge(&mut self, other: &Self) {
        self.rows += other.rows;
        self.xx.iter_mut().zip(&other.xx).for_each(|(sum, x)| *sum += x);
        self.xy.iter_mut().zip(&other.xy).for_each(|(sum, x)| *sum += x);
    }

    /// `(XᵀX + λ n I)⁻¹ XᵀY` by Cholesky's decomposition; the constant column carries a negligible penalty.
    fn solve(mut self) -> Vec<f64> {
        let (n, outputs) = (self.size, self.outputs);
        for i in 0..n {
            let penalty = if i + 1 == n { 1e-9 } else { RIDGE };
            self.xx[i * n + i] += penalty * self.rows.max(1.0);
        }
        for i in 0..n {
            for j in 0..=i {
                let dot: f64 = (0..j).map(|k| self.xx[i * n + k] * self.xx[j * n + k]).sum();
                let value = self.xx[i * n + j] - dot;
                self.xx[i * n + j] = if i == j { value.max(1e-12).sqrt() } else { value / self.xx[j * n + j] };
            }
        }
        for output in 0..outputs {
            for i in 0..n {
                let dot: f64 = (0..i).map(|k| self.xx[i * n + k] * self.xy[k * outputs + output]).sum();
                self.xy[i * outputs + output] = (self.xy[i * outputs + output] - dot) / self.xx[i * n + i];
            }
            for i in (0..n).rev() {
                let dot: f64 = (i + 1..n).map(|k| self.xx[k * n + i] * self.xy[k * outputs + output]).sum();
                self.xy[i * outputs + output] = (self.xy[i * outputs + output] - dot) / self.xx[i * n + i];
            }
        }
        self.xy
    }
}
