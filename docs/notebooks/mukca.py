# data: mukca/front_center_0.csv mukca/front_center_1.csv mukca/mid_left_0.csv mukca/mid_left_1.csv
# %% [markdown]
# # A seven-joint arm and a block with two sockets
#
# The ball at the arm's tip was set into sockets 50 mm apart, from many sides. No instrument
# measured anything: all rows of a socket are one point.

# %%
import numpy as np

import pkmcal as pk

arm = pk.SerialArm.from_dh(
    a=[0, 0, 0, 82.5, -82.5, 0, 88],
    alpha=np.radians([0, -90, 90, 90, -90, 90, 90]),
    d=[333, 0, 316, 0, 384, 0, 0],
    convention="modified",
    tool=[0, 0, 107, 0, 0, 0],
    name="panda",
)
axes = arm.plot(theta=[0, 0.3, 0, -1.5, 0, 1.8, 0])

# %%
files = {"A": "front_center_0", "B": "front_center_1", "C": "mid_left_0", "D": "mid_left_1"}
rows = {name: np.loadtxt(f"{file}.csv", delimiter=",") for name, file in files.items()}
sockets = np.repeat(list(rows), [len(q) for q in rows.values()])
measured = pk.Measurements(
    np.concatenate(list(rows.values())),
    None,
    pk.readings.Touch(sockets, distances={("A", "B"): 50.0}),
    target=[0, 0, 100],  # the ball on the flange, more or less; it is found along
)
measured

# %%
found = pk.identify(arm, measured, unknown="target", prior=1.0)
found

# %% [markdown]
# The sockets C and D stood elsewhere. Their distance was not used: it says how good the result
# is.

# %%
tip = found.values[found.free.index("target1.x") :][:3]
motions = {name: found.robot.forward(q) for name, q in rows.items()}
at = {name: (m[:, :3, :3] @ tip + m[:, :3, 3]).mean(axis=0) for name, m in motions.items()}
print(f"C to D: {np.linalg.norm(at['C'] - at['D']):.2f} mm, 50 mm in truth")
