"""What is odd about a scene but does not stop anybody from simulating it."""


class SceneWarning(UserWarning):
    """A scene that may not mean what its author thinks."""
