//! A journal becomes a run directory: readings, factors, BRDF, pictures and checks.
