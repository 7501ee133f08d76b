"""Models on a globe in the browser, from any files that CesiumJS reads."""
