//! Where a service is asked: a key that only who knows its secret can say.

use super::{KeyError, ROOT, Secret, check};

/// The version of what a service is asked and answers; raise it with every change that an older client would misread.
pub const SERVICE_VERSION: u32 = 1;

const SERVICE: &str = "@service-";
const ASK: &str = "ask";

/// The place of a service on its bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceKey(Secret);

impl ServiceKey {
    /// The service behind `secret`.
    ///
    /// # Errors
    /// [`KeyError`] where the secret cannot be part of a key.
    pub fn new(secret: Secret) -> Result<Self, KeyError> {
        // The error does not hold the secret: it will be shown.
        match check("secret", secret.reveal()) {
            Ok(_) => Ok(Self(secret)),
            Err(_) => Err(KeyError { what: "the secret", text: "***".to_owned() }),
        }
    }

    /// Where it is asked in this version.
    #[must_use]
    pub fn ask(&self) -> String {
        self.versioned(&SERVICE_VERSION.to_string())
    }

    /// Selects where it is asked in any version.
    #[must_use]
    pub fn ask_in_any_version(&self) -> String {
        self.versioned("*")
    }

    fn versioned(&self, version: &str) -> String {
        format!("{ROOT}/{SERVICE}{}/{version}/{ASK}", self.0.reveal())
    }
}

#[cfg(test)]
mod tests {
    use zenoh::key_expr::KeyExpr;

    use super::*;

    #[test]
    fn a_service_is_found_by_its_secret_alone() {
        let key = ServiceKey::new(Secret::from("sesame")).unwrap();
        let intersects = |one: &str, other: &str| {
            KeyExpr::try_from(one.to_owned()).unwrap().intersects(&KeyExpr::try_from(other.to_owned()).unwrap())
        };
        assert!(intersects(&key.ask_in_any_version(), &key.ask()));
        assert!(!intersects("**", &key.ask()) && !intersects("reloop/**", &key.ask()));
        let error = ServiceKey::new(Secret::from("sword/fish")).unwrap_err();
        assert!(!error.to_string().contains("sword"), "{error}");
    }
}
