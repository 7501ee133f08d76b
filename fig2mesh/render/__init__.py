"""Pictures of figures and models: stills and turntables, with effects that cost nothing unless requested."""
