"""A robot file as data: limbs, pose map, home, geometry. No kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from pkmcal.arrays import FloatArray, Unit
from pkmcal.core.laws import Drive, Laws
from pkmcal.core.library import SLOTS
from pkmcal.display import Table
from pkmcal.geometry.box import Box
from pkmcal.geometry.chains import Chains
from pkmcal.geometry.controller import Controller
from pkmcal.geometry.elastic import Elastic, is_elastic
from pkmcal.geometry.geometry import Geometry
from pkmcal.geometry.laws import Law, drive
from pkmcal.geometry.limbs import Limb, Limbs
from pkmcal.geometry.load import CableLoad
from pkmcal.geometry.mechanism import Mechanism
from pkmcal.geometry.stated_uncertainty import NOTHING, StatedUncertainty


@dataclass(frozen=True, eq=False)
class Model:
    """A robot as its file describes it; mm and rad.

    Attributes
    ----------
    name : str
        The robot's name.
    map : str
        Pose map: "spatial", "translation", "planar", "2tpr2tps", "spherical" or "xy".
    home : ndarray (6,)
        x y z α β γ; what the map does not leave free is 0.
    match : tuple of str or None
        The coordinates that determine a pose where limbs constrain it.
    limbs : tuple of Limb
        Limb 1 first.
    geometry : Geometry
        The numbers of the limbs and the named parameters.
    free : tuple of str
        Names that a calibration frees by default; empty when the file has none.
    stated : mapping of str to float
        What a data sheet claims, by name of a number, of a slot ("rod": every rod), or of
        `pkmcal.geometry.robot_file.STATED_SIZES`.
    base_frame : ndarray (6,) or None
        Pose of the machine's own frame in the frame poses are given in.
    tool_frame : ndarray (6,) or None
        Pose of the tool in the platform's own frame.
    closure_tolerance : float or None
        What more closures than free coordinates may miss, mm; None means 2e-3 of the size.
    file : str or None
        Where the model was read; a built-in machine has none.
    chains : Chains or None
        The joints, of a machine whose limbs are chains.
    workspace : mapping of str to (float, float)
        Least and largest value of coordinates of the pose, mm and rad: where the machine may go,
        a bed or a frame being in the way. Empty where the file states none.
    load : CableLoad or None
        What acts on the platform, of a machine on cables whose file states it.
    probe : ndarray (3,) or None
        Offset of the bed probe of a printer's firmware, mm: it touches at the nozzle's x and y
        plus the first two, and the nozzle is then the third above the bed. None: not stated.
    controller : Controller or None
        The firmware from which the numbers were imported.
    elastic : Elastic or None
        What yields and what pulls at it; None of a rigid machine.
    uncertainty : StatedUncertainty
        How wrong numbers may be that a calibration does not look for.
    """

    name: str
    map: str
    home: FloatArray
    match: tuple[str, ...] | None
    limbs: tuple[Limb, ...]
    geometry: Geometry
    free: tuple[str, ...]
    stated: Mapping[str, float]
    base_frame: FloatArray | None = None
    tool_frame: FloatArray | None = None
    closure_tolerance: float | None = None
    file: str | None = None
    chains: Chains | None = None
    workspace: Box = field(default_factory=dict)
    load: CableLoad | None = None
    probe: FloatArray | None = None
    controller: Controller | None = None
    elastic: Elastic | None = None
    uncertainty: StatedUncertainty = NOTHING

    def __post_init__(self) -> None:
        if self.load is not None:  # some of its numbers may be those of the geometry
            object.__setattr__(self, "load", self.load.with_numbers(dict(self.geometry.items())))

    def with_geometry(self, geometry: Geometry) -> Model:
        """Return the model with other numbers: `replace` for a search, ten times as fast."""
        other = object.__new__(Model)
        other.__dict__.update(vars(self), geometry=geometry)
        other.__post_init__()
        return other

    @property
    def rigid(self) -> Model:
        """Return the model without elastic numbers and loads."""
        if self.elastic is None:
            return self
        free = tuple(name for name in self.free if not is_elastic(name))
        geometry = self.geometry.without(is_elastic)
        return replace(self, geometry=geometry, free=free, elastic=None)

    @property
    def balanced_load(self) -> CableLoad | None:
        """The load that tensions of a calibration's rows balance; None: they need not."""
        return self.load if self.load is not None and self.load.balance else None

    @cached_property
    def mechanism(self) -> Mechanism:
        """The limbs as their kind answers for them."""
        return Limbs(self.limbs) if self.chains is None else self.chains

    @property
    def closed_form(self) -> bool:
        """True if limbs are in closed form, and their numbers are places and lengths."""
        return self.mechanism.closed_form

    @property
    def n_actuators(self) -> int:
        """Number of actuators."""
        return 1 + max((each.actuator for each in self.mechanism.stated_drives), default=-1)

    @property
    def actuator_units(self) -> tuple[Unit, ...]:
        """Unit of each actuator coordinate, "mm" or "rad"."""
        units = {each.actuator: each.unit for each in self.mechanism.stated_drives}
        return tuple(units[i] for i in range(self.n_actuators))

    @property
    def laws(self) -> tuple[Law | None, ...]:
        """The law of each drive: of each limb, or of each actuator of chains."""
        return tuple(each.law for each in self.mechanism.stated_drives)

    @property
    def driven(self) -> bool:
        """True if any drive has a law beside its gain and offset."""
        return any(law is not None for law in self.laws)

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives as the core takes them."""
        return tuple(
            drive(each.law, i, each.unit, each.actuator, self.geometry, each.stroke)
            for i, each in enumerate(self.mechanism.stated_drives, 1)
        )

    @property
    def own_width(self) -> int:
        """Number of a limb's slots in the geometry, apart from those of drive laws."""
        return len(SLOTS) + 3 * max(
            (len(limb.parts) - 1 for limb in self.limbs if limb.parts), default=0
        )

    @property
    def pulleys(self) -> tuple[int, ...]:
        """Limbs, counted from 0, that run over a pulley."""
        return tuple(i for i, limb in enumerate(self.limbs) if limb.driver and limb.driver.swivels)

    @property
    def bent(self) -> tuple[int, ...]:
        """Limbs, counted from 0, that run over a pulley or over several points."""
        return tuple(i for i, limb in enumerate(self.limbs) if limb.driver and limb.driver.bent)

    def doubts(self) -> list[tuple[int, str]]:
        """Drive laws without an inverse over their stroke: limbs, counted from 0, and why."""
        if not self.driven:
            return []
        slots = self.geometry.slots
        found = Laws(self.drives, slots.size).doubts(slots)
        return [(self.limb_of_drive(d), why) for d, why in found.items()]

    def limb_of_drive(self, d: int) -> int:
        """The limb, counted from 0, that a drive is in."""
        return self.mechanism.stated_drives[d].limb

    def table(self) -> Table:
        """Kind, actuator and joints of each limb; the joints in the frames of base and platform.

        Of chains every joint, the machine at home.
        """
        return self.mechanism.table(self.geometry.slots)
