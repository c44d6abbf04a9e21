"""Runs agents over episodes; records, metrics, reports, the command line."""
