"""From recordings back to what made them: fits of scene and instrument, and design by bounds."""
