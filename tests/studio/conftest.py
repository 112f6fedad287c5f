"""What the tests of the page share."""

from studio.browser import chromium  # noqa: F401 - a fixture
