"""The fixture `drives` of pytest, which is there wherever the package is installed."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from masseter_drives import Drives


@pytest.fixture
def drives() -> Iterator[Callable[..., Drives]]:
    """Makes drives with the arguments of masseter_drives.Drives, and switches them off after the test.

        def test_my_program(drives):
            bus = drives(nodes=[1], profile="epos4")
    """
    with ExitStack() as stack:
        yield lambda *arguments, **settings: stack.enter_context(Drives(*arguments, **settings))
