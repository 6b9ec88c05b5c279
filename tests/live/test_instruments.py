"""Gauges at serial ports (a pseudo-terminal), folders that are watched, people who type."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pkmcal.exceptions import ArgumentError
from pkmcal.live.device import DeviceError
from pkmcal.live.folder import WatchedFolder
from pkmcal.live.person import PersonReads
from pkmcal.live.serial_gauge import SerialGauge, _number

MM = ("mm",)


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """The gauge's end of a line, and the name of the port; it ends when all is sent."""
    pytest.importorskip("serial")
    tty = pytest.importorskip("tty")
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for thread in threading.enumerate():
        if thread.name == f"gauge {master}":
            thread.join()
    for end in (master, slave):
        os.close(end)


def later(master: int, *lines: bytes, pause: float = 0.05) -> threading.Thread:
    def send() -> None:
        for line in lines:
            time.sleep(pause)
            os.write(master, line)

    thread = threading.Thread(target=send, daemon=True, name=f"gauge {master}")
    thread.start()
    return thread


def test_a_gauge_with_a_button_sends_one_line(terminal: tuple[int, str]) -> None:
    master, port = terminal
    os.write(master, b"+9.9999\r\n")  # pressed before it was asked: not this reading
    time.sleep(0.05)
    gauge = SerialGauge(port, MM)
    later(master, b"+0.12", b"34\r\n", pause=0.4)  # a person's finger is slower than a line
    np.testing.assert_array_equal(gauge.read(""), [0.1234])
    gauge.close()


def test_of_a_gauge_that_sends_by_itself_no_half_line_is_read(terminal: tuple[int, str]) -> None:
    master, port = terminal
    gauge = SerialGauge(port, MM)
    os.write(master, b"+0.1")
    later(master, b"234\r\n", b"+0.1235\r\n", b"+0.1236\r\n")
    # what was sent before it was asked is gone, and "234" would be a number
    np.testing.assert_array_equal(gauge.read(""), [0.1235])
    gauge.close()


class Port:
    """A port at which bytes arrive, None where nothing comes for a while."""

    timeout = 0.0

    def __init__(self, *sent: bytes | None) -> None:
        self.bytes = [byte for part in sent for byte in ([None] if part is None else part)]

    def reset_input_buffer(self) -> None: ...

    def read(self, count: int) -> bytes:
        byte = self.bytes.pop(0)
        return b"" if byte is None else bytes([byte])


@pytest.mark.parametrize(
    ("sent", "number"),
    [
        ((b"2.34\r\n", b"+0.1235\r\n"), 0.1235),  # of +12.34: asked in the middle of a line
        ((b"\n", b"+0.1235\r\n"), 0.1235),
        ((b"\r\n", b"+0.1235\r\n"), 0.1235),
        ((None, b"+0.1235\r\n", b"+9.9\r\n"), 0.1235),  # a button: nothing was on its way
    ],
)
def test_of_a_gauge_that_is_not_asked_the_first_whole_line_is_read(
    sent: tuple[bytes | None, ...], number: float
) -> None:
    """A second may go by from line to line: what came first is no line if it came at once."""
    gauge = SerialGauge.__new__(SerialGauge)
    gauge._port, gauge._name, gauge._question = Port(*sent), "x", ""
    np.testing.assert_array_equal(gauge.read(""), [number])


def test_a_gauge_that_is_asked(terminal: tuple[int, str]) -> None:
    master, port = terminal
    gauge = SerialGauge(f"{port},19200,R", MM)
    got: list[bytes] = []

    def answer() -> None:
        got.append(os.read(master, 10))
        os.write(master, b"01A-000.250\r")

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    np.testing.assert_array_equal(gauge.read(""), [-0.25])
    thread.join()
    assert got == [b"R\r\n"]
    gauge.close()


def test_a_gauge_that_is_pulled_out_is_said() -> None:
    pytest.importorskip("serial")
    tty = pytest.importorskip("tty")
    master, slave = os.openpty()
    tty.setraw(slave)
    gauge = SerialGauge(os.ttyname(slave), MM)
    os.close(slave)
    threading.Timer(0.1, os.close, (master,)).start()
    with pytest.raises(DeviceError, match=r"broke off|sends nothing"):
        gauge.read("")
    gauge.close()


