"""What can go wrong, as exceptions. Each message says what to do."""


class ReloopError(Exception):
    """Anything that this package raises by itself."""


class NodeError(ReloopError):
    """A node cannot join its run, or is not let in."""


class AnswerError(ReloopError):
    """A plan or a prediction that the sim would refuse: what is wrong, and where."""


class ReadError(ReloopError):
    """A run's folder or a recording that cannot be read."""


class ServiceError(ReloopError):
    """A service refuses, and says why; or there is none."""
