"""Models of the correction factor h: their inputs, data set, files and error bounds."""
