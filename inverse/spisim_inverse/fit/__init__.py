"""Fits of scene and instrument to a recording, by maximum likelihood."""
