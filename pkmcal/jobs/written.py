"""The files that a calibration leaves: the machine as calibrated, its picture, the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pkmcal.arms.arm import SerialArm
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.rigid import RigidArm, rigid_arm
from pkmcal.exceptions import ArgumentError
from pkmcal.files.reading import Input
from pkmcal.jobs.calibration import Writing
from pkmcal.jobs.inputs import Inputs
from pkmcal.jobs.output import Output
from pkmcal.kinematics.robot import Robot
from pkmcal.measurements.measurements import Measurements


@dataclass(frozen=True)
class Written:
    """Outputs of a calibration; made before it is computed, for what would be refused.

    Attributes
    ----------
    robot : str
        The machine that was given.
    inputs : Inputs
        The files that were read.
    urdf : bool
        Whether the machine is that of a URDF file.
    machine, report, pdf : Output or None
        Files of ``--out``, ``--report`` and ``--pdf``.
    instruments : tuple of str
        Names of files of instruments as they are found, such as cameras, beside the machine's.
    statement : Input or None
        The file of ``--certificate``.
    """

    robot: str
    inputs: Inputs
    urdf: bool
    machine: Output | None
    instruments: tuple[str, ...]
    report: Output | None
    pdf: Output | None
    statement: Input | None

    @staticmethod
    def planned(
        asked: Writing,
        robot: str,
        given: Robot | SerialArm,
        measured: Sequence[Measurements],
        inputs: Inputs,
    ) -> Written:
        """Check what is to be written.

        Raises
        ------
        ValueError
            A file that would be lost, a certificate with a mistake, no browser that prints.
        """
        if asked.report is None and (asked.certificate is not None or asked.pdf):
            option = "--pdf" if asked.certificate is None else "--certificate"
            raise ArgumentError(f"{option}: it is part of the report, --report DIR")
        urdf = isinstance(given, SerialArm) and given.source is not None
        names = ["robot.toml", "residuals.png", *["robot.urdf"] * urdf]
        found_too = tuple(dict.fromkeys(filter(None, (m.instrument.file_name for m in measured))))
        machine = None
        if asked.out is not None:
            machine = Output(Path(asked.out), [*names, *found_too], inputs, asked.force)
        report, pdf = _report(asked, inputs)
        statement = None if asked.certificate is None else _statement(asked.certificate, inputs)
        return Written(robot, inputs, urdf, machine, found_too, report, pdf, statement)

    def write_machine(self, found: Identification) -> RigidArm | None:
        """Write robot.toml and the picture; of a URDF file that, too, and return what it lost."""
        assert self.machine is not None
        rigid = rigid_arm(found) if self.urdf else None
        with self.machine.draft() as draft:
            save_robot(found, draft / "robot.toml", self.inputs, self.robot)
            found.plot(draft / "residuals.png")
            for each in found.instruments:
                if each.file_name:
                    each.write(draft / each.file_name, self.inputs.comment())
            if self.urdf and isinstance(found.robot, SerialArm):
                (rigid.arm if rigid else found.robot).save_urdf(draft / "robot.urdf")
        return rigid

    def write_report(self, found: Identification) -> None:
        """Write the report, with the machine as calibrated beside it."""
        assert self.report is not None
        with self.report.draft() as draft:
            found.report(draft, self.inputs.contents(), certificate=self.statement)
            save_robot(found, draft / "robot.toml", self.inputs, self.robot)

    def print_report(self) -> Path:
        """Print the report that has been written, and return the PDF.

        Raises
        ------
        ValueError
            The browser did not print it.
        """
        # they import all that a report needs: only if there is one
        from pkmcal.report.pdf import print_page
        from pkmcal.report.report import FILES

        assert self.pdf is not None
        (pdf,) = self.pdf.paths
        with self.pdf.draft() as draft:
            print_page(pdf.with_name(FILES[0]), draft / pdf.name)
        return pdf


def save_robot(found: Identification, path: Path, inputs: Inputs, robot: str) -> None:
    """Write the calibrated robot; in the words of the user's file, where there is one."""
    calibrated, source = found.robot, inputs.robot(robot)
    if isinstance(calibrated, SerialArm) or isinstance(source, str):
        calibrated.save(path, inputs.comment())
        return
    chosen = found.fit.parameters
    sigma = {each.name: each.stderr for each in found.nuisances}
    sigma |= dict(zip(found.free, found.stderr.tolist(), strict=True))
    names = [calibrated.geometry.names[place] for place in chosen.places]
    known = {
        name: sigma[chosen.names[column]]
        for name, column in zip(names, chosen.geometry_of().tolist(), strict=True)
    }
    calibrated.save(path, inputs.comment(), like=source, deviations=known)


def _report(asked: Writing, inputs: Inputs) -> tuple[Output | None, Output | None]:
    """Files of the report and of its PDF; that nothing prints one is said before the work."""
    if asked.report is None:
        return None, None
    from pkmcal.report.pdf import browser
    from pkmcal.report.report import FILES, PDF

    if asked.pdf:
        browser()
    folder = Path(asked.report)
    pdf = Output(folder, [PDF], inputs, asked.force) if asked.pdf else None
    return Output(folder, FILES, inputs, asked.force), pdf


def _statement(certificate: str, inputs: Inputs) -> Input:
    """The file of ``--certificate``: a mistake in it is said before the work."""
    from pkmcal.report.certificate import read as statement

    statement(file := inputs.file(certificate))
    return file
