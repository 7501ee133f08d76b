"""The stages from a drawn figure to a model, one file each, in the table of `fig2mesh.stages.table`.

Pure: no files, no clock, no terminal. A stage is one function. Its name is the name of its file, of its result and of
the stage on the command line; its positional parameters are the results that it needs, its keyword-only parameters
are the settings that it reads. `fig2mesh.conversion.runner` runs them.
"""
