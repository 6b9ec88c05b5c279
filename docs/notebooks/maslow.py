# data: maslow/run1.csv maslow/run2.csv
# %% [markdown]
# # A router on four belts that calibrates itself
#
# No pose of the sled was ever measured: 25 places, four times each, and the lengths of four belts
# to it. Four belts hold a point of the plane, two would do; that is what can be learned from.

# %%
import numpy as np

import pkmcal as pk

text = """
name = "four belts"
units = { length = "mm", angle = "deg" }
[pose]
map = "xy"
home = { x = 1500.0, y = 1000.0 }
[parameters]
bottom = 1.0
right = 1.0
rest = 1.0
[calibration]
free = ["base1.x", "base1.y", "base2.x", "base2.y", "base4.x", "bottom", "right", "rest"]
"""
corners = ((0, 2000), (3000, 2000), (0, 0), (3000, 0))
gains = ("1.0", '"right"', '"bottom"', '"rest"')
for (x, y), gain in zip(corners, gains, strict=True):
    text += f"""
[[limb]]
kind = "cable"
base = [{x}, {y}, 0]
platform = [0, 0, 0]
gain = {gain}
"""
with open("maslow.toml", "w") as file:
    file.write(text)
robot = pk.load("maslow.toml")
axes = robot.plot()

# %%
runs = [np.loadtxt(f"run{k}.csv", delimiter=",", skiprows=1) for k in (1, 2)]
found = [
    pk.identify(robot, pk.Measurements(run, None, "closure", actuator_sigma=1.0)) for run in runs
]
found[0]

# %% [markdown]
# The second run was made after the machine had been switched off. How well do both agree?

# %%
for name, one, other in zip(found[0].free, found[0].values, found[1].values, strict=True):
    print(f"{name:8} {one:10.4f} {other:10.4f} {other - one:8.4f}")

# %%
found[0].plot()
