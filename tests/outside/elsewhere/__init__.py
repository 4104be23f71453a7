"""A package of somebody else that adds one of each kind, each in one file."""
