"""Machines that the tests of this room share."""

from __future__ import annotations

import pytest

import pkmcal as pk


@pytest.fixture(scope="session")
def hexapod() -> pk.Robot:
    return pk.load("hexapod")
