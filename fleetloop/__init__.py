"""The operator's tools: command line, launch, record, report, diff."""
