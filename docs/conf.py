"""Settings of Sphinx; the reference pages are written before it looks for pages."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import reference  # noqa: E402

from echoset import __version__  # noqa: E402

project = "echoset"
author = "The echoset developers"
version = release = __version__
extensions = ["myst_parser"]
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
# Tables of results and pages on campaigns are taken up where they are.
suppress_warnings = ["toc.empty_glob"]
html_theme = "furo"
html_title = f"echoset {release}"
html_show_copyright = False

reference.write(HERE / "reference")
