//! What Zenoh and TLS say when nobody is let in, in words that tell what to do.

/// Why a simulator is not reached, and what to do about it.
pub(super) fn explained(said: &str) -> String {
    let other_authority = "it does not know the authority of this node's certificate\n  hint: take a certificate of the simulator's own \
                           authority; that is connect_certificate of --zenoh-config";
    let other_simulator = "the authority of its certificate is not known to this node\n  hint: that is root_ca_certificate of \
                           --zenoh-config; if it is right, somebody else listens there";
    let known = [
        (
            "CertificateRequired",
            "it lets in nobody without a certificate\n  hint: give this node one by --zenoh-config FILE (docs/hosts.md)",
        ),
        ("alert: UnknownCA", other_authority),
        // An authority of the same name, and another key.
        ("alert: DecryptError", other_authority),
        (
            "alert: CertificateExpired",
            "this node's certificate has expired\n  hint: take a new one; that is connect_certificate of --zenoh-config",
        ),
        ("alert: BadCertificate", "it refuses this node's certificate\n  hint: docs/hosts.md says what one must have"),
        (
            "alert: CertificateUnknown",
            "it refuses this node's certificate\n  hint: docs/hosts.md says what one must have",
        ),
        ("certificate: UnknownIssuer", other_simulator),
        ("certificate: BadSignature", other_simulator),
        (
            "certificate: certificate not valid for name",
            "its certificate is not for this name\n  hint: name it as its certificate does, --endpoint tls/NAME:PORT",
        ),
        (
            "certificate: NotValidForName",
            "its certificate is not for this name\n  hint: name it as its certificate does, --endpoint tls/NAME:PORT",
        ),
        (
            "certificate: certificate expired",
            "its certificate has expired\n  hint: whoever runs the simulator must renew it",
        ),
        (
            "Permission denied",
            "it belongs to another user of this machine\n  hint: whoever runs the simulator can let others in by --endpoint",
        ),
        (
            "early eof",
            "it hung up\n  hint: does it speak TLS? Then it is --endpoint tls/NAME:PORT, with a --zenoh-config",
        ),
        (
            "InvalidContentType",
            "it does not speak TLS\n  hint: then it is --endpoint tcp/HOST:PORT, and nothing there is encrypted",
        ),
    ];
    let meaning = known.iter().find(|(what, _)| said.contains(what)).map(|(_, meaning)| (*meaning).to_owned());
    let nobody = ["Connection refused", "No such file"].iter().any(|what| said.contains(what));
    meaning.unwrap_or_else(|| {
        let said = if nobody { "nobody listens there" } else { said };
        format!("{said}\n  hint: `sim run -v` names its endpoint in its log; is the run still on?")
    })
}

/// What the log of Zenoh's TLS links means when somebody was not let in. Zenoh says neither who it was, nor anything that helps: its own
/// hint is to allow more open files.
#[must_use]
pub fn refused_by_tls(said: &str) -> Option<String> {
    let said = said.strip_suffix(". Hint: increase the system open file limit.")?;
    let known = [
        ("peer sent no certificates", "it has no certificate"),
        ("UnknownIssuer", "its certificate is not of our authority"),
        ("BadSignature", "its certificate is not of our authority"),
        ("UnknownCA", "it does not know the authority of our certificate"),
        ("DecryptError", "it does not know the authority of our certificate"),
        ("Expired", "its certificate has expired"),
        ("InvalidContentType", "it does not speak TLS"),
    ];
    let why = known.iter().find(|(what, _)| said.contains(what)).map_or(said, |(_, why)| why);
    Some(format!("somebody who came by TLS is refused: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_zenoh_says_is_told_in_words_that_help() {
        let without = explained("received fatal alert: CertificateRequired");
        assert!(without.contains("without a certificate") && without.contains("hint: "), "{without}");
        assert!(explained("Connection refused (os error 111)").starts_with("nobody listens there\n  hint: "));
        assert!(explained("No route to host").starts_with("No route to host\n  hint: "));
        let sim = refused_by_tls("invalid peer certificate: UnknownIssuer. Hint: increase the system open file limit.");
        assert_eq!(
            sim.as_deref(),
            Some("somebody who came by TLS is refused: its certificate is not of our authority")
        );
        assert_eq!(refused_by_tls("Accepted"), None);
    }
}
