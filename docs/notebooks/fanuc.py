# data: fanuc-r2000ic/tracker.csv
# %% [markdown]
# # A FANUC R-2000iC and a laser tracker
#
# 24 poses, ten repeats of each, three reflectors. Where the tracker stood and where the
# reflectors sat is not known. The [tutorial](../tutorial-arm.md) does the same on the command
# line.

# %%
import numpy as np

import pkmcal as pk

axes = [[0, 0, 1], [0, 1, 0], [0, -1, 0], [-1, 0, 0], [0, -1, 0], [-1, 0, 0]]
shoulder, elbow, wrist, reach = 670, 1745, 1970, 1592
points = [[0, 0, 0], [312, 0, shoulder], [312, 0, elbow], [312, 0, wrist]]
points += 2 * [[reach, 0, wrist]]
home = np.eye(4)
home[:3, 3] = [reach + 215, 0, wrist]
arm = pk.SerialArm(np.array(axes), points, home, name="R-2000iC/165F")
arm

# %%
axes = arm.plot()

# %%
measured = pk.read_measurements("tracker.csv")
measured

# %% [markdown]
# Base and reflectors alone: how far off the arm is as it was designed.

# %%
unknown = {"unknown": ["frame", "target"]}
nominal = pk.identify(arm, measured, free="joint1.dx", **unknown)
print(f"{nominal.rms:.3f} mm rms")

# %% [markdown]
# All joint errors, with a quarter of the poses held out.

# %%
fitted, held = measured.split(0.25, seed=0)
found = pk.identify(arm, fitted, holdout=held, **unknown)
found

# %%
found.plot()
