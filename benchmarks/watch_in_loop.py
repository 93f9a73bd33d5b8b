"""What watching in the loop recovers: a load grasped, a joint that rubs more, and a healthy run, one `AdvanceTo` each.

The scenario is `payload_pickup`: the reference of Fig. 14 for three periods of 20 s. The model is reconstructed from data
collected on the scenario's own arm. In the first period the monitor learns; then the plant changes. Printed are the
tracking errors before, from the change until what was named is supplied, and over the last period. Beside them: the last
period of the same run without the adaptive feedforward, and with the model that a diagnosis of the 20 s after the change
identifies and that is put in by hand (`armloop track payload_pickup`), which is what watching should come near to.

    python benchmarks/watch_in_loop.py
"""

from __future__ import annotations

import numpy as np

from armloop.diagnosis import diagnose
from armloop.drake.experiments.pickup import run_pickup
from armloop.drake.experiments.scenarios import load_tracking
from armloop.drake.experiments.tracking import TrackingResult
from armloop.drake.experiments.watched_run import run_watched
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.util.progress import silent
from armloop.workflows.tracking import models_for


def eta(result: TrackingResult | None) -> str:
    """The errors of all joints."""
    return "–" if result is None else " ".join(f"{x:7.4f}" for x in result.eta)


def run() -> None:
    """Simulate and print."""
    scenario = load_tracking("payload_pickup")
    assert scenario.pickup is not None
    models = models_for(scenario, {}, silent)
    model = models.get("step3", models.get("model"))
    assert model is not None
    at = scenario.pickup.at
    cases = {
        "load of 0.5 kg": [scenario.pickup.payload],
        "joint 2: 0.8 N·m·s/rad more": [UndeclaredEffect("viscous_friction", 2, {"coefficient": 0.8})],
        "healthy": [],
    }
    for name, changes in cases.items():
        found = run_watched(scenario, model, changes, at)
        print(f"{name}: change at {at:g} s, alarm at {found.alarmed_at:g} s, named at {found.named_at:g} s")
        for added in found.known.effects:
            print(f"  {added.effect.sentence(added.parameters)}")
        for label, result in (
            ("before", found.before),
            ("during", found.during),
            ("last period", found.after),
        ):
            print(f"  η {label:24s} {eta(result)}  deg")
        if changes:
            plain = run_watched(scenario, model, changes, at, adapt=False).after
            print(f"  η {'last period, untouched':24s} {eta(plain)}  deg")
            identified = run_pickup(
                scenario, model, lambda log: diagnose(model, [log]).model, changes=changes
            ).phases["augmented"]
            print(f"  η {'last period, identified':24s} {eta(identified)}  deg")
            ratio = found.after.eta / identified.eta
            print(f"  {'ratio to the identified':26s} {' '.join(f'{x:7.2f}' for x in ratio)}")
        jumps = np.abs(np.diff(found.supplied, axis=0)).max()
        print(
            f"  revisions {found.known.revision}, given back {found.given_back}, largest change of what is supplied "
            f"in a step {jumps:.2g} N·m, most supplied {np.abs(found.supplied).max():.3g} N·m"
        )


if __name__ == "__main__":
    run()
