"""Opening the bus session of a node, and why there is none."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import zenoh

from .errors import NodeError
from .options import Options

#: How long a node tries to reach the sim (s).
_CONNECT_TIMEOUT = 5.0
#: How long either side may give no sign of life (ms): a month, which is to say for ever. A death is seen by the closed
#: connection; who is silent and not dead was paused.
_LEASE = 30 * 24 * 3600 * 1000
#: One thread for all that Zenoh does, as ``wire/src/session/threads.rs`` has it.
_ONE_THREAD = (
    "(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), app: (handover: rx), net: (handover: rx))"
)
#: Fields of ``transport/link/tls`` that name files.
_FILES = (
    "root_ca_certificate",
    "listen_private_key",
    "listen_certificate",
    "connect_private_key",
    "connect_certificate",
)
_OTHER_AUTHORITY = (
    "it does not know the authority of this node's certificate\n"
    "  hint: take a certificate of the sim's own authority; that is connect_certificate of --zenoh-config"
)
_OTHER_SIM = (
    "the authority of its certificate is not known to this node\n"
    "  hint: that is root_ca_certificate of --zenoh-config; if it is right, somebody else listens there"
)
#: What Zenoh says, and what it means.
_MEANINGS = {
    "CertificateRequired": "it lets in nobody without a certificate\n"
    "  hint: give this node one by --zenoh-config FILE (docs/hosts.md)",
    "alert: UnknownCA": _OTHER_AUTHORITY,
    # An authority of the same name, and another key.
    "alert: DecryptError": _OTHER_AUTHORITY,
    "alert: CertificateExpired": "this node's certificate has expired\n"
    "  hint: take a new one; that is connect_certificate of --zenoh-config",
    "certificate: UnknownIssuer": _OTHER_SIM,
    "certificate: BadSignature": _OTHER_SIM,
    "not valid for name": "its certificate is not for this name\n"
    "  hint: name it as its certificate does, --endpoint tls/NAME:PORT",
    "Permission denied": "it belongs to another user of this machine\n"
    "  hint: whoever runs the sim can let others in by --endpoint",
    "early eof": "it hung up\n  hint: does it speak TLS? Then it is --endpoint tls/NAME:PORT, with a --zenoh-config",
}


def open_session(options: Options) -> zenoh.Session:
    """A client session of the sim's router.

    Raises ``NodeError`` where there is none, or the Zenoh configuration cannot be used.
    """
    settings = {
        "mode": "client",
        "connect/endpoints": [options.endpoint],
        "connect/timeout_ms": int(_CONNECT_TIMEOUT * 1000),
        "connect/exit_on_failure": True,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "timestamping/enabled": False,
        "transport/link/tx/lease": _LEASE,
        # As long for a sim that takes nothing, because it is paused (µs).
        "transport/link/tx/queue/congestion_control/block/wait_before_close": _LEASE * 1000,
    }
    try:
        return zenoh.open(config(options.zenoh_config, settings))
    except zenoh.ZError as error:
        said = _reason(error)
    # A client says no more than that it gave up. A peer that tries once and listens nowhere says why.
    try:
        zenoh.open(config(options.zenoh_config, settings | {"mode": "peer", "connect/timeout_ms": 0})).close()  # type: ignore[no-untyped-call]
    except zenoh.ZError as error:
        said = _reason(error)
    meaning = next((meaning for what, meaning in _MEANINGS.items() if what in said), None)
    if "Connection refused" in said or "No such file" in said:
        said = "nobody listens there"
    hint = "\n  hint: is the run still on? `sim run -v` names its endpoint in its log"
    raise NodeError(f"cannot reach a sim at {options.endpoint}: {meaning or said + hint}")


def config(zenoh_config: str | None, settings: dict[str, Any]) -> zenoh.Config:
    """The user's own configuration, a file of Zenoh's (JSON5) if there is one, and over it ``settings``.

    Raises ``NodeError`` where the file cannot be used.
    """
    if any(endpoint.startswith("tls/") for endpoint in settings["connect/endpoints"]):
        # In Zenoh 1.10.2 a connection by TLS that one thread reads while another writes is lost.
        # Read when Zenoh is first used.
        os.environ.setdefault("ZENOH_RUNTIME", _ONE_THREAD)
    made = zenoh.Config() if zenoh_config is None else _users(Path(zenoh_config))
    for key, value in settings.items():
        made.insert_json5(key, json.dumps(value))
    return made


def _users(path: Path) -> zenoh.Config:
    """The user's own configuration; names of files in it are looked for beside it."""
    # A value may be a secret: what Zenoh shows of one is left out.
    try:
        config = zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        reason = _reason(error).split("string ", 1)[0]
        raise NodeError(f"{path}: {reason}\n  hint: docs/hosts.md has examples") from None
    for field in _FILES:
        key = f"transport/link/tls/{field}"
        name = json.loads(config.get_json(key))
        if name is None:
            continue
        file = path.resolve().parent / name
        if not file.is_file():
            raise NodeError(f"{path}: {key}: there is no file {file}")
        config.insert_json5(key, json.dumps(str(file)))
    return config


def _reason(error: Exception) -> str:
    """What the transport says, without the line of its source that it ends with."""
    text = str(error)
    end = text.find(" at /")
    return text[:end] if end >= 0 and ".rs:" in text[end:] else text
