"""armloop: measure a robot arm, reconstruct its dynamics, control it, and trace what the model misses.

    import armloop as al

    arm = al.load_arm("three_axis")
    model = al.reconstruct(al.read_logs("logs/*.csv", arm), arm)
    found = al.diagnose(model, al.read_log("run.csv", arm))

The names in ``__all__`` are public and stable, and docs/api.md describes them; everything else may change. Each is
loaded when it is first used, so that importing the package is cheap. Behind them are the rooms a sample walks through:
`log`, `signals`, `conditions`, `library`, `regression`, `reconstruction`, `model`, then `drake_systems` or `diagnosis`.
"""

__version__ = "0.1.0"

#: Where each public name is found.
_PLACES = {
    "Diagnosis": "armloop.api.diagnosis",
    "InputError": "armloop.errors",
    "Model": "armloop.api.model",
    "MotionLog": "armloop.log",
    "Reference": "armloop.api.excitation",
    "Score": "armloop.api.score",
    "Tracking": "armloop.api.tracking",
    "diagnose": "armloop.api.diagnosis",
    "evaluate": "armloop.api.score",
    "excite": "armloop.api.excitation",
    "load_arm": "armloop.arm",
    "load_model": "armloop.api.model",
    "read_log": "armloop.api.reading",
    "read_logs": "armloop.api.reading",
    "reconstruct": "armloop.api.model",
    "track": "armloop.api.tracking",
    "write_log": "armloop.log",
}

__all__ = sorted([*_PLACES, "__version__"])


def __getattr__(name: str) -> object:
    """Load a public name when it is first used."""
    if name in _PLACES:
        from importlib import import_module

        found = globals()[name] = getattr(import_module(_PLACES[name]), name)
        return found
    raise AttributeError(f"module 'armloop' has no attribute {name!r}; public are: {', '.join(_PLACES)}")


def __dir__() -> list[str]:
    """The public names, for those who complete them."""
    return sorted({*globals(), *_PLACES})
