"""The pictures of the models: block, equations and a demonstration run."""