@pytest.mark.parametrize(
    ("line", "number"),
    [(b"+0.1234", 0.1234), (b"-12,5 mm", -12.5), (b"01A+000.123", 0.123), (b"X 0.01in", 0.254),
     (b"+ 3.5", 3.5), (b"D: 7 mm", 7.0)],
)  # fmt: skip
def test_lines_of_gauges(line: bytes, number: float) -> None:
    assert _number(line, "x") == pytest.approx(number, rel=1e-12)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"ERR",
        b"1.2.3",
        b"1 2",
        b"+0.1 um",
        b"nan",
        b"0x10",
        b"1e5",
        b"ERR 2",
        b"Err0",
        b"911",
        b"Error 1.5",
        b"234",
        b"LOW BAT 1.0",
    ],
)
def test_lines_that_are_no_single_number_are_refused(line: bytes) -> None:
    with pytest.raises(DeviceError, match="no single number"):
        _number(line, "x")


def test_what_is_no_port_is_refused() -> None:
    pytest.importorskip("serial")
    with pytest.raises(DeviceError, match="nowhere"):
        SerialGauge("/dev/nowhere", MM)
    for address in (",9600", "/dev/x,fast"):
        with pytest.raises(ArgumentError, match="expected PORT"):
            SerialGauge(address, MM)
    with pytest.raises(ArgumentError, match="one length"):
        SerialGauge("/dev/x", ("mm", "mm", "mm"))


def write_end(path: Path) -> None:
    with open(path, "a") as file:
        file.write("11\n")


def test_the_line_that_is_added_to_a_folder_is_the_reading(tmp_path: Path) -> None:
    three = WatchedFolder(str(tmp_path), ("mm", "mm", "mm"))
    export = tmp_path / "export.txt"
    export.write_text("x;y;z\n1;2;3\n")

    def add(text: str, to: Path = export) -> None:
        def write() -> None:
            with open(to, "a") as file:
                file.write(text)

        threading.Timer(0.2, write).start()

    add("4.5;-6;7\n")
    np.testing.assert_array_equal(three.read(""), [4.5, -6.0, 7.0])
    add("8;9;10")  # without its end it is not whole
    threading.Timer(0.5, write_end, (export,)).start()
    np.testing.assert_array_equal(three.read(""), [8.0, 9.0, 1011.0])
    add("x,y,z\n1,1,2\n", tmp_path / "new.csv")
    np.testing.assert_array_equal(three.read(""), [1.0, 1.0, 2.0])
    for text, said in (("1;2\n", "expected a line of 3"), ("1;2;a\n", "expected a line"),
                       ("1;2;3\n4;5;6\n", "2 lines were added")):  # fmt: skip
        add(text)
        with pytest.raises(DeviceError, match=said):
            three.read("")
    with pytest.raises(ArgumentError, match="is no folder"):
        WatchedFolder(str(export), MM)


def test_a_file_that_is_written_anew_is_read_from_its_beginning(tmp_path: Path) -> None:
    """Longer than before, what stands behind its former end is no reading: 4, of 1.0034."""
    one = WatchedFolder(str(tmp_path), MM)
    last = tmp_path / "last.txt"
    last.write_text("1.00\n")
    threading.Timer(0.3, last.write_text, ("1.0034\n",)).start()
    np.testing.assert_array_equal(one.read(""), [1.0034])
    threading.Timer(0.3, last.write_text, ("1.0035\n",)).start()  # as long as before
    np.testing.assert_array_equal(one.read(""), [1.0035])
    threading.Timer(0.3, last.write_text, ("1.00\n",)).start()
    np.testing.assert_array_equal(one.read(""), [1.0])


def test_a_folder_that_is_gone_is_said(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    gone = WatchedFolder(str(tmp_path / "in"), MM)
    threading.Timer(0.2, (tmp_path / "in").rmdir).start()
    with pytest.raises(DeviceError, match="folder"):
        gone.read("")


def test_a_person_is_asked_until_a_number_is_typed() -> None:
    typed = iter(["", "x", "1 2", "inf", "1e200", "0.5"])
    questions: list[str] = []

    def ask(question: str) -> str:
        questions.append(question)
        return next(typed)

    np.testing.assert_array_equal(PersonReads("", MM, ask).read("row 1"), [0.5])
    assert questions[0] == "row 1: " and len(questions) == 6
    assert np.isnan(PersonReads("", MM, lambda _: " - ").read("")).all()
    pose = PersonReads("", ("mm", "rad"), lambda _: "3, 90").read("")
    np.testing.assert_allclose(pose, [3.0, np.pi / 2])

    def gone(question: str) -> str:
        raise EOFError

    with pytest.raises(DeviceError, match="nobody types"):
        PersonReads("", MM, gone).read("")
