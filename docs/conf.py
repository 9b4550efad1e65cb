"""Settings of Sphinx; the reference pages are written before it looks for pages."""

import logging
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import reference  # noqa: E402

from echoset import __version__  # noqa: E402

project = "echoset"
author = "The echoset developers"
version = release = __version__
extensions = ["mathml", "myst_parser"]
html_math_renderer = "mathml"
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"echoset {release}"
html_show_copyright = False

reference.write(HERE / "reference")

# Results are taken up where they have been made; Sphinx gives its warning no type to suppress.
logging.getLogger("sphinx.sphinx.directives.other").addFilter(
    lambda record: "didn't match any documents" not in str(record.msg)
)
