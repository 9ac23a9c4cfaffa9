//! Who may say and hear what at the simulator's router, as Zenoh's access control.
//!
//! Zenoh asks every subject that a session matches, and **one that allows is enough**: what another denies is allowed then. So subjects
//! here either exclude each other, by the kind of link, or deny all the same but for what makes them differ. A rule holds for a key that
//! it includes whole, and a wildcard includes no chunk that begins with `@`.

use serde_json::{Value, json};

use crate::keys::Place;

/// The links of processes that share the simulator's user.
const INSIDE: &str = "unixsock-stream";

/// A seat that only the holders of certain certificates may take.
#[derive(Clone, Debug)]
pub struct Guarded {
    /// The seat.
    pub seat: Place,
    /// The common names of the certificates, one at least.
    pub names: Vec<String>,
}

/// The rules of a router; `certified` where a TLS link has a certificate at its far end.
pub(super) fn control(certified: bool, guarded: Option<&Guarded>) -> String {
    let mut rules = vec![
        // Who is no simulator may not show its token, nor answer in its place who asks for the run's settings or a scene.
        rule("answers", &["ingress"], &["declare_queryable", "reply"], &["**", "reloop/*/@tape/**"]),
        rule("token", &["ingress"], &["liveliness_token"], &["reloop/*/@node/sim/**"]),
        // Of who comes from outside nobody knows who it is, unless it has a certificate: it is not told what is driven.
        rule("tape", &["egress"], &["put", "reply"], &["reloop/*/@tape/**"]),
    ];
    let (trusted, strangers) =
        if certified { (vec![INSIDE, "tls"], vec!["tcp"]) } else { (vec![INSIDE], vec!["tcp", "tls"]) };
    let mut subjects = vec![
        json!({ "id": "trusted", "link_protocols": trusted }),
        json!({ "id": "strangers", "link_protocols": strangers }),
    ];
    let mut policies =
        vec![policy(&["answers", "token"], &["trusted", "strangers"]), policy(&["tape"], &["strangers"])];
    if let Some(Guarded { seat, names }) = guarded {
        // Its token is seen, and the door's word heard, by everybody: so that who is refused learns why.
        let keys = seat.everything();
        rules.push(rule("speak at the seat", &["ingress"], &["put", "delete"], &keys.each_ref().map(String::as_str)));
        rules.push(rule("hear at the seat", &["egress"], &["put", "delete"], &[&keys[0]]));
        subjects.push(json!({ "id": "named", "link_protocols": ["tls"], "cert_common_names": names }));
        policies.push(policy(&["speak at the seat", "hear at the seat"], &["trusted", "strangers"]));
        policies.push(policy(&["answers", "token"], &["named"]));
    }
    let enabled = json!({ "enabled": true, "default_permission": "allow", "rules": rules, "subjects": subjects, "policies": policies });
    enabled.to_string()
}

fn rule(id: &str, flows: &[&str], messages: &[&str], keys: &[&str]) -> Value {
    json!({ "id": id, "permission": "deny", "flows": flows, "messages": messages, "key_exprs": keys })
}

fn policy(rules: &[&str], subjects: &[&str]) -> Value {
    json!({ "rules": rules, "subjects": subjects })
}
