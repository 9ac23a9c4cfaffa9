"""How a service is to drive: the options of ``sim run``, as its message."""

from __future__ import annotations

from typing import Any

from . import messages

#: Settings that are lists.
_LISTS = frozenset({"set", "scenes", "traffic_set"})


def settings(**options: Any) -> Any:
    """The message ``Settings`` of these options, with underlines for dashes.

    Raises ``TypeError`` where one is no option.
    """
    made = messages.service("Settings")()
    known = made.DESCRIPTOR.fields_by_name
    for option, value in options.items():
        if option not in known:
            raise TypeError(f"{option!r} is no setting; there are {', '.join(known)}")
        if option in _LISTS:
            getattr(made, option).extend([value] if isinstance(value, str) else value)
        elif value is not None:
            setattr(made, option, value)
    return made
