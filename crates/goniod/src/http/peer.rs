use std::fmt;
use std::io;
use std::net::SocketAddr;

use tokio::net::UnixStream;

use super::peer_groups::peer_groups;

/// Who is at the other end of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Peer {
    /// Somebody at an address. It says nothing about who it is: a proxy on this computer has a loopback address.
    Tcp(SocketAddr),
    /// A user of this computer, on the Unix socket.
    Local {
        /// User id; `None` where the system does not say.
        uid: Option<u32>,
        /// Whether this user may operate the rig without a token.
        operates: bool,
    },
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.ip().fmt(f),
            Self::Local { uid: Some(uid), .. } => write!(f, "user {uid} of this computer"),
            Self::Local { uid: None, .. } => f.write_str("a user of this computer"),
        }
    }
}

/// What the system says of a process that connected to a Unix socket, as it was when it did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LocalUser {
    pub(crate) uid: u32,
    gid: u32,
    groups: Vec<u32>,
}

impl LocalUser {
    /// Who connected.
    pub(crate) fn of(stream: &UnixStream) -> io::Result<Self> {
        let credentials = stream.peer_cred()?;
        Ok(Self {
            uid: credentials.uid(),
            gid: credentials.gid(),
            groups: peer_groups(stream)?,
        })
    }

    /// Whether this is root, the user `owner`, or a member of the group `group`.
    pub(crate) fn is_one_of(&self, owner: u32, group: u32) -> bool {
        self.uid == 0 || self.uid == owner || self.gid == group || self.groups.contains(&group)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_the_owner_and_the_group_are_told_from_others() {
        let user = |uid, gid, groups: &[u32]| LocalUser {
            uid,
            gid,
            groups: groups.to_vec(),
        };
        for (who, user, operates) in [
            ("root", user(0, 5, &[]), true),
            ("the owner", user(1000, 5, &[]), true),
            ("the group", user(1001, 1000, &[]), true),
            (
                "a further member of the group",
                user(1001, 1001, &[7, 1000]),
                true,
            ),
            ("a stranger", user(1001, 1001, &[7]), false),
            ("a user with the number of the group", user(2000, 5, &[]), false),
            ("a group with the number of the owner", user(5, 5, &[1001]), false),
        ] {
            assert_eq!(
                user.is_one_of(1000, if who.contains("number of the") { 2000 } else { 1000 }),
                operates,
                "{who}"
            );
        }
    }

    #[tokio::test]
    async fn the_system_says_who_connects_with_all_groups() {
        let (here, _there) = UnixStream::pair().unwrap();
        let user = LocalUser::of(&here).unwrap();
        assert_eq!(user.uid, rustix::process::geteuid().as_raw());
        assert_eq!(user.gid, rustix::process::getegid().as_raw());
        let mut groups: Vec<u32> = rustix::process::getgroups()
            .unwrap()
            .iter()
            .map(|group| group.as_raw())
            .collect();
        let mut found = user.groups;
        groups.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, groups);
    }
}
