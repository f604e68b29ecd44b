"""`fly`: a person flies tasks in the browser, as an agent of the evaluator's own loop."""
