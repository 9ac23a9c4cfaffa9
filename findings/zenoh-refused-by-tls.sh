#!/usr/bin/env bash
# version: eclipse-zenoh 1.10.2 (PyPI); needs openssl
# A Zenoh client without a certificate at a router that wants one. Expected: an error that says so. Seen: "Timeout!" after all of its
# timeout, and in the router's log a hint to increase the limit of open files. A peer that tries once (timeout_ms 0) hears the reason.
# What we do: after a client has given up we ask once more as a peer that listens nowhere, for the reason alone, and the sim says in its own
# words what Zenoh's log says (wire/src/session/refusal.rs).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout ca-key.pem -out ca.pem -subj /CN=ca -days 2 2> /dev/null
openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout router-key.pem -subj /CN=router -out router.csr 2> /dev/null
printf 'subjectAltName=DNS:localhost\nbasicConstraints=CA:FALSE\n' > extensions
openssl x509 -req -in router.csr -CA ca.pem -CAkey ca-key.pem -days 2 -out router.pem -extfile extensions 2> /dev/null
python3 -m venv venv
venv/bin/pip install --quiet eclipse-zenoh==1.10.2
cat > client.py <<'PY'
import json
import socket
import sys

import zenoh

zenoh.init_log_from_env_or("warn")
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    endpoint = f"tls/localhost:{free.getsockname()[1]}"


def session(**settings):
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    for name, value in settings.items():
        config.insert_json5(name.replace("__", "/"), json.dumps(value))
    return zenoh.open(config)


def refused(mode, timeout):
    try:
        session(
            mode=mode,
            connect__endpoints=[endpoint],
            listen__endpoints=[],
            connect__timeout_ms=timeout,
            connect__exit_on_failure=True,
            transport__link__tls={"root_ca_certificate": "ca.pem"},
        ).close()
        return "let in"
    except zenoh.ZError as error:
        return str(error).split(" at /")[0]


own = {"root_ca_certificate": "ca.pem", "listen_certificate": "router.pem", "listen_private_key": "router-key.pem"}
with session(mode="router", listen__endpoints=[endpoint], transport__link__tls=own | {"enable_mtls": True}):
    client, peer = refused("client", 1500), refused("peer", 0)
print(f"client: {client}\npeer:   {peer}")
sys.exit(0 if "Timeout!" in client and "CertificateRequired" in peer else 1)
PY
venv/bin/python client.py > said
grep '^client\|^peer' said
grep -o 'peer sent no certificates. Hint: .*' said | head -1
