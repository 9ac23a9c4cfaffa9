//! Which build this is.

/// The version of the package.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The git revision it was built from, `-dirty` behind it where files were changed; `unknown` outside a checkout.
pub const GIT_REVISION: &str = env!("RELOOP_GIT_REVISION");
