"""The command under test."""

import os

import pytest


@pytest.fixture
def masseter_command() -> str:
    return os.environ["MASSETER"]
