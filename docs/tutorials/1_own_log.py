# %% [markdown]
# # From logs to a Drake diagram that tracks better
#
# You have logs of an arm and its URDF, and want a feedforward. The logs here are of the simulated three-axis arm, a fifth
# of what the paper collects; put your own in their place (`armloop convert` reads other programs' files).

# %%
# !armloop collect three_axis --plan quick --out out/logs | tail -3

# %%
import armloop as al

arm = al.load_arm("three_axis")  # or the path of your URDF
logs = al.read_logs("out/logs/*.csv", arm)
logs

# %% [markdown]
# ## A model
#
# `library="rigid-body"` regresses the base parameters of the URDF's chain together with friction. Without it every library
# that suits is tried, and the comparison printed. The error below is of blocks that neither fitted nor chose anything.

# %%
model = al.reconstruct(logs, arm, library="rigid-body")
model.save("out/model.json")
model

# %% [markdown]
# The second axis must be held against gravity; what is printed above says how well that is known.
#
# ## In closed loop
#
# A plant with sticking friction under PID, once alone and once with the model as feedforward. Both are ordinary Drake
# systems: `arm.plant`, `arm.controller` and `arm.reference` have ports to connect more to.

# %%
import numpy as np
from pydrake.all import DiagramBuilder, LogVectorOutput, Simulator

from armloop.drake import PidGains, add_arm_with_controller
from armloop.experiment.excitation import paper_reference


def tracking_error(model=None, seconds=10.0):
    """Mean absolute tracking error of each joint, deg (the paper's η)."""
    builder = DiagramBuilder()
    arm = add_arm_with_controller(builder, "three_axis", PidGains.paper(3), paper_reference(), model)
    q = LogVectorOutput(arm.plant.GetOutputPort("state"), builder, 0.01)
    q_ref = LogVectorOutput(arm.reference.GetOutputPort("q_ref"), builder, 0.01)
    simulator = Simulator(builder.Build())
    arm.start_on_reference(simulator.get_mutable_context())
    simulator.AdvanceTo(seconds)
    context = simulator.get_context()
    error = q_ref.FindLog(context).data() - q.FindLog(context).data()[:3]
    return np.rad2deg(np.abs(error).mean(axis=1))


alone, fed = tracking_error(), tracking_error(model)
print("PID           ", np.round(alone, 3), "deg")
print("PID + Step III", np.round(fed, 4), "deg")

# %% [markdown]
# The simulated plant differs from the model only by what noise and quantisation did to the logs; a measured arm has effects
# that no term stands for, and gains less. What they are is the next tutorial's matter.
