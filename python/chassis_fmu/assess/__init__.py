"""The page of an assessment by the test bench, `chassis bench run`, with figures."""
