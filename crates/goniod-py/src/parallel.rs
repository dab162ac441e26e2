use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::PyResult;
use rayon::prelude::*;

use crate::directions::{Pairs, all_units};

/// Pairs that one core works at without a break: few enough that they and their results stay in its cache while they are
/// checked and then evaluated.
const CHUNK: usize = 512;
/// Pairs that the caller's own thread works at: waking another one takes as long as a thousand of them.
const ALONE: usize = 8 * CHUNK;

/// Directions to the light and to the viewer, as many of either.
type Halves<'a> = (&'a [[f64; 3]], &'a [[f64; 3]]);

/// One result a pair, on all cores.
///
/// # Errors
/// A direction is no unit vector.
pub(crate) fn fill<T: Copy + Default + Send>(
    pairs: &Pairs<'_>,
    one: impl Fn(&[[f64; 3]], &[[f64; 3]], &mut [T]) + Sync,
) -> PyResult<Vec<T>> {
    let mut results = vec![T::default(); pairs.incident.len()];
    fill_in(pairs, &mut results, one)?;
    Ok(results)
}

/// Fills one result a pair in, on all cores.
///
/// # Errors
/// A direction is no unit vector; what was filled in means nothing then.
pub(crate) fn fill_in<T: Send>(
    pairs: &Pairs<'_>,
    results: &mut [T],
    one: impl Fn(&[[f64; 3]], &[[f64; 3]], &mut [T]) + Sync,
) -> PyResult<()> {
    let good = AtomicBool::new(true);
    let chunk = |((incident, exitant), results): (Halves<'_>, &mut [T])| {
        if all_units(incident) && all_units(exitant) {
            one(incident, exitant, results);
        } else {
            good.store(false, Ordering::Relaxed);
        }
    };
    let (incident, exitant) = (&pairs.incident, &pairs.exitant);
    if results.len() <= ALONE || rayon::current_num_threads() == 1 {
        let chunks = incident.chunks(CHUNK).zip(exitant.chunks(CHUNK));
        chunks.zip(results.chunks_mut(CHUNK)).for_each(chunk);
    } else {
        let chunks = incident.par_chunks(CHUNK).zip(exitant.par_chunks(CHUNK));
        let chunks = chunks.with_min_len(ALONE / CHUNK);
        chunks.zip(results.par_chunks_mut(CHUNK)).for_each(chunk);
    }
    match good.into_inner() {
        true => Ok(()),
        false => Err(pairs.complaint()),
    }
}
