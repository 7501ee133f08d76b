"""How good a model, a front view or the parser is: measures taken on results."""
