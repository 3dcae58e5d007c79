"""Run, measure, report: the command line and one readable script per experiment."""
