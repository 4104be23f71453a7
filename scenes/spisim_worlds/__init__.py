"""Worlds to fly in: one module per family, which draws one scene per seed.

`spisim` finds them only through the entry point `spisim.families`, like families of other packages.
`spisim_worlds.parts` has what families share.
"""
