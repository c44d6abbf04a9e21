"""Segmenters and encoders."""
