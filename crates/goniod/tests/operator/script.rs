//! What operators, clients, the store and the devices do.

use std::time::Duration;

/// Something that happens to the daemon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Op {
    Stop,
    Estop,
    Pause,
    Proceed,
    Finish,
    /// Names the fault that is shown when it is sent.
    Acknowledge,
    /// A job whose file says that its specimen lies on the stage.
    Submit,
    /// For the first job that waits.
    Ready,
    /// The first job that was interrupted.
    Resume,
    /// The first job that can be given up.
    Cancel,
    Jog,
    Park,
    StorePaused,
    StoreFailing,
    StorePrompt,
    DeviceSilent,
    /// The program is killed, the devices live on, and it is started again.
    Restart,
}

impl Op {
    pub(crate) const ALL: [Self; 17] = [
        Self::Stop,
        Self::Estop,
        Self::Pause,
        Self::Proceed,
        Self::Finish,
        Self::Acknowledge,
        Self::Submit,
        Self::Ready,
        Self::Resume,
        Self::Cancel,
        Self::Jog,
        Self::Park,
        Self::StorePaused,
        Self::StoreFailing,
        Self::StorePrompt,
        Self::DeviceSilent,
        Self::Restart,
    ];

    /// Whether it asks for a motion.
    pub(crate) const fn asks_to_move(self) -> bool {
        matches!(
            self,
            Self::Submit | Self::Ready | Self::Resume | Self::Jog | Self::Park
        )
    }

    /// Whether it stops what moves, once it is answered.
    pub(crate) const fn stops(self) -> bool {
        matches!(self, Self::Stop | Self::Estop)
    }
}

/// When the next thing happens after one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Delay {
    /// Once everything else could run so often.
    Turns(u32),
    /// After so long.
    Time(Duration),
}

/// What happens, and how long after each the next thing does.
pub(crate) type Script = Vec<(Op, Delay)>;
