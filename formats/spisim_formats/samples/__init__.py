"""Export formats for the samples of data sets, one module each."""
