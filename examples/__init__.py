"""Runnable cases with their data."""
