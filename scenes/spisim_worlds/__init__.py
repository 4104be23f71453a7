"""Worlds to fly in: one module a family, which draws as many scenes as there are seeds.

`spisim` reaches them through the entry point `spisim.families` alone, as it does the families of
other packages. What families share is in `spisim_worlds.parts`.
"""
