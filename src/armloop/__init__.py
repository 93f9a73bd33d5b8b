"""armloop: measure a robot arm, reconstruct its dynamics, control it, and trace what the model misses.

    import armloop as al

    arm = al.load_arm("three_axis")
    model = al.reconstruct(al.read_logs("logs/*.csv", arm), arm)
    found = al.diagnose(model, al.read_log("run.csv", arm))

The names in ``__all__`` are public and stable, and docs/api.md describes them; everything else may change. Each is
loaded when it is first used, so that importing the package is cheap. Behind them are the packages a sample walks
through: `data`, `robot`, `laws`, `features`, `regression`, `model`, `identification`, then `drake` or `diagnosis`. What a
module was called before it moved still works, with a warning (`armloop.moved`).
"""

import sys as _sys

__version__ = "0.1.0"

#: Where each public name is found.
_PLACES = {
    "Comparison": "armloop.api.score",
    "Diagnosis": "armloop.api.diagnosis",
    "InputError": "armloop.util.errors",
    "Model": "armloop.api.model",
    "MotionLog": "armloop.data.log",
    "Reference": "armloop.api.excitation",
    "Score": "armloop.api.score",
    "Tracking": "armloop.api.tracking",
    "diagnose": "armloop.api.diagnosis",
    "evaluate": "armloop.api.score",
    "excite": "armloop.api.excitation",
    "load_arm": "armloop.robot.arm",
    "load_model": "armloop.api.model",
    "read_log": "armloop.api.reading",
    "read_logs": "armloop.api.reading",
    "reconstruct": "armloop.api.model",
    "track": "armloop.api.tracking",
    "write_log": "armloop.data.log",
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


class _Moved:
    """Asked for what no other finder has found: `armloop.moved` says where modules of former names are now."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> object:
        if name.startswith("armloop."):
            from armloop.moved import find_spec

            return find_spec(name)
        return None


_sys.meta_path.append(_Moved)  # type: ignore[arg-type]
