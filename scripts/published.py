"""Print the names of the library crates that are published."""

import json
import subprocess

command = ["cargo", "metadata", "--no-deps", "--locked", "--format-version", "1"]
for package in json.loads(subprocess.check_output(command))["packages"]:
    # `publish` is null by default, and an empty list for `publish = false`.
    if package["publish"] is None and any("lib" in target["kind"] for target in package["targets"]):
        print(package["name"])
