"""The page of an assessment: what the test bench, `chassis bench run`, says of a vehicle, with figures."""
