"""Models on a globe in the browser: files that CesiumJS reads, whoever wrote them."""
