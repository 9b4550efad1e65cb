"""One recording of a scenario: what a task of ``echoset simulate`` does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ..formats import write
from ..formats.provenance import versions
from ..models.checks import in_range
from ..models.errors import ParameterError
from ..models.parameters import as_dict
from ..models.random import generator
from ..models.registry import load
from .batch import resume
from .batch.execution import Execution
from .files.outputs import Target
from .progress import announce_compilation
from .scenarios import GROUP, Scenario


@dataclass(frozen=True, slots=True)
class Task:
    """One recording to be simulated, called ``label``."""

    label: str
    scenario: Scenario
    parameters: Any
    seed: int
    number: int
    target: Target

    @property
    def sources(self) -> tuple[str | None]:
        """The file of the scenario, if it has one."""
        return (self.scenario.file,)

    def placed(self, execution: Execution) -> Task:
        """The task with the paths of the workers."""
        return replace(self, target=execution.target(self.target))

    def decide(self) -> resume.Decision:
        """Whether the recording has to be made."""
        return resume.decide(self.target, lambda: {"name": self.label, **self._provenance()})

    def run(self) -> None:
        """Simulate the recording and write it."""
        module = load(GROUP, self.scenario.name)
        announce_compilation()
        rng = generator(self.seed, "simulate", self.label)
        reason = f"{self.label}: its parameters lead to numbers that are out of range"
        with in_range(ParameterError, reason):
            recording = module.simulate(self.parameters, rng, self.label)
        provenance = {**recording.meta.provenance, **self._provenance()}
        meta = replace(recording.meta, provenance=provenance)
        with self.target.open() as target:
            write(replace(recording, meta=meta), target, self.target.format)

    def _provenance(self) -> dict[str, Any]:
        return {
            "scenario": self.scenario.name,
            "parameters": as_dict(self.parameters),
            "seed": self.seed,
            "run": self.number,
            "versions": versions(),
        }
