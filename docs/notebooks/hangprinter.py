# data: hangprinter/all44.csv
# %% [markdown]
# # A printer that hangs on four lines
#
# 44 rows of its motors; a camera measured the positions of the first nine. The lines build up on
# their spools: a [drive law](../drive-laws.md).

# %%
import numpy as np

import pkmcal as pk

radius, buildup = 75.0, -0.06875  # mm; mm² of a spool per mm of line that leaves it
advantage = np.array([2.0, 2, 2, 4])  # turns of a spool per length of its line
anchors = np.array([[0, -1597, -120], [1550, 900, -120], [-1370, 790, -120], [0, 0, 2355.0]])
text = """
name = "four lines"
units = { length = "mm", angle = "deg" }
[pose]
map = "translation"
home = { z = 500.0 }
[calibration]
free = ["base*", "offset*", "drive*.spool"]
"""
for anchor, times in zip(anchors, advantage.tolist(), strict=True):
    text += f"""
[[limb]]
kind = "cable"
base = {anchor.tolist()}
platform = [0, 0, 0]
offset = {float(np.linalg.norm(anchor))}
gain = {times / radius}
drive = {{ spool = {radius / times}, buildup = {buildup / times} }}
"""
with open("hangprinter.toml", "w") as file:
    file.write(text)
robot = pk.load("hangprinter.toml")
axes = robot.plot()

# %% [markdown]
# The file has the lengths that the firmware computed; from them the turns of the motors. Empty
# cells are positions that nobody measured: those rows still say how the lines fit together.

# %%
log = np.genfromtxt("all44.csv", delimiter=",", skip_header=1)
grown = np.sqrt(radius**2 + buildup * advantage * log[:, :4]) - radius
turned = 2 * grown / buildup * radius / advantage
measured = pk.Measurements(turned, log[:, 4:7], "position", sigma=1.0, actuator_sigma=1.0)
measured

# %%
found = pk.identify(robot, measured)
found

# %%
found.plot()
