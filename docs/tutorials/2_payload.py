# %% [markdown]
# # A payload that nobody declared
#
# An arm tracks well, then worse. Something has changed, and the log of the bad run is all there is.

# %%
import armloop as al

arm = al.load_arm("three_axis")
model = al.load_model("out/model.json")  # of the first tutorial

# %% [markdown]
# The changed arm, for whoever plays the world: 0.4 kg at the tool, measured with the encoders and the torque noise of the
# plant. The diagnosis is handed the log and the model, and nothing of this cell.

# %%
from armloop.drake.experiments.collection import measure_run
from armloop.drake.plant.fault_injection import UndeclaredEffect
from armloop.drake.experiments.scenarios import load_plant

plant = load_plant("three_axis")
load = UndeclaredEffect("payload", None, {"mass": 0.4, "com": [0.0, 0.0, 0.0]})
run = measure_run(plant.arm, plant.config, seed=7, duration=20.0, rate=250.0, effects=[load])
al.write_log("out/run.csv", run)

# %% [markdown]
# ## What the model leaves on the run, and why

# %%
model.score(run)

# %%
found = al.diagnose(model, run)
found

# %%
for effect in found.effects:
    print(effect.effect.label())
    for name, value in effect.parameters.items():
        print(f"  {name}: {value.value} ± {value.std_error} {value.unit}")

# %% [markdown]
# Errors *after* are of blocks of the run that were not fitted. A load's mass is told apart from its lever only as far as the
# motion turns it; what the motion cannot tell is listed as an alternative.
#
# ## The model with the load in closed loop

# %%
import numpy as np
from pydrake.all import DiagramBuilder, LogVectorOutput, Simulator

from armloop.drake import PidGains, add_arm_with_controller
from armloop.experiment.excitation import paper_reference


def tracking_error(model, seconds=10.0):
    """Mean absolute tracking error of each joint of the loaded arm, deg (the paper's η)."""
    builder = DiagramBuilder()
    arm = add_arm_with_controller(
        builder, "three_axis", PidGains.paper(3), paper_reference(), model, effects=[load]
    )
    q = LogVectorOutput(arm.plant.GetOutputPort("state"), builder, 0.01)
    q_ref = LogVectorOutput(arm.reference.GetOutputPort("q_ref"), builder, 0.01)
    simulator = Simulator(builder.Build())
    arm.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(seconds)
    context = simulator.get_context()
    error = q_ref.FindLog(context).data() - q.FindLog(context).data()[:3]
    return np.rad2deg(np.abs(error).mean(axis=1))


print("model as it was  ", np.round(tracking_error(model), 4), "deg")
print("with what was found", np.round(tracking_error(found.model), 4), "deg")

# %% [markdown]
# The same from the command line: `armloop diagnose model.json run.csv --out out/diagnosis` writes the verdict, the augmented
# model and a page with the plots; `armloop track payload_pickup` grasps a load in the middle of a run.

# %%
found.report("out/diagnosis.html")
