"""What to do about a sensor at fault, in words: the record is to be mended, not the arm, nor the feedforward."""

from __future__ import annotations

from collections.abc import Callable

from armloop.effects.base import Estimate, number
from armloop.model import AddedEffect


def remedy(added: AddedEffect) -> str:
    """A sentence or two on what a controller's owner should do; empty for what acts on the arm itself."""
    if not added.effect.sensor:
        return ""
    words = _REMEDIES.get(added.effect.name, _any_sensor)
    return words(added.parameters, added.effect.joint)


def _torque_gain(p: dict[str, Estimate], joint: int | None) -> str:
    gain = number(p["gain"].value)
    return (
        f"Divide the torque readings of joint {joint} by {gain:.4g}, or correct the drive gain that turns its current "
        "into torque. The feedforward stays as it is, unless the drive turns commands into current by the same wrong "
        f"gain: then the joint receives {1 / gain:.3g} times what it is told, until that gain is corrected"
    )


def _torque_offset(p: dict[str, Estimate], joint: int | None) -> str:
    e = p["offset"]
    return (
        f"Subtract {number(e.value):.4g} {e.unit} from the torque readings of joint {joint}, or zero the sensor with the "
        "joint unloaded. The feedforward stays as it is"
    )


def _encoder_offset(p: dict[str, Estimate], joint: int | None) -> str:
    e = p["offset"]
    offset = number(e.value)
    return (
        f"Subtract {offset:.4g} {e.unit} from the position readings of joint {joint}, or bring its encoder back to where "
        "it was when the model was trained, before anything uses them. The feedforward itself stays as it is: at the "
        f"true posture it is right. Until then the joint stands {-offset:+.4g} {e.unit} from where it is told and "
        "receives the torque of another posture; no feedforward can mend the position"
    )


def _time_delay(p: dict[str, Estimate], joint: int | None) -> str:
    del joint
    seconds = number(p["seconds"].value)
    return (
        f"Shift the torque record by {1e3 * abs(seconds):.3g} ms {'back' if seconds > 0 else 'forward'} before it is "
        "compared with the motion. The feedforward is not shifted: a record cannot tell whether commands are late, too"
    )


def _any_sensor(p: dict[str, Estimate], joint: int | None) -> str:
    del p
    of = "" if joint is None else f" of joint {joint}"
    return f"Correct the reading{of} before anything uses it. The feedforward stays as it is"


_REMEDIES: dict[str, Callable[[dict[str, Estimate], int | None], str]] = {
    "torque_gain": _torque_gain,
    "torque_offset": _torque_offset,
    "encoder_offset": _encoder_offset,
    "time_delay": _time_delay,
}
