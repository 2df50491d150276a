//! Eigenvalues of small symmetric matrices by Jacobi's cyclic method (Golub and Van Loan 8.5): fixed size, on
//! the stack, accurate for small eigenvalues.

/// Sweeps after which it ends in any case; four to six are usual.
const SWEEPS: usize = 12;

/// Eigenvalues, ascending, and the unit eigenvectors in the same order (one a row).
pub(crate) fn symmetric<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut vectors = [[0.0; N]; N];
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..N {
            for q in p + 1..N {
                let off = a[p][q];
                // Below this a rotation changes no digit of either diagonal element.
                if off * off <= 1e-34 * (a[p][p] * a[q][q]).abs() || off == 0.0 {
                    continue;
                }
                turned = true;
                let theta = 0.5 * (a[q][q] - a[p][p]) / off;
                let root = libm::sqrt(theta * theta + 1.0);
                let tangent = if theta >= 0.0 { 1.0 / (theta + root) } else { 1.0 / (theta - root) };
                let cosine = 1.0 / libm::sqrt(tangent * tangent + 1.0);
                let sine = tangent * cosine;
                a[p][p] -= tangent * off;
                a[q][q] += tangent * off;
                a[p][q] = 0.0;
                a[q][p] = 0.0;
                for k in 0..N {
                    if k != p && k != q {
                        let (kp, kq) = (a[k][p], a[k][q]);
                        a[k][p] = cosine * kp - sine * kq;
                        a[k][q] = sine * kp + cosine * kq;
                        a[p][k] = a[k][p];
                        a[q][k] = a[k][q];
                    }
                    let (vp, vq) = (vectors[p][k], vectors[q][k]);
                    vectors[p][k] = cosine * vp - sine * vq;
                    vectors[q][k] = sine * vp + cosine * vq;
                }
            }
        }
        if !turned {
            break;
        }
    }
    let mut values = [0.0; N];
    for (i, value) in values.iter_mut().enumerate() {
        *value = a[i][i];
    }
    // Insertion sort of N <= 6 values.
    for i in 1..N {
        let mut k = i;
        while k > 0 && values[k] < values[k - 1] {
            values.swap(k, k - 1);
            vectors.swap(k, k - 1);
            k -= 1;
        }
    }
    (values, vectors)
}
