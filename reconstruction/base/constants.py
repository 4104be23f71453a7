"""Constants of nature; from here rather than from SciPy, which is slow to load."""

c = 299_792_458.0
"""Speed of light in vacuum, m/s."""
