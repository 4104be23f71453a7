"""Instruments chosen by what they measure, over scenes, for a purpose: `spisim design`."""
