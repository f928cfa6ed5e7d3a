"""Print the lowest version of each dependency that ``pyproject.toml`` allows, as constraints for pip."""

import re
import tomllib
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"

for requirement in tomllib.loads(PROJECT.read_text())["project"]["dependencies"]:
    print(re.sub(r">=", "==", requirement))
