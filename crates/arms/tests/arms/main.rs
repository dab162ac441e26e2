//! Motions keep their laws, and the envelope lets nothing past.

mod envelope;
mod motion;
