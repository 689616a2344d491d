"""Interactive viewer: data of a run, HTTP server, single-file page, notebook widget, films."""
