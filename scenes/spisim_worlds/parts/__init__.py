"""Shared parts of families: shapes, ground, plants, houses, vehicles, people and site equipment."""
