# %% [markdown]
# # Pushes in measured data
#
# A real arm: a UR5 whose logs come with armloop (Kufieta 2014, Apache-2.0). Its torques are motor currents in A; no drive
# gains are published for it, so typical ones are used, and forces hang on them.

# %%
import armloop as al
from armloop.util.resources import measured_folder

data = measured_folder("ur5")
arm = al.load_arm(data / "ur5.urdf")
gains = [12.5, 12.5, 12.5, 9.2, 9.2, 9.2]  # N·m/A


def read(name):
    return al.read_log(data / f"{name}.parquet", arm, drive_gains=gains)


# %% [markdown]
# ## A model of free motion

# %%
train = [read("no1"), read("no2"), read("no8_singularity_free_1")]
model = al.reconstruct(train, arm, library="rigid-body")
free = read("no9_singularity_free_nodist")  # another motion, which the model was not made of
model.score(free)

# %%
model.plot(free)
# %% [markdown]
# Joints that barely turn are dominated by friction near standstill, which is what a rigid-body model knows least of: look at
# their nRMSE before you use it.
#
# ## The same motion, and somebody pushes

# %%
found = al.diagnose(model, read("no9_singularity_free_wdist"))
found

# %% [markdown]
# Each event has an interval, a mean force in the base's frame and the error before and after inside it. A push is no
# property of the arm: nothing of it is carried into the model, and a controller that counts on it would be wrong a second
# later.

# %%
import numpy as np

for effect in found.effects:
    print(
        effect.effect.label(), {name: np.round(p.value, 2).tolist() for name, p in effect.parameters.items()}
    )
