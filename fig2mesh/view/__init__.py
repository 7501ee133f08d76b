"""`fig2mesh view`: a figure's part fields, sphere traced by a browser (paper §4.5)."""
