"""A simulated drone that replaces a rig: streams its frames and flies as commanded."""
