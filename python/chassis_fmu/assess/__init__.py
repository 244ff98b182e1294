"""The page of a test-bench assessment (`chassis bench run`), with figures."""
