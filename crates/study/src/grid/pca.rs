use glam::DVec3;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pdv::Draw;

use crate::Material;
use crate::judge::{Judge, Score};

/// ε of the log-relative mapping (Nielsen, Jensen, Ramamoorthi 2015), sr⁻¹.
const EPSILON: f64 = 1e-3;
/// Weight of the prior that holds coefficients to those of the training materials, per reading.
const ETA: f64 = 1e-3;
/// Pairs of directions among which the readings are placed.
const PLACES: u64 = 4000;

/// Where readings may be placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Placement {
    /// Anywhere on the hemisphere.
    Free,
    /// In one plane with the normal, where a rig of two arms can stand.
    Plane,
}

impl Placement {
    pub(crate) const ALL: [Self; 2] = [Self::Free, Self::Plane];

    /// What rows call the model of so many readings.
    pub(crate) fn model(self, readings: usize) -> String {
        match self {
            Self::Free => format!("pca-{readings}"),
            Self::Plane => format!("pca-{readings}-in-plane"),
        }
    }

    /// Where the readings stand, in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Free => "anywhere on the hemisphere",
            Self::Plane => "in the plane of the arms",
        }
    }
}

/// Log-relative PCA: what a few readings anywhere on the hemisphere tell, for a material like those of a database.
///
/// Every channel of every training material is one column x = ln((f w + ε)/(m w + ε)), m the median over the columns
/// and w = max(cos θ_i cos θ_o, ε). The readings are placed by QR with column pivoting of the scaled basis; they are
/// free of noise and cost no time. A material is reconstructed from those of all other families, so that what it is made
/// of is known from no sister.
pub(crate) struct Pca<'a> {
    materials: &'a [&'a Material],
    judge: &'a Judge,
    places: Judge,
    /// Values of every material, at the places and at the pairs of the judge.
    values: Vec<[Vec<DVec3>; 2]>,
}

/// What the training materials of all families but one teach.
struct Basis {
    /// Median over the columns, at places and pairs.
    middle: [Vec<f64>; 2],
    /// U·S/√n of the n training columns, centred, at places and pairs.
    scaled: [DMatrix<f64>; 2],
    /// Mean column at places and pairs.
    mean: [DVector<f64>; 2],
}

