"""Errors that end a command, each with the exit code that the command line gives it."""

from __future__ import annotations

_LONGEST, _END = 500, 100


class EchosetError(Exception):
    """Base of every error that is the user's or the data's, never ours."""

    exit_code = 1

    def __str__(self) -> str:
        """The message on one line of bearable length, whatever it quotes."""
        text = " ".join(super().__str__().split())
        return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}...{text[-_END:]}"


class ParameterError(EchosetError):
    """An unknown, malformed or impossible parameter, option or name."""

    exit_code = 2


class InputError(EchosetError):
    """An input that is readable but lacks what is needed."""

    exit_code = 4


class FormatError(InputError):
    """A file that is damaged, hostile or of another kind.

    Parameters
    ----------
    path : file as the user named it
    where : place in the file: a dataset, topic, line or offset; empty if it is the file itself
    reason : what is wrong there
    """

    def __init__(self, path: object, where: str, reason: str) -> None:
        self.path, self.where, self.reason = str(path), where, reason
        super().__init__(": ".join(part for part in (self.path, where, reason) if part))

    def __reduce__(self) -> tuple[type[FormatError], tuple[str, str, str]]:
        return FormatError, (self.path, self.where, self.reason)


class OutputError(EchosetError):
    """An output that exists already or cannot be written."""

    exit_code = 5


class EstimatorError(EchosetError):
    """An estimator that diverged or produced something not finite."""

    exit_code = 7


class UnavailableError(EchosetError):
    """A lock is held, or a cluster cannot be reached: the command may be tried again later."""

    exit_code = 75
