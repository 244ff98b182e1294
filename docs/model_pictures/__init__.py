"""The pictures of the models: a block with ports and the results of a run."""
