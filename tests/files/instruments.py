"""One measurement of a machine in the files of many instruments and controllers.

Written after what is publicly known of the formats: SpatialAnalyzer's ASCII export, tables of
laser-tracker software, motion capture by Motive, QTM and Nexus, logs of controllers. A file is a
function of the same truth, so that what is read can be compared with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import pkmcal as pk
from pkmcal.arrays import FloatArray

TARGETS = {"SMR1": [80.0, 0.0, 30.0], "SMR2": [-40.0, 70.0, 30.0], "SMR3": [-40.0, -70.0, 35.0]}


@dataclass(frozen=True)
class Truth:
    """Poses (N, 6), lengths (N, 6) and positions (N, k, 3) of the targets, mm and rad."""

    poses: FloatArray
    actuators: FloatArray
    points: FloatArray

    @property
    def turns(self) -> Rotation:
        return Rotation.from_euler("xyz", self.poses[:, 3:])


def truth(count: int = 12, seed: int = 3) -> Truth:
    """A hexapod at some poses, with three reflectors; numbers as files round them."""
    robot = pk.load("hexapod")
    rng = np.random.default_rng(seed)
    spread = np.array([60.0, 60.0, 40.0, 0.2, 0.2, 0.2])
    poses = robot.home + rng.uniform(-1.0, 1.0, (count, 6)) * spread
    turns = Rotation.from_euler("xyz", poses[:, 3:])
    points = np.stack([poses[:, :3] + turns.apply(place) for place in TARGETS.values()], axis=1)
    return Truth(poses, robot.inverse(poses).round(5), points.round(5))


def rows_of(t: Truth) -> list[tuple[int, str, FloatArray]]:
    """Pose from 1, target and position of every point."""
    return [
        (i + 1, name, t.points[i, k]) for i in range(len(t.poses)) for k, name in enumerate(TARGETS)
    ]


def comma(text: str) -> str:
    return text.replace(".", ",")


# --- points by laser trackers and arms ------------------------------------------------------------


def spatial_analyzer_commas(t: Truth) -> bytes:
    lines = ["//SpatialAnalyzer 2023.1", "// Working Frame: A::WORLD", "// Units: Millimeters"]
    lines += [
        f"A, Main, P{i:02}_{name}, {x:.5f}, {y:.5f}, {z:.5f}" for i, name, (x, y, z) in rows_of(t)
    ]
    return "\r\n".join(lines).encode()


def spatial_analyzer_spaces(t: Truth) -> bytes:
    lines = ["// SA Version: 2019.02.14", "// Length units: mm", "// Cartesian: X Y Z"]
    lines += [f"P{i:02}_{name}   {x:.5f}  {y:.5f}   {z:.5f}" for i, name, (x, y, z) in rows_of(t)]
    return "\n".join(lines).encode()


def spatial_analyzer_headed(t: Truth) -> bytes:
    head = "Collection\tGroup\tTarget\tX [mm]\tY [mm]\tZ [mm]\tOffset1\tRMS Error\tTime Stamp"
    lines = [
        f"A\tMain\tP{i:02}_{name}\t{x:.5f}\t{y:.5f}\t{z:.5f}\t0\t0.0021\t2026/03/02 10:{i:02}:00"
        for i, name, (x, y, z) in rows_of(t)
    ]
    return "\r\n".join([head, *lines]).encode()


def leica_semicolons(t: Truth) -> bytes:
    lines = [
        "Leica Absolute Tracker AT960;Seriennr.: 750123",
        "Bediener: Müller;Temperatur: 20,4 °C;Druck: 1013,2",
        "Einheit Länge: mm",
        "",
        "Point ID;X (mm);Y (mm);Z (mm);Std (mm);Timestamp;Reflector Type",
    ]
    for k, (i, name, (x, y, z)) in enumerate(rows_of(t)):
        cells = comma(f"P{i}.{name};{x:.5f};{y:.5f};{z:.5f};0.0100")
        cells = cells.replace(f"P{i},{name}", f"P{i}.{name}")
        lines.append(f"{cells};02.03.2026 10:{i:02}:{k % 3:02},250;1.5in RRR")
    return "\r\n".join(lines).encode("cp1252")


def api_tracker(t: Truth) -> bytes:
    lines = ["API Tracker3 export", "Units,inch", "Pt,X,Y,Z,StdDev X,StdDev Y,StdDev Z,Temp"]
    for i, name, (x, y, z) in rows_of(t):
        lines.append(
            f"{name}-{i:03},{x / 25.4:.8f},{y / 25.4:.8f},{z / 25.4:.8f},0.0004,0.0004,0.0004,68.1"
        )
    return "\n".join(lines).encode()


def faro_cam2(t: Truth) -> bytes:
    lines = ["Label\tNominal X\tNominal Y\tNominal Z\tActual X\tActual Y\tActual Z\tDeviation"]
    lines.append("\tmm\tmm\tmm\tmm\tmm\tmm\tmm")
    for i, name, (x, y, z) in rows_of(t):
        lines.append(f"P{i:02}_{name}\t0\t0\t0\t{x:.5f}\t{y:.5f}\t{z:.5f}\t0.012")
    return "\r\n".join(lines).encode("utf-16")


def polyworks(t: Truth) -> bytes:
    lines = ["PolyWorks|Inspector 2022 - Feature report", "Units: mm   Angles: deg", ""]
    lines.append("Object name,Control,Meas X,Meas Y,Meas Z,Dev,Test")
    for i, name, (x, y, z) in rows_of(t):
        lines.append(f'"point {i} {name}",3D,{x:.5f},{y:.5f},{z:.5f},0.003,Pass')
    return "\n".join(lines).encode()


def wide_underscores(t: Truth) -> bytes:
    heads = [f"{name}_{axis}" for name in TARGETS for axis in "XYZ"]
    lines = ["Pose No;" + ";".join(f"{head} [mm]" for head in heads)]
    for i, points in enumerate(t.points, 1):
        lines.append(f"{i};" + comma(";".join(f"{v:.5f}" for v in points.reshape(-1))))
    return "\n".join(lines).encode()


def vicon_markers(t: Truth) -> bytes:
    lines = ["Trajectories", "100", ",," + ",,,".join(f"Plate:{name}" for name in TARGETS) + ",,"]
    lines.append("Frame,Sub Frame" + ",X,Y,Z" * len(TARGETS))
    lines.append(",," + ",".join(["mm,mm,mm"] * len(TARGETS)))
    for i, points in enumerate(t.points, 1):
        lines.append(f"{i},0," + ",".join(f"{v:.5f}" for v in points.reshape(-1)))
    return "\r\n".join(lines).encode()


def qualisys_markers(t: Truth) -> bytes:
    lines = ["NO_OF_FRAMES\t12", "FREQUENCY\t100", "MARKER_NAMES\t" + "\t".join(TARGETS)]
    heads = "\t".join(f"{name} {axis}" for name in TARGETS for axis in "XYZ")
    lines.append(f"Frame\tTime\t{heads}")
    for i, points in enumerate(t.points, 1):
        lines.append(f"{i}\t{i * 0.5:.2f}\t" + "\t".join(f"{v:.5f}" for v in points.reshape(-1)))
    return "\r\n".join(lines).encode()


POINTS = {
    each.__name__: each
    for each in (
        spatial_analyzer_commas,
        spatial_analyzer_spaces,
        spatial_analyzer_headed,
        leica_semicolons,
        api_tracker,
        faro_cam2,
        polyworks,
        wide_underscores,
        vicon_markers,
        qualisys_markers,
    )
}

# --- poses by motion capture ----------------------------------------------------------------------


def motive(t: Truth) -> bytes:
    lines = [
        "Format Version,1.23,Take Name,Take 7,Capture Frame Rate,120.0,Export Frame Rate,120.0,"
        "Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global",
        "",
        ",," + ",".join(["Rigid Body"] * 8),
        ",," + ",".join(["Plate"] * 8),
        ",," + ",".join(['"7F3A"'] * 8),
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error",
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,",
    ]
    for i, (pose, quat) in enumerate(zip(t.poses, t.turns.as_quat(), strict=True)):
        cells = [f"{v:.9f}" for v in (*quat, *pose[:3] / 1000)]
        lines.append(f"{i},{i / 120:.6f}," + ",".join(cells) + ",0.000104")
    return "\r\n".join(lines).encode()


def qualisys_6dof(t: Truth) -> bytes:
    lines = ["NO_OF_BODIES\t1", "BODY_NAMES\tPlate", "ROTATION\tRoll Pitch Yaw"]
    lines.append("X [mm]\tY [mm]\tZ [mm]\tRoll [deg]\tPitch [deg]\tYaw [deg]\tResidual")
    for pose in t.poses:
        cells = [*pose[:3], *np.degrees(pose[3:])]
        lines.append("\t".join(f"{v:.8f}" for v in cells) + "\t0.21")
    return "\r\n".join(lines).encode()


def ros_poses(t: Truth) -> bytes:
    heads = [f"pose.pose.position.{axis} [m]" for axis in "xyz"]
    heads += [f"pose.pose.orientation.{axis}" for axis in "xyzw"]
    lines = ["header.stamp," + ",".join(heads)]
    for i, (pose, quat) in enumerate(zip(t.poses, t.turns.as_quat(), strict=True)):
        cells = ",".join(f"{v:.10f}" for v in (*pose[:3] / 1000, *quat))
        lines.append(f"17{i:08}.25,{cells}")
    return "\n".join(lines).encode()


def abb_quaternions(t: Truth) -> bytes:
    lines = ["X [mm],Y [mm],Z [mm],Q1,Q2,Q3,Q4"]
    for pose, quat in zip(t.poses, t.turns.as_quat()[:, [3, 0, 1, 2]], strict=True):
        lines.append(",".join(f"{v:.9f}" for v in (*pose[:3], *quat)))
    return "\n".join(lines).encode()


def matrices(t: Truth) -> bytes:
    heads = ["X", "Y", "Z"] + [f"R{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
    lines = ["Units: mm", " ".join(heads)]
    for pose, turn in zip(t.poses, t.turns.as_matrix(), strict=True):
        lines.append(" ".join(f"{v:.9f}" for v in (*pose[:3], *turn.reshape(-1))))
    return "\n".join(lines).encode()


POSES = {
    each.__name__: each for each in (motive, qualisys_6dof, ros_poses, abb_quaternions, matrices)
}

# --- logs of controllers --------------------------------------------------------------------------


def log_struts(t: Truth) -> bytes:
    lines = ["prog_line;" + ";".join(f"Strut {i} [mm]" for i in range(1, 7)) + ";Feed;Temperature"]
    for i, q in enumerate(t.actuators, 1):
        lines.append(f"P{i:02};" + comma(";".join(f"{v:.5f}" for v in q)) + ";1500;20,1")
    return "\n".join(lines).encode()


def log_axes(t: Truth) -> bytes:
    lines = ["# controller log", "Pose,A1 (mm),A2 (mm),A3 (mm),A4 (mm),A5 (mm),A6 (mm),State"]
    lines += [
        f"{i}," + ",".join(f"{v:.5f}" for v in q) + ",OK" for i, q in enumerate(t.actuators, 1)
    ]
    return "\n".join(lines).encode()


def log_zero_based(t: Truth) -> bytes:
    lines = ["name " + " ".join(f"actual_q_{i}_mm" for i in range(6))]
    lines += [f"P{i} " + " ".join(f"{v:.5f}" for v in q) for i, q in enumerate(t.actuators, 1)]
    return "\n".join(lines).encode()


def log_units_below(t: Truth) -> bytes:
    lines = [
        "Name\t" + "\t".join(f"Leg{i} Length" for i in range(1, 7)),
        "\t" + "\t".join(["in"] * 6),
    ]
    lines += [
        f"P{i:03}\t" + "\t".join(f"{v / 25.4:.9f}" for v in q) for i, q in enumerate(t.actuators, 1)
    ]
    return "\r\n".join(lines).encode()


LOGS = {each.__name__: each for each in (log_struts, log_axes, log_zero_based, log_units_below)}
