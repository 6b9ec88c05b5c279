# data: klipper/logs.json
# %% [markdown]
# # Stored probe logs of delta printers
#
# Seven heights each, as a printer's firmware keeps them: six numbers, and one spare equation.

# %%
import json

import numpy as np

import pkmcal as pk

with open("logs.json") as file:
    log = json.load(file)[4]
rods = np.array(log["arm_length"])
ends = np.array(log["position_endstop"]) + np.sqrt(rods**2 - log["radius"] ** 2)
text = f"""
name = "delta"
units = {{ length = "mm", angle = "deg" }}
[pose]
map = "translation"
home = {{ z = 20.0 }}
[parameters]
radius = {log["radius"]}
angle1 = {log["angle"][0]}
angle2 = {log["angle"][1]}
angle3 = {log["angle"][2]}
[calibration]
free = ["radius", "angle1", "angle2", "offset*"]
"""
for i in range(3):
    text += f"""
[[limb]]
kind = "PUS"
base = {{ radius = "radius", angle = "angle{i + 1}", z = 0.0 }}
platform = [0, 0, 0]
slider = [0, 0, 1]
rod = {rods[i]}
offset = {ends[i]}
branch = -1
"""
with open("delta.toml", "w") as file:
    file.write(text)
robot = pk.load("delta.toml")
robot

# %%
heights = pk.Measurements(
    -np.array(log["pos"]) * np.array(log["stepdist"]), np.array(log["height"]), "height"
)
found = pk.identify(robot, heights)
found

# %% [markdown]
# The verdict says why seven points are few. Where to probe instead, and what it would bring:

# %%
random = np.random.default_rng(0)
bed = 0.8 * log["radius"] * np.sqrt(random.uniform(0, 1, 200))
angle = random.uniform(0, 2 * np.pi, 200)
candidates = np.zeros((200, 6))
candidates[:, 0], candidates[:, 1] = bed * np.cos(angle), bed * np.sin(angle)
pk.plan_poses(robot, candidates, count=20, kind="height", noise=0.02)
