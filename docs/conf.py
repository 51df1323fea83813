"""The Markdown pages as a site: `sphinx-build -W docs build/docs`."""

project = html_title = "ringrig"
html_theme = "furo"
# Summaries are 100 columns wide.
html_theme_options = {"light_css_variables": {"code-font-size": "0.72rem"}}
highlight_language = "text"
html_show_copyright = False
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
# What a code host shows of this folder; index.md takes it in.
exclude_patterns = ["README.md"]
myst_heading_anchors = 4
# Pages that exist outside this folder are named, not linked; others still warn.
nitpick_ignore_regex = [("myst", "/.*")]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
add_module_names = False
