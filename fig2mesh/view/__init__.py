"""`fig2mesh view`: sphere tracing of a figure's part fields in a browser (paper §4.5)."""
