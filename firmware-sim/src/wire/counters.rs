use super::instruction::Write;

/// Goal Position of the X series, and its length.
pub(super) const GOAL_POSITION: (u16, u16) = (116, 4);

/// What passed over the wire so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bytes from the host.
    pub bytes_in: u64,
    /// Good packets from the host.
    pub packets: u64,
    /// Frames from the host whose CRC or length was wrong.
    pub damaged: u64,
    /// Good packets that no device heard: all deaf, or the wrong baud rate.
    pub unheard: u64,
    /// Goal positions among the packets, by any kind of write: motions commanded.
    pub goals: u64,
    /// Status packets to the host, whole or not.
    pub replies: u64,
    /// Status packets that a fault changed or made late.
    pub hurt: u64,
    /// Requests that a fault changed or swallowed.
    pub requests_hurt: u64,
    /// Status packets that a fault swallowed.
    pub dropped: u64,
}

impl Counters {
    /// Counts a good packet from the host, with the writes in it; `goal` says where a device has its Goal Position.
    pub(super) fn note(&mut self, writes: &[Write<'_>], unheard: bool, goal: impl Fn(u8) -> u16) {
        self.packets += 1;
        self.unheard += u64::from(unheard);
        let sets_goal = |write: &&Write<'_>| {
            let (from, to) = (
                usize::from(write.address),
                usize::from(write.address) + write.bytes.len(),
            );
            let goal = usize::from(goal(write.id));
            from < goal + usize::from(GOAL_POSITION.1) && to > goal
        };
        self.goals += writes.iter().filter(sets_goal).count() as u64;
    }
}
