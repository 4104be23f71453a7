"""Pages and figures of captures, data sets, flights, studies and scenes: one module each."""
