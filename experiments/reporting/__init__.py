"""Output shared by all experiments: files, HTML pages, plots, pictures without a display."""
