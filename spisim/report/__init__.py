"""Pages and pictures about captures, data sets, flights, studies and scenes: one module each."""
