use std::fmt;

/// Why an arm may not be where it was sent, as far as its motion tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hindrance {
    /// It stands far from its goal.
    Obstacle,
    /// It stands near its goal and ignores small changes of it.
    Stiction,
    /// It follows changes of its goal and comes away from it again, or ends as far off.
    Load,
    /// It goes to and fro.
    Hunting,
    /// It goes on moving slowly.
    Creep,
}

impl fmt::Display for Hindrance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Obstacle => {
                "something blocks it, or the load is too great: look at the arm, its cable and its supply"
            }
            Self::Stiction => {
                "it ignores small changes of its goal, as stiction makes it: raise the servo's Position P Gain (84), or \
                 motion.near_deg"
            }
            Self::Load => {
                "it gives way under a load such as gravity, or friction holds it: balance the arm, raise the servo's Position \
                 P Gain (84), or motion.near_deg"
            }
            Self::Hunting => {
                "it goes to and fro, as an integral gain on friction makes it: lower the servo's Position I Gain (82), or \
                 raise motion.still_deg"
            }
            Self::Creep => {
                "it still creeps: raise motion.timeout_ms, or the servo's Position P Gain (84)"
            }
        })
    }
}
