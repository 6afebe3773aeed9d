"""Builds, checks and tries what is published: wheels and the source distribution. See docs/release.md."""
