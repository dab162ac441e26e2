use std::error::Error;
use std::io;
use std::process::ExitCode;

use api::ClientError;
use session::Status;

use crate::error::CommandError;

/// Exit code of a finished command.
pub(crate) fn code(status: Status) -> ExitCode {
    ExitCode::from(status.code())
}

/// Exit status of an error, and the error in one line with all its causes.
pub(crate) fn failure(error: &anyhow::Error) -> (Status, String) {
    let status = error.chain().find_map(status).unwrap_or(Status::Invalid);
    (status, format!("{error:#}"))
}

/// What one error of a chain says about the exit code.
fn status(error: &(dyn Error + 'static)) -> Option<Status> {
    if let Some(error) = error.downcast_ref::<session::SessionError>() {
        return Some(error.status());
    }
    if let Some(error) = error.downcast_ref::<ClientError>() {
        return Some(match error {
            ClientError::Address { .. }
            | ClientError::TokenFile { .. }
            | ClientError::Authorities { .. }
            | ClientError::NoToken { .. } => Status::Invalid,
            ClientError::Refused(refused) if refused.invalid() => Status::Invalid,
            _ => Status::Daemon,
        });
    }
    if let Some(error) = error.downcast_ref::<CommandError>() {
        return Some(error.status());
    }
    let io = error.downcast_ref::<io::Error>()?;
    report::is_full(io).then_some(Status::Stopped)
}
