# data: linear-delta/probe41.csv
# %% [markdown]
# # A delta printer and the log of its bed probe
#
# 41 heights of the nozzle over the bed, with the microsteps that each carriage had travelled down
# from its end stop. Nothing else was measured. The [tutorial](../tutorial-delta.md) does the same
# on the command line.

# %%
import numpy as np

import pkmcal as pk

robot = pk.load("examples/linear-delta/robot.toml")
robot

# %%
axes = robot.plot()

# %% [markdown]
# A carriage is 60/6400 mm lower with each step.

# %%
log = np.genfromtxt("probe41.csv", delimiter=",", names=True)
steps = np.column_stack([log[f"steps_{carriage}"] for carriage in "abc"])
measured = pk.Measurements(-steps * 60 / 6400, log["height_mm"], "height")
measured

# %% [markdown]
# A quarter of the points is held out, and compared with what the others say.

# %%
found = pk.identify(robot, measured, holdout=0.25)
found

# %%
found.plot()

# %% [markdown]
# The rods as well? The misfit gets smaller, but heights hardly determine them: look at the ±.

# %%
pk.identify(robot, measured, free=[*robot.model.free, "rod*"])
