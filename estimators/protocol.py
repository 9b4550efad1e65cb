"""What an estimator is: a module or object with these names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Protocol

import numpy as np

from ..models.records import Estimates, Recording, Scan


class Estimator(Protocol):
    """An estimator as the entry-point group ``echoset.estimators`` finds it.

    ``SUMMARY`` : one line for ``echoset list``
    ``STREAMS`` : the stream kinds that it can process
    ``PRESETS`` : named sets of parameters
    ``Params`` : frozen dataclass of parameters (see :mod:`echoset.models.parameters`); those
    whose name stands in a stream's ``model`` take their value from there

    One whose parameters differ from stream to stream has ``resolved(Params, setup, stated,
    layers)``, which makes the parameters of a recording from what its streams state and what the
    user says; others are resolved for all streams at once.

    One that can smooth has the parameter ``smooth`` (:mod:`.kernels.passes`), which ``--smooth``
    sets, and yields then what is known of each time at the end, or a lag later.

    One that reads files beside the recording has ``files(setup, params)``, which names them by the
    parameters that they belong to: their digests stand in the provenance. A parameter with a path
    has the unit ``file``.

    One that measures what could be known at best declares ``USES_TRUTH``: its ``setup`` is the
    whole recording, truth and origins included.
    """

    SUMMARY: str
    STREAMS: tuple[str, ...]
    PRESETS: Mapping[str, Mapping[str, Any]]
    Params: type[Any]

    def estimate(
        self, setup: Recording, scans: Iterable[Scan], params: Any, rng: np.random.Generator
    ) -> Iterator[Estimates]:
        """Yield the estimates of each step, in order of time, as records of one time each.

        ``setup`` is the recording without scans and truth. Only ``objects`` and ``steps`` of what
        is yielded count; the caller sets the provenance.

        Raises
        ------
        InputError : the recording lacks what the estimator needs
        EstimatorError : the estimate is not finite, or all weights vanish
        """
        ...
