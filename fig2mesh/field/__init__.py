"""Signed distance fields: bodies as unions of grids, their algebra, sphere tracing and cameras (paper §4.5).

`body.Body` is the field, `trace.trace` traces it, `camera` makes the rays, `analytic` holds formulas to test against,
`reference` the plain NumPy twins of the compiled kernels.
"""
