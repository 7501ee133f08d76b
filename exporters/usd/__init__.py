"""OpenUSD: writing, checking and inspecting stages; strangers' stages are read in a process of their own."""