impl<'a> Pca<'a> {
    pub(crate) fn new(
        materials: &'a [&'a Material],
        judge: &'a Judge,
        draw: &Draw,
        placement: Placement,
    ) -> Self {
        let draw = Draw {
            pairs: PLACES,
            theta_max: draw.theta_max,
            // Other pairs than those that it is judged on.
            seed: !draw.seed,
        };
        let places = match placement {
            Placement::Free => Judge::new(&draw),
            Placement::Plane => Judge::in_plane(&draw),
        };
        let values = materials.iter().map(|material| {
            [
                places.values(material.brdf.as_ref()),
                judge.values(material.brdf.as_ref()),
            ]
        });
        Self {
            materials,
            judge,
            values: values.collect(),
            places,
        }
    }

    /// Scores of the materials of a family by their index, for each number of readings, learnt from all others.
    pub(crate) fn without(&self, family: &str, readings: &[usize]) -> Vec<(usize, usize, Score)> {
        let (tested, training): (Vec<usize>, Vec<usize>) =
            (0..self.values.len()).partition(|&material| self.materials[material].family == family);
        if training.is_empty() {
            return Vec::new();
        }
        let basis = self.basis(&training, readings.iter().copied().max().unwrap_or(0));
        let mut scores = Vec::new();
        for &n in readings {
            let chosen = places(&basis.scaled[0], n);
            for &material in &tested {
                let estimate = self.reconstruct(&basis, &chosen, material);
                let score = self.judge.score(&self.values[material][1], &estimate);
                scores.push((material, n, score));
            }
        }
        scores
    }

    fn basis(&self, training: &[usize], components: usize) -> Basis {
        let sets = [self.places.pairs(), self.judge.pairs()];
        let mut middle = [const { Vec::new() }; 2];
        let mut columns = [const { None }; 2];
        for (set, pairs) in sets.into_iter().enumerate() {
            let mut matrix = DMatrix::zeros(pairs.len(), 3 * training.len());
            let mut middles = Vec::with_capacity(pairs.len());
            for (row, &(incident, exitant)) in pairs.iter().enumerate() {
                let values = training.iter().flat_map(|&m| self.values[m][set][row].to_array());
                let mut values: Vec<f64> = values.collect();
                for (column, &f) in values.iter().enumerate() {
                    matrix[(row, column)] = f;
                }
                let half = values.len() / 2;
                let m = *values.select_nth_unstable_by(half, f64::total_cmp).1;
                let w = weight(incident, exitant);
                for column in 0..matrix.ncols() {
                    matrix[(row, column)] = mapped(matrix[(row, column)], m, w);
                }
                middles.push(m);
            }
            middle[set] = middles;
            columns[set] = Some(matrix);
        }
        let columns = columns.map(|matrix| matrix.expect("filled above"));
        let mean = columns.each_ref().map(DMatrix::column_mean);
        let mut centred = columns;
        for (matrix, mean) in centred.iter_mut().zip(&mean) {
            for mut column in matrix.column_iter_mut() {
                column -= mean;
            }
        }
        // X = U S Vᵀ, so U S = X V with the eigenvectors V of Xᵀ X: far smaller than X.
        let eigen = SymmetricEigen::new(centred[0].tr_mul(&centred[0]));
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        order.truncate(components.max(1));
        let vectors = eigen.eigenvectors.select_columns(&order);
        // Such that a coefficient has unit variance over the training.
        let unit = 1.0 / (3.0 * training.len() as f64).sqrt();
        Basis {
            middle,
            scaled: centred.map(|matrix| matrix * &vectors * unit),
            mean,
        }
    }

    fn reconstruct(&self, basis: &Basis, chosen: &[usize], material: usize) -> Vec<DVec3> {
        let k = chosen.len().min(basis.scaled[0].ncols());
        let at = DMatrix::from_fn(chosen.len(), k, |row, column| {
            basis.scaled[0][(chosen[row], column)]
        });
        let normal = at.tr_mul(&at) + DMatrix::<f64>::identity(k, k) * (ETA * chosen.len() as f64);
        let solver = normal.cholesky();
        let pairs = self.judge.pairs();
        let channel = |channel: usize| -> Vec<f64> {
            let readings = DVector::from_fn(chosen.len(), |row, _| {
                let place = chosen[row];
                let (incident, exitant) = self.places.pairs()[place];
                let f = self.values[material][0][place][channel];
                mapped(f, basis.middle[0][place], weight(incident, exitant)) - basis.mean[0][place]
            });
            let Some(solver) = &solver else {
                return vec![0.0; pairs.len()];
            };
            let coefficients = solver.solve(&at.tr_mul(&readings));
            let columns = basis.scaled[1].columns(0, k) * coefficients + &basis.mean[1];
            let back = |(row, &(incident, exitant)): (usize, &(DVec3, DVec3))| {
                let w = weight(incident, exitant);
                let f = (columns[row].exp() * (basis.middle[1][row] * w + EPSILON) - EPSILON) / w;
                f.max(0.0)
            };
            pairs.iter().enumerate().map(back).collect()
        };
        let [r, g, b] = [0, 1, 2].map(channel);
        (0..pairs.len())
            .map(|row| DVec3::new(r[row], g[row], b[row]))
            .collect()
    }
}

fn weight(incident: DVec3, exitant: DVec3) -> f64 {
    (incident.z * exitant.z).max(EPSILON)
}

fn mapped(f: f64, middle: f64, weight: f64) -> f64 {
    ((f * weight + EPSILON) / (middle * weight + EPSILON)).ln()
}

/// Rows by which the first `n` components are told apart best: pivots of QR with column pivoting of the transpose
/// (Gram–Schmidt, twice for orthogonality).
fn places(scaled: &DMatrix<f64>, n: usize) -> Vec<usize> {
    let mut rows = scaled.columns(0, n.min(scaled.ncols())).transpose();
    let mut chosen = Vec::new();
    for _ in 0..n.min(rows.nrows()) {
        let norm = |column: usize| rows.column(column).norm_squared();
        let best = (0..rows.ncols()).max_by(|&a, &b| norm(a).total_cmp(&norm(b)));
        let Some(best) = best.filter(|&best| norm(best) > 0.0) else {
            break;
        };
        chosen.push(best);
        let pivot = rows.column(best).normalize();
        for _ in 0..2 {
            for mut column in rows.column_iter_mut() {
                let along = column.dot(&pivot);
                column.axpy(-along, &pivot, 1.0);
            }
        }
    }
    chosen
}
