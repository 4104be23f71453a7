"""Physical constants, defined here because SciPy is slow to import."""

c = 299_792_458.0
"""Speed of light in vacuum, m/s."""
