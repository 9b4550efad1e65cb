"""One file of estimates against its truth: what a task of ``echoset score`` does."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ..formats.provenance import versions
from ..metrics.table import concatenate
from ..models import registry
from ..models.errors import InputError, ParameterError
from ..models.parameters import as_dict, resolve, sensor_model, suggestion
from ..models.records import Estimates, Recording, Scores
from . import inputs, log, truth
from .config import Layer
from .progress import announce_compilation

GROUP = "echoset.metrics"
Layers = dict[str, tuple[Layer, ...]]


@dataclass(frozen=True, slots=True)
class Task:
    """Estimates to be scored by metrics, each with its layers of parameters.

    Metrics that do not apply are left out unless all are ``required``.
    """

    source: str
    truth: tuple[str, ...]
    metrics: Layers
    required: bool
    target: None = None

    @property
    def label(self) -> str:
        """The input as the user named it."""
        return inputs.label(self.source)


def score(task: Task) -> Scores:
    """The scores of one file of estimates.

    Raises
    ------
    InputError : it is damaged, has no truth, or lacks what a metric needs
    ParameterError : an impossible parameter
    """
    estimates = inputs.read_estimates(task.source)
    recording = truth.find(estimates, task.label, task.truth)
    tables, refused, used = [], [], {}
    single = not task.required and _is_one_object(estimates, recording)
    for name, user in task.metrics.items():
        metric = registry.load(GROUP, name)
        if metric.FOR_SETS and single:
            continue
        announce_compilation()
        params = resolve(metric.Params, *sensor_model(recording, metric.Params), *user)
        try:
            tables.append(metric.score(estimates, recording, params))
            used[name] = as_dict(params)
        except InputError as error:
            if task.required:
                raise
            refused.append(error)
            log.logger.info("%s: without %s: %s", task.label, name, error)
    if not tables:
        raise refused[0]
    return replace(concatenate(tables), provenance={"metrics": used, "versions": versions()})


def _is_one_object(estimates: Estimates, recording: Recording) -> bool:
    """Whether truth and estimates hold exactly one object all the time."""
    sets = [estimates.objects, *([recording.truth.objects] if recording.truth else [])]
    return all((o.row_offset[1:] - o.row_offset[:-1] == 1).all() for o in sets)


def layers(names: Iterable[str], user: Iterable[Layer]) -> Layers:
    """The user's layers for each metric: what is said for all, then for it by ``<metric>.<name>``.

    Raises
    ------
    ParameterError : an unknown metric, or a parameter that none of the metrics has
    """
    fields = {name: set(registry.load(GROUP, name).Params.__dataclass_fields__) for name in names}
    found: dict[str, list[Layer]] = {name: [] for name in fields}
    metrics, parameters = set(registry.names(GROUP)), set[str]().union(*fields.values())
    for source, values in user:
        own = {
            key: value or {}
            for key, value in values.items()
            if (isinstance(value, dict) and key not in parameters)
            or (value is None and key in metrics)
        }
        shared = {key: value for key, value in values.items() if key not in own}
        for keys, among in ((own, metrics), (shared, parameters)):
            for key in keys:
                if key not in among:
                    kind = "metric" if keys is own else "parameter"
                    hint = suggestion(key, among)
                    raise ParameterError(f"{source}: unknown {kind} {key!r}{hint}")
        for name, mine in found.items():
            mine.append((source, {k: v for k, v in shared.items() if k in fields[name]}))
            mine.append((f"{source}: {name}", own.get(name, {})))
    return {name: tuple(mine) for name, mine in found.items()}
