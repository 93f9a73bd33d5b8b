# %% [markdown]
# # The model in MuJoCo and in C
#
# What has been identified is worth most where you work already. Every export is read back by the program it is for, and the
# largest difference of torque is printed.

# %%
import armloop as al

arm = al.load_arm("three_axis")
model = al.load_model("out/model.json")  # of the first tutorial
log = al.read_log("out/logs/varying.csv", arm)

# %% [markdown]
# ## MuJoCo
#
# Torques fix sums of the links' masses and inertias only. The rest is chosen nearest to the URDF's so that every body can
# exist; what MuJoCo has no words for (Stribeck friction here) is said.

# %%
exported = model.export("mjcf", "out/arm.xml", log=log)
print("largest difference:", exported.difference, "of torques", exported.rms)
print(*exported.missing, sep="\n")

# %%
import mujoco
import numpy as np

engine = mujoco.MjModel.from_xml_path("out/arm.xml")
data = mujoco.MjData(engine)
data.qpos[:] = [0.3, -0.4, 0.8]
mujoco.mj_forward(engine, data)
print("gravity in MuJoCo", np.round(data.qfrc_bias, 6), "N·m")

from armloop.dynamics import Dynamics

print("of the model     ", np.round(Dynamics(model).gravity(data.qpos), 6), "N·m")

# %% [markdown]
# ## C
#
# One C99 file without dependencies or allocation; memory of friction, if the model has any, lies in a struct you own.

# %%
exported = model.export("c", "out/arm.c", log=log)
print("largest difference:", exported.difference)

# %%
# !cc -std=c99 -O2 -shared -fPIC -Wall -Werror -o out/arm.so out/arm.c -lm && head -30 out/arm.c
