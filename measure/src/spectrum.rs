//! How many dimensions a cloud of latents fills: the eigenvalues of its covariance.

/// Effective rank, exp(−Σ p ln p) over the covariance's eigenvalues divided by their sum, and that sum, the total variance. A cloud without extent has
/// rank 0.
///
/// # Shapes
/// - `rows`: `[count, dims]`, row-major
pub fn effective_rank(rows: &[f32], dims: usize) -> (f64, f64) {
    let values = eigenvalues(covariance(rows, dims), dims);
    let total: f64 = values.iter().map(|value| value.max(0.0)).sum();
    if total <= 1e-12 {
        return (0.0, 0.0);
    }
    let entropy: f64 =
        values.iter().map(|value| value / total).filter(|share| *share > 1e-12).map(|share| -share * share.ln()).sum();
    (entropy.exp(), total)
}

/// Covariance of rows, `[dims, dims]`, row-major.
fn covariance(rows: &[f32], dims: usize) -> Vec<f64> {
    let count = (rows.len() / dims.max(1)).max(1) as f64;
    let mut mean = vec![0.0; dims];
    for row in rows.chunks_exact(dims) {
        mean.iter_mut().zip(row).for_each(|(sum, &x)| *sum += f64::from(x) / count);
    }
    let mut matrix = vec![0.0; dims * dims];
    for row in rows.chunks_exact(dims) {
        for i in 0..dims {
            let left = (f64::from(row[i]) - mean[i]) / count;
            for j in 0..dims {
                matrix[i * dims + j] += left * (f64::from(row[j]) - mean[j]);
            }
        }
    }
    matrix
}

/// Eigenvalues of a symmetric matrix by Jacobi's rotations.
fn eigenvalues(mut a: Vec<f64>, n: usize) -> Vec<f64> {
    for _sweep in 0..30 {
        let off: f64 = (0..n)
            .flat_map(|i| (0..n).filter(move |&j| j != i).map(move |j| (i, j)))
            .map(|(i, j)| a[i * n + j].powi(2))
            .sum();
        let all: f64 = a.iter().map(|x| x * x).sum();
        if off <= 1e-20 * all {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(&mut a, n, p, q);
            }
        }
    }
    (0..n).map(|i| a[i * n + i]).collect()
}

/// One Jacobi rotation, which makes entry (p, q) zero.
fn rotate(a: &mut [f64], n: usize, p: usize, q: usize) {
    let apq = a[p * n + q];
    if apq == 0.0 {
        return;
    }
    let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..n {
        let (akp, akq) = (a[k * n + p], a[k * n + q]);
        a[k * n + p] = c * akp - s * akq;
        a[k * n + q] = s * akp + c * akq;
    }
    for k in 0..n {
        let (apk, aqk) = (a[p * n + k], a[q * n + k]);
        a[p * n + k] = c * apk - s * aqk;
        a[q * n + k] = s * apk + c * aqk;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_of_a_known_matrix() {
        // [[2, 1, 0], [1, 2, 1], [0, 1, 2]] has 2 and 2 ± √2.
        let mut found = eigenvalues(vec![2.0, 1.0, 0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 2.0], 3);
        found.sort_by(f64::total_cmp);
        let root = 2f64.sqrt();
        for (found, wanted) in found.iter().zip([2.0 - root, 2.0, 2.0 + root]) {
            assert!((found - wanted).abs() < 1e-9, "{found} {wanted}");
        }
    }

    #[test]
    fn rank_counts_the_directions_that_vary() {
        let line: Vec<f32> = (0..10).flat_map(|i| [i as f32, 2.0 * i as f32, 0.5]).collect();
        assert!((effective_rank(&line, 3).0 - 1.0).abs() < 1e-6);
        let square = [1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0];
        let (rank, variance) = effective_rank(&square, 2);
        assert!((rank - 2.0).abs() < 1e-9 && (variance - 1.0).abs() < 1e-9);
        assert_eq!(effective_rank(&[0.3; 12], 3).0, 0.0);
    }
}
