//! What a service and its clients know. It is in the environment, `RELOOP_SECRET`, or in a file that its user alone can read: the service keeps
//! its own beside its queue, so that it stays the same when it is started again, and leaves a copy by the name of its endpoint where clients of
//! the same user look for it.

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

use results::files::{FileError, at};
use thiserror::Error;
use wire::keys::Secret;

/// A secret that is not to be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SecretError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("the system gives no randomness: {0}")]
    Random(io::Error),
    #[error(
        "the secret of the service at {0} is not known here\nhint: put it into RELOOP_SECRET; `sim serve` says where it is kept, and a service of your own on this machine needs none"
    )]
    Unknown(String),
}

/// The secret of the service whose own files are in `own`, and where it is kept; a new one where there is none yet.
///
/// # Errors
/// [`SecretError`].
pub fn of_service(own: &Path) -> Result<(Secret, Option<PathBuf>), SecretError> {
    if let Some(told) = Secret::of_this_process() {
        return Ok((told, None));
    }
    let path = own.join("secret");
    if let Some(kept) = read(&path)? {
        return Ok((kept, Some(path)));
    }
    let secret = Secret::random().map_err(SecretError::Random)?;
    write(&path, &secret)?;
    Ok((secret, Some(path)))
}

/// Leaves the secret where clients of the same user find it. Where they cannot, they are to be told it.
pub fn leave_for_clients(endpoint: &str, secret: &Secret) -> Option<PathBuf> {
    let path = for_clients(endpoint)?;
    write(&path, secret).ok()?;
    Some(path)
}

/// The secret of the service at `endpoint`, as a client knows it.
///
/// # Errors
/// [`SecretError`].
pub fn of_client(endpoint: &str) -> Result<Secret, SecretError> {
    if let Some(told) = Secret::of_this_process() {
        return Ok(told);
    }
    let found = for_clients(endpoint).map_or(Ok(None), |path| read(&path))?;
    found.ok_or_else(|| SecretError::Unknown(endpoint.to_owned()))
}

/// `$XDG_STATE_HOME/reloop/services/ENDPOINT`, or below `~/.local/state`.
fn for_clients(endpoint: &str) -> Option<PathBuf> {
    let folder = |variable: &str| std::env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
    let state = folder("XDG_STATE_HOME").or_else(|| Some(folder("HOME")?.join(".local/state")))?;
    let name: String = endpoint.chars().map(|c| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' }).collect();
    Some(state.join("reloop/services").join(name))
}

fn read(path: &Path) -> Result<Option<Secret>, FileError> {
    let text = results::files::read(path)?.map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    Ok(text.filter(|text| !text.is_empty()).map(|text| Secret::from(text.as_str())))
}

/// Writes it whole, for its user's eyes.
fn write(path: &Path, secret: &Secret) -> Result<(), FileError> {
    if let Some(folder) = path.parent() {
        DirBuilder::new().recursive(true).mode(0o700).create(folder).map_err(at("create", folder))?;
    }
    let partial = path.with_file_name(format!("{}.partial", path.file_name().unwrap_or_default().to_string_lossy()));
    // One that is there may be readable for others.
    let _ = fs::remove_file(&partial);
    let mut file =
        OpenOptions::new().write(true).create_new(true).mode(0o600).open(&partial).map_err(at("create", &partial))?;
    file.write_all(secret.reveal().as_bytes()).and_then(|()| file.sync_all()).map_err(at("write", &partial))?;
    fs::rename(&partial, path).map_err(at("rename", &partial))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn a_secret_is_kept_for_its_user_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own/secret");
        write(&path, &Secret::from("sesame")).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::metadata(path.parent().unwrap()).unwrap().permissions().mode() & 0o777, 0o700);
        write(&path, &Secret::from("semolina")).unwrap();
        assert_eq!(read(&path).unwrap(), Some(Secret::from("semolina")));
        assert_eq!(read(&folder.path().join("none")).unwrap(), None);
    }
}
