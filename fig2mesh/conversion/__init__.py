"""From a request to a model and its report: the stages, what runs them, what keeps their results."""
