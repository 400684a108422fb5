"""Car-STAGE: labelled, verified, multi-sensor driving datasets from the CARLA simulator.

What is listed here is imported when it is first used. Nothing is imported eagerly: the collector,
which may run under the old Python of an old ``carla`` wheel, imports this package too.

Example:
    >>> import carstage
    >>> result = carstage.run("config.yaml", "datasets/first")
    >>> carstage.validate(result.dataset).ok
    True
    >>> carstage.export("coco", result.dataset, "exports/coco").frames
    50
"""

from __future__ import annotations

__version__ = "0.1.0"

# The type checkers' own name, without an import of `typing`.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from carstage.config import Config, load_config
    from carstage.dataset import Dataset
    from carstage.errors import CarStageError
    from carstage.exporters import ExportOptions
    from carstage.exporters import export_dataset as export
    from carstage.runs import RunResult, events, recording, run
    from carstage.validation import validate_dataset as validate

__all__ = [
    "CarStageError",
    "Config",
    "Dataset",
    "ExportOptions",
    "RunResult",
    "__version__",
    "events",
    "export",
    "load_config",
    "recording",
    "run",
    "validate",
]

_PLACES = {
    "CarStageError": "carstage.errors:CarStageError",
    "Config": "carstage.config:Config",
    "Dataset": "carstage.dataset:Dataset",
    "ExportOptions": "carstage.exporters:ExportOptions",
    "RunResult": "carstage.runs:RunResult",
    "events": "carstage.runs.events:",
    "export": "carstage.exporters:export_dataset",
    "load_config": "carstage.config:load_config",
    "recording": "carstage.runs:recording",
    "run": "carstage.runs:run",
    "validate": "carstage.validation:validate_dataset",
}

if not TYPE_CHECKING:  # else every misspelt name would count as known

    def __getattr__(name):
        if name not in _PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        module, _, attribute = _PLACES[name].partition(":")
        found = import_module(module)
        globals()[name] = value = getattr(found, attribute) if attribute else found
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
