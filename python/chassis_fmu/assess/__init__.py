"""The page of an assessment: what the test bench, `cargo fmu assess`, says of a vehicle, with figures."""
