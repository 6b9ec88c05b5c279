"""Robots for controllers, and back: `pk.export`."""

from pkmcal.export.c_header import c_header as c_header

__all__ = ["c_header"]
