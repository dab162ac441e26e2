use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use rand::RngExt;
use serde::{Deserialize, Serialize};
use subtle::{Choice, ConstantTimeEq};
use utoipa::ToSchema;

/// Shortest token that is taken, characters: 128 bits in hexadecimal.
const SHORTEST: usize = 32;

/// What somebody may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Look at everything, change nothing.
    Watch,
    /// Everything.
    Operate,
}

/// Why a token file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TokenError {
    /// It cannot be read or made.
    #[error("cannot read or make the token file {}", .path.display())]
    File {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Others than its owner may read or write it.
    #[error("token file {path} has mode {mode:03o}, allowed is 600: `chmod 600 {path}`, and new tokens where others may have read it (remove the file)", path = .path.display())]
    Open {
        /// Where.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// It does not say what it should.
    #[error("token file {}: {why}", .path.display())]
    Text {
        /// Where.
        path: PathBuf,
        /// What is wrong in it.
        why: String,
    },
}

/// The bearer tokens of a token file, one for each role.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tokens {
    watch: String,
    operate: String,
}

impl Tokens {
    /// Reads a token file; where there is none, makes one with two new tokens that only its owner can read.
    ///
    /// # Errors
    /// A file that cannot be read or made, that others may read, or that is not two different tokens of at least 32
    /// characters.
    pub fn open(path: &Path) -> Result<Self, TokenError> {
        match File::open(path) {
            Ok(file) => Self::read(file, path),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Self::create(path),
            Err(source) => Err(failed(path)(source)),
        }
    }

    /// What the bearer of a token may do. Takes the same time for every token of the same length.
    pub fn role(&self, token: &str) -> Option<Role> {
        let equal = |known: &str| -> Choice { known.as_bytes().ct_eq(token.as_bytes()) };
        let (watch, operate) = (equal(&self.watch), equal(&self.operate));
        if bool::from(operate) {
            return Some(Role::Operate);
        }
        bool::from(watch).then_some(Role::Watch)
    }

    /// Returns a link that signs a browser in at an address as one who may operate. What stands behind `#` stays in the
    /// browser: it is in no request, so in no log and no proxy either.
    pub fn sign_in_link(&self, address: &str) -> String {
        format!("{address}/#token={}", self.operate)
    }

    fn read(mut file: File, path: &Path) -> Result<Self, TokenError> {
        let mode = file.metadata().map_err(failed(path))?.permissions().mode() & 0o777;
        if mode & 0o077 != 0 {
            let path = path.to_owned();
            return Err(TokenError::Open { path, mode });
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed(path))?;
        let wrong = |why: String| TokenError::Text {
            path: path.to_owned(),
            why,
        };
        let text = config::decode(bytes).map_err(|error| wrong(error.to_string()))?;
        let tokens: Self = config::parse(&text).map_err(|flaws| wrong(flaws.to_string()))?;
        for (key, token) in [("watch", &tokens.watch), ("operate", &tokens.operate)] {
            if token.len() < SHORTEST || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
                return Err(wrong(format!(
                    "{key} must be at least {SHORTEST} printable characters without blanks"
                )));
            }
        }
        if tokens.watch == tokens.operate {
            return Err(wrong("watch and operate must differ".to_owned()));
        }
        Ok(tokens)
    }

    fn create(path: &Path) -> Result<Self, TokenError> {
        let token = || {
            rand::rng()
                .random::<[u8; 32]>()
                .map(|byte| format!("{byte:02x}"))
                .concat()
        };
        let tokens = Self {
            watch: token(),
            operate: token(),
        };
        let text = format!(
            "# Bearer tokens of goniod: who has one may watch, or operate, the rig.\nwatch = \"{}\"\noperate = \"{}\"\n",
            tokens.watch, tokens.operate
        );
        let mut options = OpenOptions::new();
        let mut file = options
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(path)
            .map_err(failed(path))?;
        file.write_all(text.as_bytes())
            .and_then(|()| file.sync_all())
            .map_err(failed(path))?;
        Ok(tokens)
    }
}

fn failed(path: &Path) -> impl Fn(io::Error) -> TokenError {
    move |source| TokenError::File {
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_new_file_is_its_owners_alone_and_is_read_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("tokens.toml");
        let made = Tokens::open(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        let read = Tokens::open(&path).unwrap();
        assert_eq!(read.role(&made.operate), Some(Role::Operate));
        assert_eq!(read.role(&made.watch), Some(Role::Watch));
        assert_eq!(read.role(&made.watch[1..]), None);
        assert_eq!(read.role(""), None);
    }

    #[test]
    fn a_file_that_others_read_or_that_says_too_little_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("tokens.toml");
        let refused = |text: &str, mode: u32| {
            fs::write(&path, text).unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            Tokens::open(&path).err().unwrap().to_string()
        };
        let (a, b) = ("a".repeat(32), "b".repeat(32));
        let two = |a: &str, b: &str| format!("watch = \"{a}\"\noperate = \"{b}\"\n");
        assert!(refused(&two(&a, &b), 0o640).contains("mode 640, allowed is 600"));
        assert!(refused(&two("", &b), 0o600).contains("watch must be at least 32"));
        assert!(refused(&two(&a, &a), 0o600).contains("must differ"));
        assert!(refused("watch = 3", 0o600).contains("tokens.toml"));
    }
}
