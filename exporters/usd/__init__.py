"""OpenUSD: writing, checking and inspecting stages; stages are read in a separate process."""
