#!/usr/bin/env bash
# version: eclipse-zenoh 1.10.2 (PyPI)
# Zenoh's access control lets through what a rule denies, in two ways that nobody would guess. The default permission is "allow" in both.
# 1. A rule denies everybody a key. Another subject, which a session matches too, has a rule about something else. Expected: what is denied
#    stays denied. Seen: the session may, for one subject that does not deny is enough.
# 2. A rule denies subscribers on demo/*/@seat/**. Expected: nobody hears what is put there. Seen: a subscriber on **/@seat/** does, for a
#    rule holds for a key expression that it includes whole. Denying what goes out (egress, put) holds.
# What we do: the subjects of our rules exclude each other or deny the same, a user's own rules are refused, and what is to be heard by
# nobody else is stopped on its way out (wire/src/session/access.rs).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet eclipse-zenoh==1.10.2
venv/bin/python - <<'PY'
import json
import socket
import sys
import time

import zenoh


def heard(rules, subjects, policies, key, selector):
    """Whether a client that subscribes to ``selector`` hears what the router puts under ``key``."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    control = {"enabled": True, "default_permission": "allow", "rules": rules, "subjects": subjects, "policies": policies}

    def session(**settings):
        config = zenoh.Config()
        config.insert_json5("scouting/multicast/enabled", "false")
        for name, value in settings.items():
            config.insert_json5(name.replace("__", "/"), json.dumps(value))
        return zenoh.open(config)

    with session(mode="router", listen__endpoints=[endpoint], access_control=control) as router:
        with session(mode="client", connect__endpoints=[endpoint]) as client:
            came = []
            subscriber = client.declare_subscriber(selector, lambda sample: came.append(sample))
            time.sleep(0.3)
            router.put(key, "x")
            time.sleep(0.3)
            subscriber.undeclare()
    return bool(came)


def deny(name, flow, message, key):
    return {"id": name, "permission": "deny", "flows": [flow], "messages": [message], "key_exprs": [key]}


everybody, by_tcp = {"id": "everybody"}, {"id": "by tcp", "link_protocols": ["tcp"]}
secret, other = deny("secret", "egress", "put", "demo/secret"), deny("other", "egress", "put", "demo/other")
of_all = {"rules": ["secret"], "subjects": ["everybody"]}
alone = heard([secret], [everybody], [of_all], "demo/secret", "demo/secret")
beside = {"rules": ["other"], "subjects": ["by tcp"]}
both = heard([secret, other], [everybody, by_tcp], [of_all, beside], "demo/secret", "demo/secret")
print(f"denied to everybody: heard {alone}; with a rule for TCP about another key: heard {both}")

listen, tell = deny("seat", "ingress", "declare_subscriber", "demo/*/@seat/**"), deny("seat", "egress", "put", "demo/*/@seat/**")
of_all = {"rules": ["seat"], "subjects": ["everybody"]}
exact, wide, out = (
    heard([rule], [everybody], [of_all], "demo/a/@seat/b", selector)
    for rule, selector in ((listen, "demo/a/@seat/b"), (listen, "**/@seat/**"), (tell, "**/@seat/**"))
)
print(f"subscribers denied: by the same key heard {exact}, by a wider one {wide}; what goes out denied: {out}")
sys.exit(0 if (alone, both, exact, wide, out) == (False, True, False, True, False) else 1)
PY
